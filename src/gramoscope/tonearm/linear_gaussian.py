"""Kalman filter and smoother on an even grid, for a state of blocks that move alike and are seen together.

From one bin of the grid to the next each block b of the state moves by its own A_b with noise Q_b; a bin may carry any
number of scalar observations y = h·x + noise, taken one after the other, each with its own h and variance. With innovation
ν, its variance S and gain K = Ph/S, the forward pass is Kalman's. Backwards runs the smoother of Bryson and Frazier as
modified by Bierman (*Fixed interval smoothing with discrete measurements*, Int. J. Control 18, 1973): with L = 1 − Khᵀ,

    r ← h ν/S + Lᵀ r,      N ← h hᵀ/S + Lᵀ N L      at an observation,
    r ← Aᵀ r,              N ← Aᵀ N A               from bin to bin,
    x = m + P r,           C = P − P N P            for m, P predicted at the bin.

It inverts nothing but scalars, so bins without observations, starts of which nothing is known and nearly singular
covariances are no trouble to it. What all *other* observations say of one of them falls out on the way: with
e = ν/S − K·r and D = 1/S + KᵀNK the residual against them is e/D, and 1/D its variance (de Jong, *A cross-validation filter
for time series models*, Biometrika 75, 1988).

The kernels take C-contiguous float64 arrays; `smooth_reference` does the same in NumPy, the way of the textbooks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy import linalg

from gramoscope.conventions import BoolArray, FloatArray, IntArray

STATES = 6
"""Size of a block. Known to the compiler, it makes the products of small matrices three times as fast."""
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
    mean, covariance : float64 arrays, shapes (bin, block · n), (bin, block · n, block · n)
        Predicted at each bin, before its readings.
    missed, since : int64 arrays, shape (bin, SOURCES)
        See `FilterState`; where the place was lost, as they were before they were set to zero.
    lost : bool array, shape (bin,)
        Where the place was taken for lost.
    used : bool array, shape (reading,)
    innovation, spread : float64 arrays, shape (reading,)
        ν and S.
    gain : float64 array, shape (reading, block · n)
        K.
    log_likelihood : float
        Rejected readings count as if they lay at the gate: how far off they are teaches nothing.
    """

    mean: FloatArray
    covariance: FloatArray
    missed: IntArray
    since: IntArray
    lost: BoolArray
    used: BoolArray
    innovation: FloatArray
    spread: FloatArray
    gain: FloatArray
    log_likelihood: float

    def state(self, bin_: int) -> FilterState:
        """Return where to go on at a bin."""
        kept = not self.lost[bin_]
        return FilterState(self.mean[bin_], self.covariance[bin_], kept * self.missed[bin_], kept * self.since[bin_])


@numba.njit(cache=True, nogil=True)
def _sandwich_one(a, c, x, row, column, half, out):  # type: ignore[no-untyped-def]
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += a[i, k] * x[row + k, column + j]
            half[i, j] = total
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += half[i, k] * c[j, k]
            out[row + i, column + j] = total
            out[column + j, row + i] = total


@numba.njit(cache=True, nogil=True)
def _block_sandwich(a, x, half, out):  # type: ignore[no-untyped-def]
    """Write A x Aᵀ for symmetric x and a block diagonal A."""
    for b in range(a.shape[0]):
        for c in range(b + 1):
            _sandwich_one(a[b], a[c], x, b * STATES, c * STATES, half, out)


@numba.njit(cache=True, nogil=True)
def _block_vector(a, x, out):  # type: ignore[no-untyped-def]
    for b in range(a.shape[0]):
        for i in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += a[b, i, k] * x[b * STATES + k]
            out[b * STATES + i] = total


@numba.njit(cache=True, nogil=True)
def _dot(x, y):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@numba.njit(cache=True, nogil=True)
def _times(p, h, out):  # type: ignore[no-untyped-def]
    """Write p h for symmetric p and return hᵀ p h."""
    size = h.size
    for i in range(size):
        out[i] = 0.0
    for k in range(size):
        w = h[k]
        for i in range(size):
            out[i] += w * p[k, i]
    return _dot(h, out)


@numba.njit(cache=True, nogil=True)
def _move(a, q, agitation, m, p, half, m_out, p_out):  # type: ignore[no-untyped-def]
    _block_vector(a, m, m_out)
    _block_sandwich(a, p, half, p_out)
    for b in range(a.shape[0]):
        for i in range(STATES):
            for j in range(STATES):
                p_out[b * STATES + i, b * STATES + j] += agitation * q[b, i, j]


