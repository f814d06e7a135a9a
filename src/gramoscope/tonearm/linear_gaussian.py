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

The kernels take C-contiguous float64 arrays; `filter_reference` and `smooth_reference` are the same in NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray

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
    """

    a: FloatArray
    q: FloatArray
    model: IntArray


@dataclass(frozen=True, eq=False)
class Readings:
    """Scalar observations of the state.

    Attributes
    ----------
    bin : int64 array, shape (reading,)
        Not falling, 0 … bins − 1.
    h : float64 array, shape (reading, block · n)
    value, variance : float64 arrays, shape (reading,)
        Finite; variance > 0.
    gate_variance : float64 array, shape (reading,)
        Variance by which an outlier is told, where `variance` was widened because others say the same.
    """

    bin: IntArray
    h: FloatArray
    value: FloatArray
    variance: FloatArray
    gate_variance: FloatArray


@dataclass(frozen=True, eq=False)
class Filtered:
    """Result of the forward pass.

    Attributes
    ----------
    mean, covariance : float64 arrays, shapes (bin, block · n), (bin, block · n, block · n)
        Predicted at each bin, before its readings.
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
    used: BoolArray
    innovation: FloatArray
    spread: FloatArray
    gain: FloatArray
    log_likelihood: float


@numba.njit(cache=True, nogil=True)
def _block_product(a, x, out):  # type: ignore[no-untyped-def]
    """Write A x for a block diagonal A."""
    n = a.shape[1]
    for i in range(x.shape[0]):
        row = (i // n) * n
        for j in range(x.shape[1]):
            out[i, j] = 0.0
        for k in range(n):
            w = a[i // n, i % n, k]
            for j in range(x.shape[1]):
                out[i, j] += w * x[row + k, j]


@numba.njit(cache=True, nogil=True)
def _block_sandwich(a, x, half, out):  # type: ignore[no-untyped-def]
    """Write A x Aᵀ for symmetric x."""
    _block_product(a, x, half)
    n = a.shape[1]
    size = x.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            column = (j // n) * n
            for k in range(n):
                total += half[i, column + k] * a[j // n, j % n, k]
            out[i, j] = total
            out[j, i] = total


@numba.njit(cache=True, nogil=True)
def _block_vector(a, x, out):  # type: ignore[no-untyped-def]
    n = a.shape[1]
    for i in range(x.size):
        total = 0.0
        for k in range(n):
            total += a[i // n, i % n, k] * x[(i // n) * n + k]
        out[i] = total


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
    return np.sum(h * out)


@numba.njit(cache=True, nogil=True)
def _move(a, q, m, p, half, m_out, p_out):  # type: ignore[no-untyped-def]
    _block_vector(a, m, m_out)
    _block_sandwich(a, p, half, p_out)
    n = a.shape[1]
    for b in range(a.shape[0]):
        for i in range(n):
            for j in range(n):
                p_out[b * n + i, b * n + j] += q[b, i, j]


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
def _filter(a, q, model, places, h, value, variance, gate_variance, gate, allowed, m, p, means, covs, used, nu, spread, gain):  # type: ignore[no-untyped-def]  # fmt: skip
    half, m_next, p_next = np.empty_like(p), np.empty_like(m), np.empty_like(p)
    loglik = 0.0
    j = 0
    for k in range(means.shape[0]):
        means[k], covs[k] = m, p
        while j < places.size and places[j] == k:
            seen = _times(p, h[j], gain[j])
            nu[j] = value[j] - np.sum(h[j] * m)
            spread[j] = seen + variance[j]
            used[j] = allowed[j] and nu[j] ** 2 <= gate**2 * (seen + gate_variance[j])
            distance = nu[j] ** 2 / spread[j] if used[j] else gate**2
            if allowed[j]:
                loglik -= 0.5 * (LOG_2PI + np.log(spread[j]) + distance)
            if used[j]:
                _observe(nu[j], spread[j], gain[j], m, p)
            j += 1
        _move(a[model[k]], q[model[k]], m, p, half, m_next, p_next)
        m[:], p[:] = m_next, p_next
    return loglik


def forward(
    moves: Moves,
    readings: Readings,
    *,
    mean: FloatArray,
    covariance: FloatArray,
    gate: float = np.inf,
    allowed: BoolArray | None = None,
) -> Filtered:
    """Run the Kalman filter over a grid.

    Parameters
    ----------
    moves : Moves
    readings : Readings
    mean, covariance : float64 arrays, shapes (block · n,), (block · n, block · n)
        At the first bin, before its readings.
    gate : float
        A reading further than this many standard deviations from its prediction is not used.
    allowed : bool array, shape (reading,), optional
        Readings that may be used at all; all of them if left out.

    Returns
    -------
    Filtered
    """
    bins, size, n = moves.model.size, mean.size, readings.value.size
    means, covs = np.empty((bins, size)), np.empty((bins, size, size))
    used, nu, spread, gain = np.zeros(n, np.bool_), np.empty(n), np.empty(n), np.empty((n, size))
    may = np.ones(n, np.bool_) if allowed is None else allowed
    loglik = _filter(
        moves.a, moves.q, moves.model, readings.bin, readings.h, readings.value, readings.variance,
        readings.gate_variance, gate, may, mean.copy(), covariance.copy(), means, covs, used, nu, spread, gain,
    )  # fmt: skip
    return Filtered(means, covs, used, nu, spread, gain, float(loglik))


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
    e = innovation / spread - np.sum(gain * r)
    d = 1 / spread + knk
    size = r.size
    for i in range(size):
        r[i] += h[i] * e
        for j in range(size):
            n[i, j] += h[i] * h[j] * d - h[i] * nk[j] - nk[i] * h[j]
    return e, d


@numba.njit(cache=True, nogil=True)
def _smoothed_part(h, m, p, r, n, ph, nph):  # type: ignore[no-untyped-def]
    """Return mean and variance of h·x, smoothed."""
    before = _times(p, h, ph)
    less = _times(n, ph, nph)
    return np.sum(h * m) + np.sum(ph * r), before - less


@numba.njit(cache=True, nogil=True)
def _smooth(at, model, places, h, value, variance, gate_variance, used, nu, spread, gain, means, covs, want, mean, sigma, off):  # type: ignore  # fmt: skip
    size = means.shape[1]
    r, r_before, n, n_before = np.zeros(size), np.zeros(size), np.zeros((size, size)), np.zeros((size, size))
    half, one, two = np.empty((size, size)), np.empty(size), np.empty(size)
    j = places.size - 1
    for k in range(means.shape[0] - 1, -1, -1):
        _block_vector(at[model[k]], r, r_before)
        _block_sandwich(at[model[k]], n, half, n_before)
        r[:], n[:] = r_before, n_before
        last = j
        while j >= 0 and places[j] == k:
            if used[j]:
                e, d = _unobserve(h[j], nu[j], spread[j], gain[j], one, r, n)
                off[j] = np.abs(e / d) / np.sqrt(1 / d + gate_variance[j] - variance[j])
            j -= 1
        for i in range(j + 1, last + 1):
            if not used[i]:
                x, v = _smoothed_part(h[i], means[k], covs[k], r, n, one, two)
                off[i] = np.abs(value[i] - x) / np.sqrt(max(v, 0.0) + gate_variance[i])
        for i in range(want.shape[0]):
            x, v = _smoothed_part(want[i], means[k], covs[k], r, n, one, two)
            mean[k, i] = x
            sigma[k, i] = np.sqrt(max(v, 0.0))


def backward(moves: Moves, readings: Readings, filtered: Filtered, *, wanted: FloatArray) -> Smoothed:
    """Smooth what was filtered.

    Parameters
    ----------
    moves, readings, filtered
        What went into `forward`, and what came out.
    wanted : float64 array, shape (wanted, block · n)
        Rows w: the parts w·x of the state that are asked for.

    Returns
    -------
    Smoothed
    """
    shape = (moves.model.size, wanted.shape[0])
    mean, sigma, distance = np.empty(shape), np.empty(shape), np.empty(readings.value.size)
    _smooth(
        np.ascontiguousarray(moves.a.swapaxes(-1, -2)), moves.model, readings.bin, readings.h, readings.value,
        readings.variance, readings.gate_variance, filtered.used, filtered.innovation, filtered.spread, filtered.gain,
        filtered.mean, filtered.covariance, wanted, mean, sigma, distance,
    )  # fmt: skip
    return Smoothed(mean, sigma, distance)
