"""Sound as an autoregressive process: what its surroundings say of a sample.

Over a few hundredths of a second music is nearly a stationary Gaussian process x[n] = −Σ a[j] x[n − j] + e[n], j = 1 … p, with
white excitation e of standard deviation s. The vector of N of its samples has the covariance s² Q⁻¹, where Q is banded:

    Q[i, i + d] = Σ a[l] a[l + d],    l = 0 … min(i, N − 1 − i − d, p − d),    a[0] = 1

(Siddiqui; exact at both ends for N > 2p). From Q follows everything that a repair needs: samples u that are not known have,
given all others k, the mean and the covariance

    E[x_u] = −Q_uu⁻¹ Q_uk x_k,    s² Q_uu⁻¹,

which is least-squares autoregressive interpolation (Janssen; Godsill and Rayner). Where something was measured all the same,
y_u with an error of the covariance s² W⁻¹, that joins the precision,

    E[x_u] = (Q_uu + W)⁻¹ (W y_u − Q_uk x_k),    s² (Q_uu + W)⁻¹.

A disturbance of the shape h shows
itself best in hᵀQx / √(hᵀQh), which is a standard normal deviate times s where there is none.

References
----------
M. M. Siddiqui, On the inversion of the sample covariance matrix in a stationary autoregressive process, Ann. Math. Stat. 29,
1958. A. Janssen, R. Veldhuis, L. Vries, Adaptive interpolation of discrete-time signals that can be modelled as
autoregressive processes, IEEE Trans. ASSP 34, 1986. S. Godsill, P. Rayner, Digital Audio Restoration, 1998, chapters 4 and 5.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from gramoscope.conventions import BoolArray, FloatArray, IntArray

WHITE_SHARE = 1e-9
"""White noise added to what is fitted, as a share of its power: keeps a band without sound from making the fit singular."""
SCALE_WINDOW = 960
"""Samples: 10 ms at 96 kHz, several times the longest click and a fraction of a syllable."""
LOWEST_SCALE = 0.3

_NORMAL_QUARTILE = 0.6744897501960817


def fit(samples: FloatArray, *, order: int) -> FloatArray:
    """Return the coefficients of the process that a stretch of sound looks like.

    Yule and Walker's equations for the autocorrelation under a Hann window: always a stable process.

    Parameters
    ----------
    samples : float64 array, shape (sample,)
        Finite, more than `order`.
    order : int
        p.

    Returns
    -------
    float64 array, shape (order + 1,)
        a, the first is 1; all others 0 for silence.
    """
    windowed = samples * np.hanning(samples.size + 2)[1:-1]
    power = np.abs(np.fft.rfft(windowed, 2 * samples.size)) ** 2
    correlation = np.fft.irfft(power)[: order + 1]
    if not correlation[0] > 0:
        return np.concatenate([[1.0], np.zeros(order)])
    correlation[0] *= 1 + WHITE_SHARE
    return np.concatenate([[1.0], -solve_toeplitz(correlation[:-1], correlation[1:])])


def excitation_scale(samples: FloatArray, coefficients: FloatArray, *, used: BoolArray) -> FloatArray:
    """Return s at every sample, by the median of the sizes of the prediction errors around it.

    A tenth of the samples may be spoilt, and it hardly moves. It follows a sound that swells: medians are taken over
    `SCALE_WINDOW` samples at every quarter of that, never less than `LOWEST_SCALE` of the median of all, and joined by lines.

    Parameters
    ----------
    samples : float64 array, shape (sample,)
    coefficients : float64 array, shape (order + 1,)
    used : bool array, shape (sample,)
        Which errors count; the first `order` never do.

    Returns
    -------
    float64 array, shape (sample,)
        In the unit of the samples; 0 if none counts.
    """
    errors = np.abs(lfilter(coefficients, [1.0], samples))
    kept = used.copy()
    kept[: coefficients.size - 1] = False
    if not kept.any():
        return np.zeros(samples.size)
    overall = float(np.median(errors[kept]))
    middles = np.arange(0, samples.size + SCALE_WINDOW // 4, SCALE_WINDOW // 4)
    around = [slice(max(middle - SCALE_WINDOW // 2, 0), middle + SCALE_WINDOW // 2) for middle in middles]
    enough = [np.count_nonzero(kept[part]) > SCALE_WINDOW // 4 for part in around]
    local = [
        np.median(errors[part][kept[part]]) if many else overall for part, many in zip(around, enough, strict=True)
    ]
    level = np.interp(np.arange(samples.size), middles, np.maximum(local, LOWEST_SCALE * overall))
    return np.asarray(level / _NORMAL_QUARTILE, np.float64)


@numba.njit(cache=True, nogil=True)
def precision(coefficients: FloatArray, count: int) -> FloatArray:
    """Return Q of so many samples, without s.

    Parameters
    ----------
    coefficients : float64 array, shape (order + 1,)
        a.
    count : int
        N, more than 2p.

    Returns
    -------
    float64 array, shape (sample, order + 1)
        [i, d] is Q[i, i + d], 0 beyond the end.
    """
    order = coefficients.size - 1
    band = np.zeros((count, order + 1))
    for d in range(order + 1):
        sums = np.cumsum(coefficients[: order + 1 - d] * coefficients[d:])
        for i in range(count - d):
            band[i, d] = sums[min(i, count - 1 - i - d, order - d)]
    return band


@numba.njit(cache=True, nogil=True)
def times(band: FloatArray, samples: FloatArray) -> FloatArray:
    """Return Qx, for Q as `precision` returns it."""
    count, width = band.shape
    product = np.zeros(count)
    for i in range(count):
        total = band[i, 0] * samples[i]
        for d in range(1, min(width, count - i)):
            total += band[i, d] * samples[i + d]
        for d in range(1, min(width, i + 1)):
            total += band[i - d, d] * samples[i - d]
        product[i] = total
    return product


@numba.njit(cache=True, nogil=True)
def conditional(
    band: FloatArray, samples: FloatArray, unknown: IntArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what the known samples, and the values of the doubtful ones by their weight, say of the doubtful ones.

    Parameters
    ----------
    band : float64 array, shape (sample, order + 1)
        Q.
    samples : float64 array, shape (sample,)
        Finite. All but the doubtful ones are taken as exact.
    unknown : int64 array, shape (unknown,)
        Indices of the doubtful ones, rising.
    weight : float64 array, shape (unknown, reach + 1), reach ≤ order
        W: [i, d] joins the doubtful samples i and i + d. 0 where their values say nothing.

    Returns
    -------
    mean : float64 array, shape (unknown,)
    covariance : float64 array, shape (unknown, order + 1)
        In units of s²: [i, 0] is the variance of a doubtful sample, [i, d] its covariance with the one d further on.
    """
    known = samples.copy()
    known[unknown] = 0.0
    lower, diagonal = _factors(band, unknown, weight)
    mean = _solved(lower, diagonal, times(weight, samples[unknown]) - times(band, known)[unknown])
    return mean, _inverse_band(lower, diagonal)