@numba.njit(cache=True, nogil=True)
def _observe(innovation, spread, gain, m, p):  # type: ignore[no-untyped-def]
    """Update mean and covariance in place, `gain` being ph on the way in and K on the way out."""
    size = m.size
    for i in range(size):
        gain[i] /= spread
        m[i] += gain[i] * innovation
    for i in range(size):
        w = gain[i] * spread
        for j in range(size):
            p[i, j] -= w * gain[j]


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
def _filter(a, q, model, agitation, places, source, h, value, variance, gate_variance, rule, allowed, lost, m, p, missed, since, means, covs, misses, sinces, used, nu, spread, gain):  # type: ignore  # fmt: skip  # noqa: E501
    width, patience, anywhere, doubt = rule
    half, m_next, p_next = np.empty((STATES, STATES)), np.empty_like(m), np.empty_like(p)
    loglik = 0.0
    j = 0
    for k in range(means.shape[0]):
        misses[k], sinces[k] = missed, since
        if missed.max() >= patience:
            lost[k] = True
            missed[:] = 0
            since[:] = 0
        if lost[k]:
            _lose(p, anywhere, doubt)
        means[k], covs[k] = m, p
        since += missed > 0
        while j < places.size and places[j] == k:
            if allowed[j]:
                seen = _times(p, h[j], gain[j])
                nu[j] = value[j] - _dot(h[j], m)
                spread[j] = seen + variance[j]
                used[j] = nu[j] ** 2 <= width**2 * (seen + gate_variance[j])
                distance = nu[j] ** 2 / spread[j] if used[j] else width**2
                loglik -= 0.5 * (LOG_2PI + np.log(spread[j]) + distance)
                _judge(used[j], source[j], missed, since)
            if used[j]:
                _observe(nu[j], spread[j], gain[j], m, p)
            j += 1
        _move(a[model[k]], q[model[k]], agitation[k], m, p, half, m_next, p_next)
        m[:], p[:] = m_next, p_next
    return loglik


