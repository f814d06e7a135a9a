"""All stripes of a stretch heard at once: from its picture and a path to what every column says, in a few kernels.

The steps are those of `following`, `spectrum`, `filter_bank` and `likelihood`, which learning takes one by one. Reading takes
them hundreds of times a second, and there what lies between the steps would cost as much as they do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from gramoscope.cache_line import at_a_line, single_room
from gramoscope.conventions import INNER, OUTER, BoolArray, Float32Array, FloatArray, IntArray
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.following import REACH, STEPS, step_mixtures, step_of, stepped, wide_rows
from gramoscope.pickup.texture.lane_transform import PAIR, fold, let_through, plan_for, transform
from gramoscope.pickup.texture.layout import StripeLayout, see_stripe
from gramoscope.pickup.texture.likelihood import (
    LOUDNESS_BELL,
    TAPERED,
    TEMPER,
    TEXTURE_PX,
    StripeStatistics,
    soften,
    temper,
    within,
)
from gramoscope.pickup.texture.spectrum import Band, half_of
from gramoscope.pickup.texture.vector_lanes import AT_ONCE, filter_symmetrically, mix, squares_by_lane
from gramoscope.pickup.texture.vector_lanes import power as usual_power

if TYPE_CHECKING:
    from gramoscope.pickup.texture.stretch import Stretch

BURNT_SHARE = 0.15
"""Of the rows of a window in one column: a bright grain or two do no harm, a scratch does."""


@dataclass(frozen=True, eq=False)
class Ear:
    """The stripes of a model that can be read, laid together.

    Attributes
    ----------
    number : int64 array, shape (stripe,)
        Which of the layout's stripes these are.
    wall : int64 array, shape (stripe,)
    basis : float32 array, shape (stripe, row, channel)
        Of a window and the rows beyond it.
    usual : float32 array, shape (stripe, channel, 16)
    filters : float32 array, shape (stripe, bin in the band, filter, channel)
    sign : float32 array, shape (stripe, filter)
    mean_score, trust, information, score_power : float64 arrays, shape (stripe,)
        See `likelihood.StripeStatistics`.
    half_taps : float32 array
        Of the whitener, from its middle on.
    half_px : int
    band : Band
    length : int
        Of the transforms.
    """

    number: IntArray
    wall: IntArray
    basis: Float32Array
    usual: Float32Array
    filters: Float32Array
    sign: Float32Array
    mean_score: FloatArray
    trust: FloatArray
    information: FloatArray
    score_power: FloatArray
    half_taps: Float32Array
    half_px: int
    band: Band
    length: int

    @cached_property
    def in_lanes(self) -> tuple[Float32Array, Float32Array, Float32Array]:
        """What makes channels of the picture's rows, step by step, what is usual and the filters; of sixteen channels."""
        mixtures = [step_mixtures(basis) for basis in _in_lanes(self.basis, (2,))]
        weights = _stacked(mixtures, 3), _in_lanes(self.usual, (1,)), _in_lanes(self.filters, (3,))
        return at_a_line(weights[0]), at_a_line(weights[1]), at_a_line(weights[2])

    @cached_property
    def for_listening(self) -> tuple[tuple[Float32Array | FloatArray, ...], tuple[Any, ...], int]:
        """What `listen` needs of an ear: its weights, the plan of its transforms, and the first bin of its band."""
        plan = plan_for(self.length)
        weights = (self.half_taps, *self.in_lanes, self.sign, self.mean_score, self.trust)
        return weights, (plan.radix, plan.twiddle, plan.turn), self.band.bins(self.length).start

    @cached_property
    def trusted_information(self) -> FloatArray:
        """I²/J of one column, shape (stripe,)."""
        return self.trust * self.information


