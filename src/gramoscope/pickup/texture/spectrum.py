"""How the rows of a followed window hang together, frequency by frequency along the groove.

Neighbouring rows of a wall show the same texture through slightly different blur. With the window's rows as a vector x(s),
stationary along the groove, everything that second moments can tell is in the cross-spectra

    C_f = Σ_τ E[x(s) x(s + τ)ᵀ] e^(−2πifτ),

real because a groove has no preferred direction along itself. Lags beyond the blur discs carry nothing but chance, so the
sums are cut off there (Blackman and Tukey's lag window), which also makes C_f smooth in f. Moving the window by δ across
the rows changes C_f by δ · C′_f, which is in the cross-spectra of a window that is a few rows wider.

A texture's power falls by five orders of magnitude along the band, and what leaks from the strong end would drown the weak
end where the information is. All windows are therefore whitened along the groove first, by one short filter for all rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from scipy import fft, ndimage

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.errors import require

WHITENER_TAPS = 41


@dataclass(frozen=True)
class Band:
    """The frequencies along the groove that are used, cycles a pixel.

    Parameters
    ----------
    low, high : float
        Below `low` lie shading and dirt, above `high` interpolation and noise.
    """

    low: float = 0.02
    high: float = 0.35

    def bins(self, length: int) -> slice:
        """Return the bins of a real Fourier transform of that length that lie in the band."""
        return slice(int(np.ceil(self.low * length)), int(np.floor(self.high * length)) + 1)


def whitening_filter(power: FloatArray, band: Band) -> FloatArray:
    """Return a symmetric filter that makes a power spectrum flat inside the band and keeps nothing outside.

    Parameters
    ----------
    power : float64 array, shape (bin,)
        Of a real transform, from 0 to ½ cycle a pixel.
    band : Band

    Returns
    -------
    float64 array, shape (41,)
        Windowed frequency sampling of 1/√power; its response is zero at frequency 0 and its largest about 1.
    """
    frequency = np.linspace(0, 0.5, power.size)
    gain = 1 / np.sqrt(power + power.max() * 1e-7)
    gain /= 1 + np.exp((frequency - band.high) / 0.015)
    gain *= 1 - np.exp(-((frequency / (0.6 * band.low)) ** 4))
    response = np.fft.fftshift(fft.irfft(gain / gain.max()))
    middle = response.size // 2
    window = np.kaiser(WHITENER_TAPS, 6.0)
    taps = response[middle - WHITENER_TAPS // 2 : middle + WHITENER_TAPS // 2 + 1] * window
    return np.asarray(taps - window * taps.sum() / window.sum())


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_pairs(w, here, nearer, out):  # type: ignore[no-untyped-def]
    """Two pairs of taps at once; `here` and `nearer` are what lies before and behind."""
    w0, w1 = w
    before, behind = here
    before_, behind_ = nearer
    for i in range(out.size):
        out[i] += w0 * (before[i] + behind[i]) + w1 * (before_[i] + behind_[i])


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _scale(w, values, out):  # type: ignore[no-untyped-def]
    for i in range(out.size):
        out[i] = w * values[i]


@numba.njit(cache=True, nogil=True)
def filter_columns(rows, half_taps, out):  # type: ignore[no-untyped-def]
    """Filter along the columns by taps given from their middle on, an even number beyond it; see `filtered`."""
    width, n = rows.shape
    half = half_taps.size - 1
    wide = np.empty((width + 2 * half, n), np.float32)
    wide[half : half + width] = rows
    for k in range(half):
        # a window that is shorter than the mirror repeats its other end
        mirrored = min(k, width - 1)
        wide[half - 1 - k] = rows[mirrored]
        wide[half + width + k] = rows[width - 1 - mirrored]
    flat, into = wide.ravel(), out.ravel()
    block = max(1, FILTER_BLOCK // n) * n
    for start in range(0, into.size, block):
        stop = min(start + block, into.size)
        piece = into[start:stop]
        _scale(half_taps[0], flat[start + half * n : stop + half * n], piece)
        for k in range(1, half, 2):
            a, b, c, d = (half - k) * n, (half + k) * n, (half - k - 1) * n, (half + k + 1) * n
            _add_pairs(
                (half_taps[k], half_taps[k + 1]),
                (flat[start + a : stop + a], flat[start + b : stop + b]),
                (flat[start + c : stop + c], flat[start + d : stop + d]),
                piece,
            )


FILTER_BLOCK = 1024
"""Values that are filtered at a time, and stay near."""


def filtered(rows: Float32Array, taps: FloatArray) -> Float32Array:
    """Return rows filtered along the columns by a symmetric filter; beyond the ends they are mirrored.

    Parameters
    ----------
    rows : float32 array, shape (column, row)
    taps : float64 array
        An odd number of them.
    """
    out = np.empty(rows.shape, np.float32)
    filter_columns(rows, half_of(taps), out)
    return out


def half_of(taps: FloatArray) -> Float32Array:
    """Return a symmetric filter from its middle on, with an even number of taps beyond it."""
    half_taps = taps[taps.size // 2 :].astype(np.float32)
    return half_taps if half_taps.size % 2 else np.append(half_taps, np.float32(0))


@dataclass(eq=False)
class CrossSpectra:
    """Sums of cross-spectra over many windows.

    Parameters
    ----------
    rows : int
    length : int
        Of the transforms; at least a window's width and the largest lag.
    """

    rows: int
    length: int

    def __post_init__(self) -> None:
        bins = self.length // 2 + 1
        self.within: FloatArray = np.zeros((bins, self.rows, self.rows))
        self.weight: FloatArray = np.zeros(bins)

    def see(self, window: Float32Array, weight: Float32Array) -> None:
        """Add a window's, zero where its columns have no weight.

        Parameters
        ----------
        window : float32 array, shape (column, row)
            Whitened.
        weight : float32 array, shape (column,)
            0 … 1, rising and falling softly.
        """
        x = fft.rfft(window * weight[:, None], self.length, axis=0)
        seen = np.stack([x.real, x.imag], axis=2)
        self.within += seen @ seen.transpose(0, 2, 1)
        self.weight += np.abs(fft.rfft(weight.astype(np.float64), self.length)) ** 2

    def add(self, other: CrossSpectra) -> None:
        """Add the sums of other windows."""
        self.within += other.within
        self.weight += other.weight

    @cached_property
    def _to_lag_0(self) -> FloatArray:
        """What each bin counts in the mean over all of a real transform's."""
        share = np.full(self.weight.size, 2 / self.length)
        share[0] = 1 / self.length
        if self.length % 2 == 0:
            share[-1] = 1 / self.length
        return share

    @property
    def columns(self) -> float:
        """How many columns were summed over, each counted by the square of its weight."""
        return float(self._to_lag_0 @ self.weight)

    @property
    def covariance(self) -> FloatArray:
        """Of the rows in one column, shape (row, row)."""
        return np.asarray(np.tensordot(self._to_lag_0, self.within, 1) / max(self.columns, 1.0))

    def lags(self, largest_lag_px: int) -> FloatArray:
        """Return the covariance of the rows of columns 0 … `largest_lag_px` apart, shape (lag, row, row)."""
        columns = np.maximum(fft.irfft(self.weight, self.length)[: largest_lag_px + 1], 1.0)
        return np.asarray(fft.irfft(self.within, self.length, axis=0)[: columns.size] / columns[:, None, None])

    def spectra(self, *, largest_lag_px: int, length: int) -> FloatArray:
        """Return C_f; see `spectra_of`."""
        return spectra_of(self.lags(largest_lag_px), length=length)