@numba.njit(cache=True, nogil=True)
def _factors(band: FloatArray, unknown: IntArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """L and D of Q_uu + W = L D Lᵀ; [i, d] of the first is L[i, i − d], samples being no nearer than their ranks."""
    count, reach = unknown.size, band.shape[1] - 1
    lower, diagonal = np.zeros((count, reach + 1)), np.zeros(count)
    for i in range(count):
        first = max(0, i - reach)
        for j in range(first, i + 1):
            apart = unknown[i] - unknown[j]
            total = band[unknown[j], apart] if apart <= reach else 0.0
            if i - j < weight.shape[1]:
                total += weight[j, i - j]
            for k in range(max(first, j - reach), j):
                total -= lower[i, i - k] * diagonal[k] * lower[j, j - k]
            if j < i:
                lower[i, i - j] = total / diagonal[j]
            else:
                diagonal[i] = total
    return lower, diagonal


@numba.njit(cache=True, nogil=True)
def _solved(lower: FloatArray, diagonal: FloatArray, right: FloatArray) -> FloatArray:
    count, reach = lower.shape[0], lower.shape[1] - 1
    x = right.copy()
    for i in range(count):
        for d in range(1, min(reach, i) + 1):
            x[i] -= lower[i, d] * x[i - d]
    x /= diagonal
    for i in range(count - 1, -1, -1):
        for d in range(1, min(reach, count - 1 - i) + 1):
            x[i] -= lower[i + d, d] * x[i + d]
    return x


@numba.njit(cache=True, nogil=True)
def _inverse_band(lower: FloatArray, diagonal: FloatArray) -> FloatArray:
    """(L D Lᵀ)⁻¹ within the band, by Takahashi's recursion."""
    count, reach = lower.shape[0], lower.shape[1] - 1
    inverse = np.zeros((count, reach + 1))  # [i, d] is the element at (i, i + d)
    for i in range(count - 1, -1, -1):
        last = min(reach, count - 1 - i)
        for d in range(last, -1, -1):
            total = 1.0 / diagonal[i] if d == 0 else 0.0
            for k in range(1, last + 1):
                total -= lower[i + k, k] * (inverse[i + k, d - k] if k <= d else inverse[i + d, k - d])
            inverse[i, d] = total
    return inverse