def ear_of(
    stripes: Sequence[StripeStatistics | None],
    wall: IntArray,
    whitener: FloatArray,
    *,
    half_px: int,
    band: Band,
    length: int,
) -> Ear:
    """Return the ear of stripes with these statistics; None for those that are not to be read."""
    known = [(number, one) for number, one in enumerate(stripes) if one is not None]
    number = np.array([n for n, _ in known], np.int64)
    channels = max((one.bank.basis.shape[1] for _, one in known), default=0)
    basis = np.zeros((len(known), wide_rows(half_px), channels), np.float32)
    for i, (_, one) in enumerate(known):
        basis[i, : one.bank.basis.shape[0]] = one.bank.basis
    banks = [one.bank for _, one in known]
    return Ear(
        number,
        wall[number],
        basis,
        _stacked([bank.usual for bank in banks], 2),
        _stacked([bank.filters for bank in banks], 3),
        _stacked([bank.sign for bank in banks], 1),
        np.array([one.mean_score for _, one in known]),
        np.array([one.trust for _, one in known]),
        np.array([one.information for _, one in known]),
        np.array([one.score_power for _, one in known]),
        half_of(whitener),
        half_px,
        band,
        length,
    )


def _stacked(arrays: list[Float32Array], axes: int) -> Float32Array:
    return np.ascontiguousarray(np.stack(arrays)) if arrays else np.zeros((0,) * (axes + 1), np.float32)


def clear_columns(
    stretch: Stretch, layout: StripeLayout, number: IntArray, *, half_px: int, least_support: float
) -> tuple[FloatArray, BoolArray]:
    """Return where stripes run, and in which columns they are there and can be seen whole.

    Parameters
    ----------
    stretch : Stretch
    layout : StripeLayout
    number : int64 array, shape (stripe,)
        Which of its stripes.
    half_px : int
        Of the windows.
    least_support : float
        Sharpness without which a stripe is not there.

    Returns
    -------
    rows : float64 array, shape (stripe, column)
    clear : bool array, shape (stripe, column)
        Where a stripe is sharp, in its half of the picture, seen by enough frames and not burnt.
    """
    rows = np.empty((number.size, stretch.usable.size))
    clear = np.empty(rows.shape, np.bool_)
    _clear(stretch.displacement_px, number, *_in_sight(stretch, layout, half_px, least_support), rows, clear)
    return rows, clear


def _in_sight(stretch: Stretch, layout: StripeLayout, half_px: int, least_support: float) -> tuple[Any, Any, Any]:
    """Return what `_clear` must know of the stripes, of what is needed of them, and of the picture."""
    return (
        (layout.rest_row, layout.wall, layout.seen_between, layout.middle_row),
        (float(half_px), layout.on_wall_px(half_px), float(least_support)),
        (stretch.usable, stretch.burnt, stretch.support),
    )


@numba.njit(cache=True, nogil=True)
def _clear(displacement, number, stripes, needed, picture, rows, clear):  # type: ignore[no-untyped-def]
    """Write where stripes run, and which columns are seen whole, usable, supported and not burnt."""
    rest_row, wall, limits, middle_row = stripes
    half_px, from_middle, least_support = needed
    usable, burnt, support = picture
    middle = np.empty(usable.size)
    for x in range(usable.size):
        middle[x] = middle_row + 0.5 * (displacement[INNER, x] + displacement[OUTER, x])
    for i, stripe in enumerate(number):
        for x in range(usable.size):
            rows[i, x] = rest_row[stripe] + displacement[wall[stripe], x]
            clear[i, x] = usable[x] and support[stripe, x] >= least_support
        see_stripe(rows[i], middle, wall[stripe], limits[:, stripe], from_middle, half_px, clear[i])
    if len(burnt) > 0:
        _burn(burnt, rows, half_px, clear)


@numba.njit(cache=True, nogil=True)
def _burn(burnt, rows, half_px, clear):  # type: ignore[no-untyped-def]
    """Take away the columns in which too much of a window is burnt."""
    spoilt = np.zeros(rows.shape[1], np.int64)
    for i in range(len(rows)):
        spoilt[:] = 0
        for x, row in burnt:
            spoilt[x] += abs(row - np.rint(rows[i, x])) <= half_px
        for x, _ in burnt:
            clear[i, x] &= spoilt[x] <= BURNT_SHARE * (2 * half_px + 1)