def forward(
    moves: Moves,
    readings: Readings,
    begin: FilterState,
    *,
    gate: Gate | None = None,
    allowed: BoolArray | None = None,
    lost: BoolArray | None = None,
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

    Returns
    -------
    Filtered
    """
    bins, size, n = moves.model.size, begin.mean.size, readings.value.size
    means, covs = np.empty((bins, size)), np.empty((bins, size, size))
    misses, sinces = np.empty((bins, SOURCES), np.int64), np.empty((bins, SOURCES), np.int64)
    used, nu, spread, gain = np.zeros(n, np.bool_), np.empty(n), np.empty(n), np.empty((n, size))
    may = np.ones(n, np.bool_) if allowed is None else allowed
    lost = np.zeros(bins, np.bool_) if lost is None else lost.copy()
    rule = gate or Gate()
    loglik = _filter(
        moves.a, moves.q, moves.model, moves.agitation, readings.bin, readings.source, readings.h, readings.value,
        readings.variance, readings.gate_variance, (rule.width, rule.patience, rule.anywhere, rule.doubt), may, lost,
        begin.mean.copy(), begin.covariance.copy(), begin.missed.copy(), begin.since.copy(), means, covs, misses,
        sinces, used, nu, spread, gain,
    )  # fmt: skip
    return Filtered(means, covs, misses, sinces, lost, used, nu, spread, gain, float(loglik))


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Result of the backward pass.

    Attributes
    ----------
    mean, sigma : float64 arrays, shape (bin, wanted)
        Of the wanted parts of the state, by all readings.
    distance : float64 array, shape (reading,)
        How many standard deviations each reading lies from what all *others* say of it.
    """

    mean: FloatArray
    sigma: FloatArray
    distance: FloatArray


@numba.njit(cache=True, nogil=True)
def _unobserve(h, innovation, spread, gain, nk, r, n):  # type: ignore[no-untyped-def]
    """Take one used reading into r and N; return its e and D."""
    knk = _times(n, gain, nk)
    e = innovation / spread - _dot(gain, r)
    d = 1 / spread + knk
    size = r.size
    for i in range(size):
        r[i] += h[i] * e
        for j in range(size):
            n[i, j] += h[i] * h[j] * d - h[i] * nk[j] - nk[i] * h[j]
    return e, d


@numba.njit(cache=True, nogil=True)
def _far(h, value, variance, m, p, r, n, ph, nph):  # type: ignore[no-untyped-def]
    """How many standard deviations an unused reading lies from the smoothed state."""
    before = _times(p, h, ph)
    spread = max(before - _times(n, ph, nph), 0.0) + variance
    return abs(value - _dot(h, m) - _dot(ph, r)) / np.sqrt(spread)


@numba.njit(cache=True, nogil=True)
def _smooth(at, model, places, h, value, variance, gate_variance, used, nu, spread, gain, means, covs, want, mean, sigma, off):  # type: ignore  # fmt: skip
    size = means.shape[1]
    r, r_before, n, n_before = np.zeros(size), np.zeros(size), np.zeros((size, size)), np.zeros((size, size))
    half, one, two = np.empty((STATES, STATES)), np.empty(size), np.empty(size)
    j = places.size - 1
    for k in range(means.shape[0] - 1, -1, -1):
        _block_vector(at[model[k]], r, r_before)
        _block_sandwich(at[model[k]], n, half, n_before)
        r[:], n[:] = r_before, n_before
        last = j
        while j >= 0 and places[j] == k:
            if used[j]:
                e, d = _unobserve(h[j], nu[j], spread[j], gain[j], one, r, n)
                off[j] = abs(e / d) / np.sqrt(1 / d + gate_variance[j] - variance[j])
            j -= 1
        for i in range(j + 1, last + 1):
            if not used[i]:
                off[i] = _far(h[i], value[i], gate_variance[i], means[k], covs[k], r, n, one, two)
        for i in range(want.size):
            w = want[i]
            mean[k, i] = means[k, w] + _dot(covs[k, w], r)
            sigma[k, i] = np.sqrt(max(covs[k, w, w] - _times(n, covs[k, w], one), 0.0))


def backward(moves: Moves, readings: Readings, filtered: Filtered, *, wanted: IntArray) -> Smoothed:
    """Smooth what was filtered.

    Parameters
    ----------
    moves, readings, filtered
        What went into `forward`, and what came out.
    wanted : int64 array, shape (wanted,)
        Which parts of the state are asked for.

    Returns
    -------
    Smoothed
    """
    shape = (moves.model.size, wanted.size)
    mean, sigma, distance = np.empty(shape), np.empty(shape), np.empty(readings.value.size)
    _smooth(
        np.ascontiguousarray(moves.a.swapaxes(-1, -2)), moves.model, readings.bin, readings.h, readings.value,
        readings.variance, readings.gate_variance, filtered.used, filtered.innovation, filtered.spread, filtered.gain,
        filtered.mean, filtered.covariance, wanted, mean, sigma, distance,
    )  # fmt: skip
    return Smoothed(mean, sigma, distance)


def smooth_reference(
    moves: Moves, readings: Readings, begin: FilterState, *, wanted: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard error of the wanted parts of the state by Kalman, Rauch, Tung and Striebel.

    All readings are used. For parameters see `forward` and `backward`.
    """
    m, p = begin.mean, begin.covariance
    predicted, filtered = [], []
    whole = [(linalg.block_diag(*a), linalg.block_diag(*q)) for a, q in zip(moves.a, moves.q, strict=True)]
    for k, model in enumerate(moves.model):
        predicted.append((m, p))
        here = readings.bin == k
        h = readings.h[here]
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(readings.variance[here]))
        m, p = m + gain @ (readings.value[here] - h @ m), p - gain @ h @ p
        filtered.append((m, p))
        a, q = whole[model]
        m, p = a @ m, a @ p @ a.T + moves.agitation[k] * q
    m, p = filtered[-1]
    smoothed = [(m, p)]
    for k in range(moves.model.size - 2, -1, -1):
        a = whole[moves.model[k]][0]
        gain = filtered[k][1] @ a.T @ np.linalg.inv(predicted[k + 1][1])
        m = filtered[k][0] + gain @ (m - predicted[k + 1][0])
        p = filtered[k][1] + gain @ (p - predicted[k + 1][1]) @ gain.T
        smoothed.append((m, p))
    means, covariances = (np.array(values) for values in zip(*smoothed[::-1], strict=True))
    return means[:, wanted], np.sqrt(covariances[:, wanted, wanted])
