"""The smoother of Bryson and Frazier: what a forward pass found, seen again from the end.

As modified by Bierman (*Fixed interval smoothing with discrete measurements*, Int. J. Control 18, 1973): with L = 1 − Khᵀ,

    r ← h ν/S + Lᵀ r,      N ← h hᵀ/S + Lᵀ N L      at a reading,
    r ← Aᵀ r,              N ← Aᵀ N A               from bin to bin,
    x = m + P r,           C = P − P N P            for m, P predicted at the bin.

It inverts nothing but scalars, so bins without readings, starts of which nothing is known and nearly singular covariances
are no trouble to it. What all *other* readings say of one of them falls out on the way: with e = ν/S − K·r and
D = 1/S + KᵀNK the residual against them is e/D, and 1/D its variance (de Jong, *A cross-validation filter for time series
models*, Biometrika 75, 1988). `smooth_reference` does the same in NumPy, the way of the textbooks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy import linalg

from gramoscope.cache_line import double_room
from gramoscope.conventions import FloatArray
from gramoscope.tonearm.linear_gaussian import Filtered, FilterState, Moves, Readings
from gramoscope.tonearm.small_matrices import add_products, block_sandwich, block_vector, dot, times


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
def _unobserve(h, j, innovation, spread, gain, nk, r, n):  # type: ignore[no-untyped-def]
    """Take one used reading into r and N; return its e and D."""
    knk = times(n, gain, j, nk)
    e = innovation / spread - dot(gain, j, r, 0, r.size)
    d = 1 / spread + knk
    for i in range(r.size):
        r[i] += h[j, i] * e
        # h hᵀ d − h (NK)ᵀ − (NK) hᵀ, in two products
        nk[i] = 0.5 * h[j, i] * d - nk[i]
    add_products(h, j, nk, 0, n)
    add_products(nk, 0, h, j, n)
    return e, d


@numba.njit(cache=True, nogil=True)
def _far(away, ph, j, expected, variance, r, n, nph):  # type: ignore[no-untyped-def]
    """How many standard deviations an unused reading lies from the smoothed state."""
    spread = max(expected - times(n, ph, j, nph), 0.0) + variance
    return abs(away - dot(ph, j, r, 0, r.size)) / np.sqrt(spread)


@numba.njit(cache=True, nogil=True)
def _smooth(a, at, model, places, h, value, variance, gate_variance, used, nu, spread, gain, expected, means, want, toward, mean, sigma, off):  # type: ignore  # fmt: skip  # noqa: E501
    size = means.shape[1]
    r, r_next, one = double_room(size), double_room(size), double_room(size)
    n, n_next = double_room(size * size).reshape(size, size), double_room(size * size).reshape(size, size)
    r[:], n[:] = 0.0, 0.0
    j = places.size - 1
    for k in range(means.shape[0] - 1, -1, -1):
        r, r_next = r_next, r
        n, n_next = n_next, n
        block_vector(a, size * model[k], r_next, r)
        block_sandwich(at, size * model[k], n_next, n)
        last = j
        while j >= 0 and places[j] == k:
            if used[j]:
                e, d = _unobserve(h, j, nu[j], spread[j], gain, one, r, n)
                off[j] = abs(e / d) / np.sqrt(1 / d + gate_variance[j] - variance[j])
            j -= 1
        for i in range(j + 1, last + 1):
            if not used[i]:
                away = value[i] - dot(h, i, means, k, size)
                off[i] = _far(away, gain, i, expected[i], gate_variance[i], r, n, one)
        for i in range(want.shape[0]):
            # row of `toward`
            there = k * want.shape[0] + i
            mean[k, i] = dot(want, i, means, k, size) + dot(toward, there, r, 0, size)
            less = times(n, toward, there, one)
            sigma[k, i] = np.sqrt(max(dot(want, i, toward, there, size) - less, 0.0))


def backward(moves: Moves, readings: Readings, filtered: Filtered) -> Smoothed:
    """Smooth what was filtered.

    Parameters
    ----------
    moves, readings, filtered
        What went into `forward`, and what came out.

    Returns
    -------
    Smoothed
        Of what `forward` was told is wanted.
    """
    shape = filtered.toward.shape[:2]
    mean, sigma, distance = np.empty(shape), np.empty(shape), np.empty(readings.value.size)
    _smooth(
        *moves.stacked[:2], moves.model, readings.bin, readings.h, readings.value, readings.variance,
        readings.gate_variance, filtered.used, filtered.innovation, filtered.spread, filtered.gain, filtered.expected,
        filtered.mean, filtered.wanted, filtered.toward.reshape(-1, filtered.mean.shape[1]), mean, sigma, distance,
    )  # fmt: skip
    return Smoothed(mean, sigma, distance)


def smooth_reference(
    moves: Moves, readings: Readings, begin: FilterState, *, wanted: FloatArray
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
    return means @ wanted.T, np.sqrt(np.einsum("wi,kij,wj->kw", wanted, covariances, wanted))