@numba.njit(cache=True, nogil=True)
def _sort_by_step(row, height, half, rows, begin, rooms):  # type: ignore[no-untyped-def]
    """Sort columns by the step between rows that a path is at; return how many windows leave the picture, and which.

    Places in the picture and among channels of sixteen go to the rooms, those of a step from its begin on in fours, of which
    the last one is filled up by one more of the same. Eight more places may be called for.
    """
    first_row, step, order, places, targets = rooms
    begin[:] = 0
    outside = 0
    for x in range(row.size):
        first_row[x], step[x] = step_of(row[x], half)
        if first_row[x] >= 0 and first_row[x] + rows <= height:
            begin[step[x] + 1] += 1
        else:
            step[x] = STEPS
            order[outside] = x
            outside += 1
    for p in range(STEPS):
        begin[p + 1] = begin[p] + (begin[p + 1] + AT_ONCE - 1) // AT_ONCE * AT_ONCE
    places[begin[STEPS] : begin[STEPS] + 2 * AT_ONCE] = 0
    for x in range(row.size):
        if step[x] < STEPS:
            at = begin[step[x]]
            begin[step[x]] = at + 1
            places[at], targets[at] = x * height + first_row[x], x * LANES
    for p in range(STEPS):
        last = begin[p]
        while last % AT_ONCE:
            places[last], targets[last] = places[last - 1], targets[last - 1]
            last += 1
    return outside


@numba.njit(cache=True, nogil=True)
def _mix(columns, row, half, mixtures, begin, rooms, lines):  # type: ignore[no-untyped-def]
    """Write the channels of windows about a path, all columns of a step together; the picture's last rows are repeated."""
    height, rows = columns.shape[1], mixtures.shape[1]
    _, _, order, places, targets = rooms
    picture, mixture = columns.reshape(columns.size), mixtures.reshape(mixtures.size)
    outside = _sort_by_step(row, height, half, rows, begin, rooms)
    number = 0
    for p in range(STEPS):
        while number < begin[p]:
            mix(picture, places, number, rows, mixture, p * rows * LANES, lines, targets)
            number += AT_ONCE
    edge = np.empty(rows, np.float32)
    for x in order[:outside]:
        first, step = step_of(row[x], half)
        for j in range(rows):
            edge[j] = columns[x, min(max(first + j, 0), height - 1)]
        places[: 2 * AT_ONCE], targets[:AT_ONCE] = 0, x * LANES
        mix(edge, places, 0, rows, mixture, step * rows * LANES, lines, targets)


@numba.njit(cache=True, nogil=True)
def _whiten(wide, width, half_taps, usual, white, power):  # type: ignore[no-untyped-def]
    """Write whitened channels and how much of the usual texture they show; columns in fours, channels sixteen.

    Before and after the channels are as many columns as the whitener reaches; they are mirrored there.
    """
    reach = half_taps.size - 1
    lines, form = wide.reshape(wide.size), usual.reshape(usual.size)
    out, powers = white.reshape(white.size), np.empty((len(white), 2), np.float32)
    into = powers.reshape(powers.size)
    for k in range(reach):
        # a window that is shorter than the mirror repeats its other end
        mirrored = min(k, width - 1)
        for c in range(LANES):
            wide[reach - 1 - k, c] = wide[reach + mirrored, c]
            wide[reach + width + k, c] = wide[reach + width - 1 - mirrored, c]
    for x in range(0, len(white), AT_ONCE):
        filter_symmetrically(lines, (reach + x) * LANES, half_taps, reach, out, x * LANES)
        usual_power(out, x * LANES, form, 0, into, 2 * x)
    power[:] = powers[:width]


