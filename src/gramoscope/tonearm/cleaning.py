"""What stretches are asked before their groove is smoothed: which samples the others contradict, and where it is restless.

Each stretch is taken for itself, from its prior on, by eight filters abreast.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.cache_line import double_room
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.quantile import quantile
from gramoscope.tonearm.abreast import FILTERS
from gramoscope.tonearm.batch import Batch
from gramoscope.tonearm.groove_model import ANYWHERE_M, PATIENCE, ROUNDS, Beliefs, beginning, moves, robustly
from gramoscope.tonearm.groove_prior import taylor
from gramoscope.tonearm.linear_gaussian import FORGIVENESS
from gramoscope.tonearm.small_matrices import STATES
from gramoscope.tonearm.walls_abreast import (
    ACROSS,
    ALLOWED,
    AWAY,
    BOTH,
    CHANGES,
    EXPECTED,
    GAIN,
    GAINS,
    KEPT,
    LOUDNESS,
    MEAN,
    MOST_MISSED,
    PRECISION,
    PRODUCTS,
    READINGS,
    ROOM,
    SQUARES,
    STATE,
    TALLIES,
    TAYLOR,
    VARIANCE,
    WALLS,
    across,
    across_back,
    moved,
    moved_back,
    observe,
    square,
    square_back,
    times_both,
    times_taylor,
    unobserve,
)

AGITATION_LIMIT = 1e4
"""No neighbourhood is louder than its stretch by more, as a variance."""
AGITATION_BINS, AGITATION_ROUNDS = 16, 6
"""Size of a neighbourhood, and how often at the most its noise is raised."""
AGITATED = 4.0
"""Innovations so many times (as variances) as large as believed are no chance."""
AGREEMENT = 9.0
"""Square of the standard deviations that the second wall may be off the first."""
NORMAL_MEDIAN = 0.455
"""Median of the square of a normal number."""
L_P, V_P = CHANGES, CHANGES + STATES
L_Q, V_Q = L_P + BOTH, V_P + BOTH
L_R, V_R = L_Q + BOTH, V_Q + BOTH
L_S, V_S = L_R + BOTH, V_R + BOTH
"""Rows of the room: both directions of what changes a matrix, p, q, r and s."""
_LATERAL, _ACROSS, _VERTICAL = STATE + SQUARES[0], STATE + ACROSS, STATE + SQUARES[1]


@numba.njit(cache=True, nogil=True)
def _begin(room, at_rest, sigma, rows, gains, first):  # type: ignore[no-untyped-def]
    """Write what is known of eight filters before anything was seen; those without a stretch are silent."""
    room[:] = 0.0
    for lane in range(min(FILTERS, len(sigma) - first)):
        for direction in range(2):
            loudness = sigma[first + lane, direction] ** 2
            block = SQUARES[direction]
            room[LOUDNESS + direction, lane] = loudness
            room[STATE + block, lane] = ANYWHERE_M**2
            for i in range(1, STATES):
                for j in range(1, STATES):
                    room[STATE + block + STATES * i + j, lane] = loudness * at_rest[direction, i - 1, j - 1]
        for k in range(STATES):
            room[TAYLOR + k, lane] = rows[first + lane, k]
        for wall in range(WALLS):
            room[GAINS + wall, lane] = gains[wall]


@numba.njit(cache=True, nogil=True)
def _forward(room, a, q, readings, agitation, gate, kept):  # type: ignore[no-untyped-def]
    """Filter all bins from what is in the room on; the gate is a square."""
    for k in range(len(agitation)):
        times_taylor(room, STATE, 0, room, TAYLOR, 0, room, PRODUCTS, 0)
        observe(gate, float(FORGIVENESS), room, 0, 0, readings, READINGS * k, 0, kept, KEPT * k, 0)
        for lane in range(FILTERS):
            room[LOUDNESS + 2, lane] = room[LOUDNESS, lane] * agitation[k, lane]
            room[LOUDNESS + 3, lane] = room[LOUDNESS + 1, lane] * agitation[k, lane]
        square(a, 0, 0, room, _LATERAL, 0, room, L_P, 0, room, L_Q, 0, room, L_R, 0, room, L_S, 0, q, 0, 0, room, LOUDNESS + 2, 0)  # fmt: skip  # noqa: E501
        across(a, STATES, 0, a, 0, 0, room, _ACROSS, 0, room, V_P, 0, room, L_Q, 0, room, V_R, 0, room, L_S, 0)
        square(a, STATES, 0, room, _VERTICAL, 0, room, V_P, 0, room, V_Q, 0, room, V_R, 0, room, V_S, 0, q, STATES, 0, room, LOUDNESS + 3, 0)  # fmt: skip  # noqa: E501
        moved(a, 0, 0, room, MEAN, 0)


@numba.njit(cache=True, nogil=True)
def _backward(room, a, readings, kept, off):  # type: ignore[no-untyped-def]
    """Write how many standard deviations each reading lies from what all others say of it."""
    room[STATE : MEAN + BOTH] = 0.0
    for k in range(len(off) // WALLS - 1, -1, -1):
        for wall in range(WALLS):
            times_both(room, STATE, 0, kept, KEPT * k + GAIN + BOTH * wall, 0, room, PRODUCTS + BOTH * wall, 0)
        unobserve(room, 0, 0, readings, READINGS * k, 0, kept, KEPT * k, 0, off, WALLS * k, 0)
        # of the lateral direction y lies where p does, of the vertical one where q does
        square_back(a, 0, 0, room, _LATERAL, 0, room, TAYLOR, 0, room, L_P, 0, room, L_P, 0, room, TAYLOR, 0)
        across_back(a, STATES, 0, a, 0, 0, room, _ACROSS, 0, room, TAYLOR, 0, room, L_Q, 0, room, V_P, 0, room, TAYLOR, 0)  # fmt: skip  # noqa: E501
        square_back(a, STATES, 0, room, _VERTICAL, 0, room, TAYLOR, 0, room, V_Q, 0, room, V_Q, 0, room, TAYLOR, 0)
        moved_back(a, 0, 0, room, MEAN, 0)


@numba.njit(cache=True, nogil=True)
def _judge(readings, off, gate):  # type: ignore[no-untyped-def]
    """Allow the readings that the others agree with; return whether that changes anything."""
    changed = False
    for k in range(len(off) // WALLS):
        for wall in range(WALLS):
            for lane in range(FILTERS):
                if readings[READINGS * k + VARIANCE + wall, lane] < np.inf:
                    accepted = 1.0 if off[WALLS * k + wall, lane] <= gate else 0.0
                    changed |= accepted != readings[READINGS * k + ALLOWED + wall, lane]
                    readings[READINGS * k + ALLOWED + wall, lane] = accepted
    return changed


@numba.njit(cache=True, nogil=True)
def _keep_used(readings, kept):  # type: ignore[no-untyped-def]
    """Allow the readings that a first pass has used."""
    for k in range(len(readings) // READINGS):
        for wall in range(WALLS):
            for lane in range(FILTERS):
                used = kept[KEPT * k + PRECISION + wall, lane] > 0
                readings[READINGS * k + ALLOWED + wall, lane] = 1.0 if used else 0.0


@numba.njit(cache=True, nogil=True)
def _clean(a, q, at_rest, sigma, rows, gains, readings, gate, lost):  # type: ignore[no-untyped-def]
    """Allow, in all eights, the readings that the others agree with; tell which stretches lost a wall."""
    bins = readings.shape[1]
    room, kept, off = _rows(ROOM), _rows(KEPT * bins), _rows(WALLS * bins)
    calm = np.ones((bins, FILTERS))
    for eight in range(len(readings)):
        seen = readings[eight].reshape(bins * READINGS, FILTERS)
        first = eight * FILTERS
        _begin(room, at_rest, sigma, rows, gains, first)
        _forward(room, a, q, seen, calm, gate**2, kept)
        for lane in range(min(FILTERS, lost.size - first)):
            lost[first + lane] = room[TALLIES + MOST_MISSED, lane] >= PATIENCE
        _backward(room, a, seen, kept, off)
        _keep_used(seen, kept)
        before = seen.copy()
        again = ROUNDS if _judge(seen, off, gate) else 0
        for _ in range(again):
            before[:] = seen
            _begin(room, at_rest, sigma, rows, gains, first)
            _forward(room, a, q, seen, calm, np.inf, kept)
            _backward(room, a, seen, kept, off)
            if not _judge(seen, off, gate):
                break
        if again:
            seen[:] = before


def contradicted(batch: Batch, believed: Beliefs, gains: FloatArray, *, gate: float) -> BoolArray:
    """Return which samples all others of their stretch contradict, by what is believed of the groove.

    Parameters
    ----------
    batch : Batch
    believed : Beliefs
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move towards +l when the groove rises by one.
    gate : float
        Standard deviations.

    Returns
    -------
    bool array, shape (stretch, 2, sample)
        What was suspect before and is not any more among them; of samples that were not measured, what it was.
    """
    readings, lost = batch.readings(), np.zeros(batch.size.size, np.bool_)
    _clean(*_matrices(believed), believed.at_rest, believed.sigma(batch.level), taylor(batch.fraction), gains, readings, gate, lost)  # fmt: skip  # noqa: E501
    suspect = batch.suspect.copy()
    _write_suspects(readings, suspect)
    samples = batch.samples() if lost.any() else []
    for i in np.flatnonzero(lost):
        first, model = int(batch.first_bin[i]), believed.model(int(batch.first_bin[i]), batch.level[i])
        measured = samples[i].measured(first, first + int(batch.size[i]))
        fresh = samples[i].part(measured)
        followed = robustly(
            moves([model], first, first + int(batch.size[i])),
            fresh.readings(first_bin=first, step_m=batch.step_m, gains=gains),
            ~fresh.suspect,
            beginning(model, first),
            gate=gate,
            resume_bin=first,
        )
        mine = samples[i].suspect.copy()
        mine[measured] = ~followed.accepted
        suspect[i, :, : batch.size[i]] = mine.reshape(2, -1, order="F")
    return suspect


@numba.njit(cache=True, nogil=True)
def _write_suspects(readings, suspect):  # type: ignore[no-untyped-def]
    for i in range(len(suspect)):
        for wall in range(WALLS):
            for k in range(suspect.shape[2]):
                if readings[i // FILTERS, k, VARIANCE + wall, i % FILTERS] < np.inf:
                    suspect[i, wall, k] = readings[i // FILTERS, k, ALLOWED + wall, i % FILTERS] == 0


def _matrices(believed: Beliefs) -> tuple[FloatArray, FloatArray]:
    """A and Q of both directions, one below the other."""
    return believed.a.reshape(2 * STATES, STATES), believed.q.reshape(2 * STATES, STATES)


@numba.njit(cache=True, nogil=True)
def _rows(count):  # type: ignore[no-untyped-def]
    """Room for so many rows of all filters."""
    return double_room(count * FILTERS).reshape(count, FILTERS)


def agitations(batch: Batch, believed: Beliefs, gains: FloatArray) -> list[FloatArray]:
    """Return how much more restless the groove is, bin by bin of each stretch, than is believed of it.

    The level of a stretch is one number, and clicks and attacks are short. Where half of the innovations of a
    neighbourhood are larger than they should be, the groove moves and nothing is wrong with the readings: there the noise
    that drives it is raised until they are not.

    Parameters
    ----------
    batch : Batch
    believed : Beliefs
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move towards +l when the groove rises by one.

    Returns
    -------
    list of float64 arrays, shape (bin,)
        1 where all is as believed; from the first bin of a stretch to its last that was measured.
    """
    readings = batch.readings()
    factor, last = np.ones((batch.size.size, readings.shape[1])), np.zeros(batch.size.size, np.int64)
    _agitate(*_matrices(believed), believed.at_rest, believed.sigma(batch.level), taylor(batch.fraction), gains, readings, factor, last)  # fmt: skip  # noqa: E501
    return [mine[: end + 1] for mine, end in zip(factor, last.tolist(), strict=True)]


@numba.njit(cache=True, nogil=True)
def _agitate(a, q, at_rest, sigma, rows, gains, readings, factor, last):  # type: ignore[no-untyped-def]
    """Raise the factors of all stretches, [stretch, bin], and write the last bins that were read."""
    bins = readings.shape[1]
    room, kept, restless = _rows(ROOM), _rows(KEPT * bins), _rows(bins)
    number, surprise = np.empty(bins, np.int64), np.empty(bins)
    for eight in range(len(readings)):
        seen, first = readings[eight].reshape(bins * READINGS, FILTERS), eight * FILTERS
        stretches = min(FILTERS, len(factor) - first)
        restless[:] = 1.0
        for _ in range(AGITATION_ROUNDS):
            _begin(room, at_rest, sigma, rows, gains, first)
            _forward(room, a, q, seen, restless, np.inf, kept)
            again = False
            for lane in range(stretches):
                known, last[first + lane] = _surprise(seen, kept, lane, number, surprise)
                again |= _raise(number[:known], surprise[:known], last[first + lane] + 1, restless[:, lane])
            if not again:
                break
        for lane in range(stretches):
            factor[first + lane] = restless[:, lane]


@numba.njit(cache=True, nogil=True)
def _surprise(readings, kept, lane, number, surprise):  # type: ignore[no-untyped-def]
    """Write bins that both walls read, and by how many variances both differ from their prediction, 0 where they disagree.

    One wall alone can be wrong by itself; a groove that moves takes both, to the same side or to opposite ones.

    Returns how many such bins there are, and the last bin that was read at all.
    """
    known, last = 0, 0
    for k in range(len(readings) // READINGS):
        here, there = READINGS * k, KEPT * k
        one, other = readings[here + VARIANCE, lane], readings[here + VARIANCE + 1, lane]
        if one < np.inf or other < np.inf:
            last = k
        if readings[here + ALLOWED, lane] > 0 and readings[here + ALLOWED + 1, lane] > 0:
            away, beside = kept[there + AWAY, lane], kept[there + AWAY + 1, lane]
            apart = min((away - beside) ** 2, (away + beside) ** 2)
            number[known], surprise[known] = k, 0.0
            if apart < AGREEMENT * (one + other):
                surprise[known] = min(
                    away**2 / (kept[there + EXPECTED, lane] + one),
                    beside**2 / (kept[there + EXPECTED + 1, lane] + other),
                )
            known += 1
    return known, last


@numba.njit(cache=True, nogil=True)
def _raise(bins, surprise, size, factor):  # type: ignore[no-untyped-def]
    """Raise a factor where the median of the surprise, over that of a normal number, is large; tell whether it is anywhere."""
    if np.count_nonzero(surprise > AGITATED * NORMAL_MEDIAN) < AGITATION_BINS // 4:
        return False
    excess = np.ones(size)
    for first in range(0, size, AGITATION_BINS // 2):
        near = surprise[np.searchsorted(bins, first) : np.searchsorted(bins, first + AGITATION_BINS)]
        if near.size >= AGITATION_BINS // 2:
            ratio = quantile(near, 0.5) / NORMAL_MEDIAN
            if ratio > AGITATED:
                for k in range(first, min(first + AGITATION_BINS, size)):
                    excess[k] = max(excess[k], ratio)
    for k in range(size):
        if excess[k] > 1:
            factor[k] = min(factor[k] * excess[k] ** 2, AGITATION_LIMIT)
    return excess.max() > 1