def spectra_of(lags: FloatArray, *, length: int) -> FloatArray:
    """Return C_f.

    Parameters
    ----------
    lags : float64 array, shape (lag, row, row)
        Covariances of rows so many columns apart, from 0 on. The lag window is 1 to half of the largest and falls to zero as
        a cosine.
    length : int
        Of the transform in whose bins the answer is wanted, more than twice the largest lag.

    Returns
    -------
    float64 array, shape (length // 2 + 1, row, row)
    """
    largest = len(lags) - 1
    require(length > 2 * largest, f"a transform of {length} for lags up to {largest}", "more than twice it")
    u = np.arange(largest + 1) / (largest + 1)
    taper = np.where(u < 0.5, 1.0, 0.5 * (1 + np.cos(2 * np.pi * (u - 0.5))))
    covariance = lags * taper[:, None, None]
    full = np.zeros((length, *lags.shape[1:]))
    full[: u.size] = covariance
    full[-u.size + 1 :] = covariance[1:][::-1]
    return np.asarray(fft.rfft(full, axis=0).real)


def precision(c: FloatArray, *, band: slice, loading: float, smooth_bins: float) -> tuple[FloatArray, FloatArray]:
    """Return the inverse of C_f in a band, safe against what the sample could not tell.

    The least third of the eigenvalues of each C_f is noise; none is allowed below their mean (smoothed along f), and
    `loading` times the mean of all is added to each: much of it makes a reader that is less exact and forgives more.

    Parameters
    ----------
    c : float64 array, shape (bin, row, row)
    band : slice
        Bins to invert.
    loading : float
        Zero or more.
    smooth_bins : float
        Standard deviation of the smoothing along f.

    Returns
    -------
    inverse : float64 array, shape (bin in the band, row, row)
    noise : float64 array, shape (bin in the band,)
        What the least eigenvalues have.
    """
    value, vector = np.linalg.eigh(c[band])
    rows = c.shape[1]
    least = np.maximum(value[:, : rows // 3].mean(axis=1), 1e-12 * value[:, -1])
    floor = ndimage.gaussian_filter1d(least, smooth_bins, mode="nearest")
    value = np.maximum(value, floor[:, None]) + loading * np.trace(c[band], axis1=1, axis2=2)[:, None] / rows
    inverse = (vector / value[:, None, :]) @ vector.transpose(0, 2, 1)
    return inverse, floor