@numba.njit(cache=True, nogil=True)
def _draw(columns, row, clear, half_px, half_taps, mixtures, usual, limits, rooms, drawn, weight):  # type: ignore[no-untyped-def]
    """Write the whitened channels of a stripe, times their weight, and the weight; columns beyond the picture are black."""
    begin, sorting, wide, white, power, valid = rooms
    width, reach = columns.shape[0], half_taps.size - 1
    lines = wide.reshape(wide.size)[reach * LANES :]
    _mix(columns, row, half_px + REACH, mixtures, begin, sorting, lines)
    _whiten(wide, width, half_taps, usual, white, power)
    within(power, TEXTURE_PX // 2, limits[0], limits[1], valid)
    valid &= clear
    soften(valid, TAPERED, weight)
    for x in range(width):
        share = weight[x]
        for c in range(LANES):
            drawn[x, c] = white[x, c] * share


@numba.njit(cache=True, nogil=True)
def _rooms(width, reach):  # type: ignore[no-untyped-def]
    """Return room for what `_draw` needs; columns beyond the picture are black."""
    padded = -(-width // AT_ONCE) * AT_ONCE
    wide = single_room((padded + 2 * reach) * LANES).reshape(padded + 2 * reach, LANES)
    white = single_room(padded * LANES).reshape(padded, LANES)
    wide[reach + width :] = np.float32(0)
    most = width + AT_ONCE * (STEPS + 2)
    whole = (np.empty(width, np.int64), np.empty(width, np.int64), np.empty(width, np.int64))
    begin, sorting = np.empty(STEPS + 1, np.int64), (*whole, np.empty(most, np.int64), np.empty(most, np.int64))
    return begin, sorting, wide, white, np.empty((width, 2), np.float32), np.empty(width, np.bool_)


@numba.njit(cache=True, nogil=True)
def _squares(answers, width, lines):  # type: ignore[no-untyped-def]
    """Write the squares of answers, whose parts are exchanged, see `fold`, as lines, one of each lane."""
    apart, line = lines.shape[1], lines.reshape(lines.size)
    for x in range(0, width, LANES):
        squares_by_lane(answers, x * LANES, line, x, apart)


@numba.njit(cache=True, nogil=True)
def _add_line(sign, energies, score, loudness):  # type: ignore[no-untyped-def]
    for x in range(score.size):
        score[x] += sign * energies[x]
        loudness[x] += energies[x]


@numba.njit(cache=True, nogil=True)
def _energies(lines, sign, score, loudness):  # type: ignore[no-untyped-def]
    """Write Σ ± p² and Σ p² of filters."""
    score[:] = np.float32(0)
    loudness[:] = np.float32(0)
    for k in range(sign.size):
        _add_line(sign[k], lines[k, : score.size], score, loudness)


@numba.njit(cache=True, nogil=True)
def listen(columns, rows, clear, half_px, ear, plan, first_bin, limits, said, weight):  # type: ignore[no-untyped-def]
    """Write what the stripes say of their paths, `following.stepped`, and its weight: one look at all of them.

    Their filters' answers come back as many at a time as there are lanes.
    """
    half_taps, mixtures, usual, filters, sign, mean, trust = ear
    radix, twiddle, turn = plan
    stripes, width, count, m = rows.shape[0], columns.shape[0], sign.shape[1], len(turn) - 1
    rooms = _rooms(width, half_taps.size - 1)
    # sixteen columns of answers are looked at together: some more lie behind the last
    beyond = m * PAIR + LANES * LANES
    drawn = single_room(beyond)[: m * PAIR].reshape(2 * m, LANES)
    one, other = single_room(beyond)[: m * PAIR], single_room(beyond)[: m * PAIR]
    bins = single_room((m + 1) * PAIR)
    drawn[:] = np.float32(0)
    bins[:] = np.float32(0)
    score, loudness = np.empty(width, np.float32), np.empty(width, np.float32)
    padded = -(-width // LANES) * LANES
    lines = single_room(LANES * padded).reshape(LANES, padded)
    together = LANES // count
    for begin in range(0, stripes, together):
        some = range(begin, min(begin + together, stripes))
        for i in some:
            lane = (i - begin) * count
            if not clear[i].any():
                weight[i] = np.float32(0)
                bins.reshape(m + 1, 2, LANES)[:, :, lane : lane + count] = np.float32(0)
                continue
            _draw(
                columns, rows[i], clear[i], half_px, half_taps, mixtures[i], usual[i], limits, rooms, drawn, weight[i]
            )
            where = transform(drawn.reshape(drawn.size), 0, radix, twiddle, one, other)
            let_through(one if where == 0 else other, turn, filters[i], first_bin, bins, lane)
        fold(bins, turn, one)
        back = drawn.reshape(drawn.size)  # which has as much room, and is written anew
        where = transform(one, 0, radix, twiddle, back, other)
        _squares(back if where == 0 else other, width, lines)
        for i in some:
            _energies(lines[(i - begin) * count : (i - begin + 1) * count], sign[i], score, loudness)
            temper(score, loudness, LOUDNESS_BELL, TEMPER, said[i])
            for x in range(width):
                said[i, x] = (said[i, x] - mean[i]) * trust[i]
        drawn[width:] = np.float32(0)


def _in_lanes(weights: Float32Array, axes: tuple[int, ...]) -> Float32Array:
    """Return weights with sixteen channels along some axes; those that there are not have none."""
    missing = [(0, LANES - size if axis in axes else 0) for axis, size in enumerate(weights.shape)]
    return np.pad(weights, missing) if any(more for _, more in missing) else weights


@numba.njit(cache=True, nogil=True)
def add_up(said, weight, aside, wall, information, score, sum_of_information):  # type: ignore[no-untyped-def]
    """Add what stripes say to their walls, [wall, column], and how much they know, by their weight.

    They spoke of places beside which the path is; with a path that lies so far aside they ask for so much less.
    """
    for i in range(wall.size):
        for x in range(said.shape[1]):
            score[wall[i], x] += (said[i, x] - information[i] * aside[i, x]) * weight[i, x]
            sum_of_information[wall[i], x] += information[i] * weight[i, x]


@dataclass(frozen=True, eq=False)
class Told:
    """What the stripes of a stretch say of the present path of both walls.

    Attributes
    ----------
    score, information : float64 arrays, shape (2, column)
        Sums over the stripes of each wall.
    said : float64 array, shape (stripe, column)
        Score without its mean, times trust.
    weight : float32 array, shape (stripe, column)
        0 … 1.
    """

    score: FloatArray
    information: FloatArray
    said: FloatArray
    weight: Float32Array


def told(
    ear: Ear, layout: StripeLayout, stretch: Stretch, *, least_support: float, power_limits: tuple[float, float]
) -> Told:
    """Return what the stripes say of the present path of both walls.

    Parameters
    ----------
    ear : Ear
        Of at least one stripe.
    layout : StripeLayout
    stretch : Stretch
        In the tone of the ear's model, its picture in the processor's memory.
    least_support : float
        See `clear_columns`.
    power_limits : (float, float)
        The least of the texture and the most of anything, in units of their usual power.
    """
    score, information = np.zeros((2, *stretch.displacement_px.shape))
    said = np.empty((ear.number.size, score.shape[1]))
    weight = np.empty(said.shape, np.float32)
    sight = _in_sight(stretch, layout, ear.half_px, least_support)
    summed = (ear.wall, ear.trusted_information, score, information)
    _tell(stretch.columns, stretch.displacement_px, ear.number, sight, ear.for_listening, power_limits, summed, said, weight)  # fmt: skip  # noqa: E501
    return Told(score, information, said, weight)


def told_by(
    heard: Callable[[FloatArray, BoolArray], tuple[FloatArray, Float32Array]],
    ear: Ear,
    layout: StripeLayout,
    stretch: Stretch,
    *,
    least_support: float,
) -> Told:
    """Return the same by someone else's hearing: it returns what is said of stepped paths, and its weight."""
    score, information = np.zeros((2, *stretch.displacement_px.shape))
    rows, clear = clear_columns(stretch, layout, ear.number, half_px=ear.half_px, least_support=least_support)
    aside = np.empty_like(rows)
    stepped(rows, aside)
    said, weight = heard(rows, clear)
    add_up(said, weight, aside, ear.wall, ear.trusted_information, score, information)
    return Told(score, information, said, weight)


@numba.njit(cache=True, nogil=True)
def _tell(columns, displacement, number, sight, hearing, limits, summed, said, weight):  # type: ignore[no-untyped-def]
    """Hear all stripes about the present path, and add up what they say; see `told`."""
    stripes, needed, picture = sight
    rows, clear, aside = np.empty(said.shape), np.empty(said.shape, np.bool_), np.empty(said.shape)
    _clear(displacement, number, stripes, needed, picture, rows, clear)
    stepped(rows, aside)
    ear, plan, first_bin = hearing
    listen(columns, rows, clear, int(needed[0]), ear, plan, first_bin, limits, said, weight)
    wall, information, score, sum_of_information = summed
    add_up(said, weight, aside, wall, information, score, sum_of_information)
