"""Kalman's filter on an even grid, for a state of blocks that move alike and are seen together.

From one bin of the grid to the next each block b of the state moves by its own A_b with noise Q_b; a bin may carry any
number of scalar readings y = h·x + noise, taken one after the other, each with its own h and variance: with innovation ν,
its variance S and gain K = Ph/S the state moves by Kν and its covariance by −K S Kᵀ (Kalman, 1960). Backwards goes
`tonearm.bryson_frazier`.

The kernels take C-contiguous float64 arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.cache_line import at_a_line, double_room
from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.tonearm.small_matrices import (
    STATES,
    add_products,
    add_scaled,
    block_sandwich,
    block_vector,
    dot,
    scaled,
    times,
)
from gramoscope.tonearm.vector_rows import add_multiple

SOURCES = 2
FORGIVENESS = 8
"""A used reading makes good so many rejected ones: a filter that goes astray still finds something to agree with."""
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class Moves:
    """How the state moves from a bin to the next.

    Attributes
    ----------
    a, q : float64 arrays, shape (model, block, n, n)
        Transition and covariance of its noise.
    model : int64 array, shape (bin,)
        Which of the models leads from each bin to the next.
    agitation : float64 array, shape (bin,)
        How many times q the noise has just there.
    """

    a: FloatArray
    q: FloatArray
    model: IntArray
    agitation: FloatArray

    @property
    def stacked(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """All blocks of A, Aᵀ and Q one below the other, shape (model · block · n, n)."""
        a, at, q = (blocks.reshape(-1, STATES) for blocks in (self.a, self.a.swapaxes(-1, -2), self.q))
        return at_a_line(a), at_a_line(at), at_a_line(q)


@dataclass(frozen=True, eq=False)
class Readings:
    """Scalar observations of the state.

    Attributes
    ----------
    bin : int64 array, shape (reading,)
        Not falling, 0 … bins − 1.
    source : int64 array, shape (reading,)
        Who reads, 0 … `SOURCES` − 1.
    h : float64 array, shape (reading, block · n)
    value, variance : float64 arrays, shape (reading,)
        Finite; variance > 0.
    gate_variance : float64 array, shape (reading,)
        Variance by which an outlier is told, where `variance` was widened because others say the same.
    """

    bin: IntArray
    source: IntArray
    h: FloatArray
    value: FloatArray
    variance: FloatArray
    gate_variance: FloatArray


@dataclass(frozen=True, eq=False)
class FilterState:
    """Where a filter begins or goes on: at a bin, before its readings.

    Attributes
    ----------
    mean, covariance : float64 arrays, shapes (block · n,), (block · n, block · n)
    missed, since : int64 arrays, shape (SOURCES,)
        How many more readings of each source were rejected than used (one used reading counts `FORGIVENESS`), and for
        how many bins there has been such a surplus.
    """

    mean: FloatArray
    covariance: FloatArray
    missed: IntArray
    since: IntArray


def blank(covariance: FloatArray) -> FilterState:
    """Return the state of a filter that has seen nothing: zero mean, with a covariance."""
    none = np.zeros(SOURCES, np.int64)
    return FilterState(np.zeros(covariance.shape[0]), covariance, none, none)


@dataclass(frozen=True)
class Gate:
    """When a reading is wild, and when it is the filter that is lost.

    Parameters
    ----------
    width : float
        A reading further than this many standard deviations from its prediction is rejected.
    patience : int
        With a surplus of so many rejected readings of one source the first part of each block, the place, is taken for
        lost: it may be anywhere again.
    anywhere : float
        How little is then known of it, a standard deviation.
    doubt : float
        By how much the covariance of everything grows then.
    """

    width: float = np.inf
    patience: int = 2**31
    anywhere: float = 0.0
    doubt: float = 1.0


@dataclass(frozen=True, eq=False)
class Filtered:
    """Result of the forward pass.

    Attributes
    ----------
    mean : float64 array, shape (bin, block · n)
        Predicted at each bin, before its readings.
    wanted : float64 array, shape (wanted, block · n)
        Rows w: what the smoother will be asked for, times the state.
    toward : float64 array, shape (bin, wanted, block · n)
        Pw, P being the covariance before the readings of a bin: all of it that the smoother needs. Whole covariances would not
        fit into the processor's cache.
    missed, since : int64 arrays, shape (bin, SOURCES)
        See `FilterState`; where the place was lost, as they were before they were set to zero.
    lost : bool array, shape (bin,)
        Where the place was taken for lost.
    used : bool array, shape (reading,)
    innovation, spread : float64 arrays, shape (reading,)
        ν and S.
    gain : float64 array, shape (reading, block · n)
        K of a used reading; Ph of another, P as above.
    expected : float64 array, shape (reading,)
        hᵀPh, the same P: how far off a reading without errors may be.
    log_likelihood : float
        Rejected readings count as if they lay at the gate: how far off they are teaches nothing.
    resume : FilterState
        Where to go on, at the bin that was asked for.
    """

    mean: FloatArray
    wanted: FloatArray
    toward: FloatArray
    missed: IntArray
    since: IntArray
    lost: BoolArray
    used: BoolArray
    innovation: FloatArray
    spread: FloatArray
    gain: FloatArray
    expected: FloatArray
    log_likelihood: float
    resume: FilterState


@numba.njit(cache=True, nogil=True)
def _move(a, at, q, first, agitation, m, p, m_out, p_out):  # type: ignore[no-untyped-def]
    block_vector(at, first, m, m_out)
    block_sandwich(a, first, p, p_out)
    for b in range(0, m.size, STATES):
        for i in range(b, b + STATES):
            add_multiple(agitation, q, first + i, 0, p_out, i, b)


@numba.njit(cache=True, nogil=True)
def _times_few(p, w, i, out):  # type: ignore[no-untyped-def]
    """Write p w for symmetric p and a row with few numbers that are not zero."""
    out[:] = 0.0
    for j in range(w.shape[1]):
        if w[i, j] != 0:
            add_scaled(w[i, j], p, j, out, 0, out.size)


@numba.njit(cache=True, nogil=True)
def _observe(innovation, spread, ph, gain, j, m, p):  # type: ignore[no-untyped-def]
    """Update mean and covariance in place and write K."""
    scaled(-1 / spread, ph, 0, gain, j, m.size)
    add_products(ph, 0, gain, j, p)
    scaled(-1.0, gain, j, gain, j, m.size)
    add_scaled(innovation, gain, j, m, 0, m.size)


@numba.njit(cache=True, nogil=True)
def _lose(p, anywhere, doubt):  # type: ignore[no-untyped-def]
    p *= doubt
    for i in range(0, p.shape[0], STATES):
        p[i, i] += anywhere**2


@numba.njit(cache=True, nogil=True)
def _judge(used, source, missed, since):  # type: ignore[no-untyped-def]
    missed[source] = max(missed[source] - FORGIVENESS, 0) if used else missed[source] + 1
    if missed[source] == 0:
        since[source] = 0


@numba.njit(cache=True, nogil=True)
def _count(missed, since, patience, misses, sinces, k):  # type: ignore[no-untyped-def]
    """Write down what was missed up to a bin and count it; return whether patience is at an end, and begin again then."""
    lost = False
    for i in range(SOURCES):
        misses[k, i], sinces[k, i] = missed[i], since[i]
        lost = lost or missed[i] >= patience
    for i in range(SOURCES):
        if lost:
            missed[i], since[i] = 0, 0
        elif missed[i] > 0:
            since[i] += 1
    return lost


@numba.njit(cache=True, nogil=True)
def _before_others(h, j, ph, first, used, spread, gain):  # type: ignore[no-untyped-def]
    """Take ph back to before the readings from the first of a bin up to j; return by how much hᵀph grows."""
    more = 0.0
    for i in range(first, j):
        if used[i]:
            share = dot(gain, i, h, j, ph.size)
            more += spread[i] * share**2
            add_scaled(spread[i] * share, gain, i, ph, 0, ph.size)
    return more


@numba.njit(cache=True, nogil=True)
def _filter(a, at, q, model, agitation, places, source, h, value, variance, gate_variance, rule, allowed, lost, m, p, missed, since, want, means, toward, misses, sinces, used, nu, spread, gain, expected, resume, m_resume, p_resume):  # type: ignore  # fmt: skip  # noqa: E501
    width, patience, anywhere, doubt = rule
    size, wanted = m.size, want.shape[0]
    ph, m_next, p_next = double_room(size), double_room(size), double_room(size * size).reshape(size, size)
    loglik = 0.0
    j = 0
    for k in range(means.shape[0]):
        lost[k] |= _count(missed, since, patience, misses, sinces, k)
        if lost[k]:
            _lose(p, anywhere, doubt)
        scaled(1.0, m, 0, means, k, size)
        for i in range(wanted):
            _times_few(p, want, i, ph)
            scaled(1.0, ph, 0, toward, k * wanted + i, size)
        if k == resume:
            m_resume[:], p_resume[:] = m, p
        first = j
        while j < places.size and places[j] == k:
            seen = times(p, h, j, ph)
            nu[j], spread[j] = value[j] - dot(h, j, m, 0, size), seen + variance[j]
            if allowed[j]:
                used[j] = nu[j] ** 2 <= width**2 * (seen + gate_variance[j])
                distance = nu[j] ** 2 / spread[j] if used[j] else width**2
                loglik -= 0.5 * (LOG_2PI + np.log(spread[j]) + distance)
                _judge(used[j], source[j], missed, since)
            if used[j]:
                _observe(nu[j], spread[j], ph, gain, j, m, p)
            expected[j] = seen + _before_others(h, j, ph, first, used, spread, gain)
            if not used[j]:
                scaled(1.0, ph, 0, gain, j, size)
            j += 1
        _move(a, at, q, size * model[k], agitation[k], m, p, m_next, p_next)
        m, m_next = m_next, m
        p, p_next = p_next, p
    return loglik


def forward(
    moves: Moves,
    readings: Readings,
    begin: FilterState,
    *,
    gate: Gate | None = None,
    allowed: BoolArray | None = None,
    lost: BoolArray | None = None,
    wanted: FloatArray | None = None,
    resume: int = 0,
) -> Filtered:
    """Run the Kalman filter over a grid.

    Parameters
    ----------
    moves : Moves
    readings : Readings
    begin : FilterState
        At the first bin.
    gate : Gate, optional
        Without it all readings are used.
    allowed : bool array, shape (reading,), optional
        Readings that may be used at all; all of them if left out.
    lost : bool array, shape (bin,), optional
        Where the place is known to have been lost.
    wanted : float64 array, shape (wanted, block · n), optional
        What `backward` shall tell.
    resume : int
        The bin at which to go on later.

    Returns
    -------
    Filtered
    """
    bins, size, n = moves.model.size, begin.mean.size, readings.value.size
    want = np.zeros((0, size)) if wanted is None else wanted
    means = double_room(bins * size).reshape(bins, size)
    toward = double_room(bins * want.shape[0] * size).reshape(bins, want.shape[0], size)
    misses, sinces = np.empty((bins, SOURCES), np.int64), np.empty((bins, SOURCES), np.int64)
    used, nu, spread, expected = np.zeros(n, np.bool_), np.empty(n), np.empty(n), np.empty(n)
    gain = double_room(n * size).reshape(n, size)
    may = np.ones(n, np.bool_) if allowed is None else allowed
    lost = np.zeros(bins, np.bool_) if lost is None else lost.copy()
    rule = gate or Gate()
    m_resume, p_resume = np.empty(size), np.empty((size, size))
    loglik = _filter(
        *moves.stacked, moves.model, moves.agitation, readings.bin, readings.source, readings.h,
        readings.value, readings.variance, readings.gate_variance,
        (rule.width, rule.patience, rule.anywhere, rule.doubt), may, lost,
        at_a_line(begin.mean), at_a_line(begin.covariance), begin.missed.copy(), begin.since.copy(), want, means,
        toward.reshape(-1, size), misses, sinces, used, nu, spread, gain, expected, resume, m_resume, p_resume,
    )  # fmt: skip
    kept = not lost[resume]
    later = FilterState(m_resume, p_resume, kept * misses[resume], kept * sinces[resume])
    return Filtered(means, want, toward, misses, sinces, lost, used, nu, spread, gain, expected, float(loglik), later)
