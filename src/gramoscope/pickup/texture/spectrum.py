"""How the rows of a followed window hang together, frequency by frequency along the groove.

Neighbouring rows of a wall show the same texture through slightly different blur. With the window's rows as a vector x(s),
stationary along the groove, everything that second moments can tell is in the cross-spectra

    C_f = Σ_τ E[x(s) x(s + τ)ᵀ] e^(−2πifτ),

real because a groove has no preferred direction along itself. Lags beyond the blur discs carry nothing but chance, so the
sums are cut off there (Blackman and Tukey's lag window), which also makes C_f smooth in f. Moving the window by δ across
the rows changes C_f by δ · C′_f, with C′_f from the cross-spectra of the window and its derivative.

A texture's power falls by five orders of magnitude along the band, and what leaks from the strong end would drown the weak
end where the information is. All windows are therefore whitened along the groove first, by one short filter for all rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy import fft, signal

from gramoscope.conventions import Float32Array, FloatArray

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
    window = signal.get_window(("kaiser", 6.0), WHITENER_TAPS, fftbins=False)
    taps = response[middle - WHITENER_TAPS // 2 : middle + WHITENER_TAPS // 2 + 1] * window
    return np.asarray(taps - window * taps.sum() / window.sum())


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_pair(w, before, after, out):  # type: ignore[no-untyped-def]
    for x in range(out.size):
        out[x] += w * (before[x] + after[x])


@numba.njit(cache=True, nogil=True)
def _filter(rows, half_taps, out):  # type: ignore[no-untyped-def]
    """Filter each row by taps given from their middle on."""
    height, width = rows.shape
    half = half_taps.size - 1
    wide = np.empty(width + 2 * half, np.float32)
    for i in range(height):
        wide[half : half + width] = rows[i]
        for k in range(half):
            # a row that is shorter than the mirror repeats its other end
            mirrored = min(k, width - 1)
            wide[half - 1 - k] = rows[i, mirrored]
            wide[half + width + k] = rows[i, width - 1 - mirrored]
        here = wide[half : half + width]
        _add_pair(np.float32(0.5) * half_taps[0], here, here, out[i])
        for k in range(1, half + 1):
            _add_pair(half_taps[k], wide[half - k : half - k + width], wide[half + k : half + k + width], out[i])


def filtered(rows: Float32Array, taps: FloatArray) -> Float32Array:
    """Return rows filtered along the columns by a symmetric filter; beyond the ends they are mirrored.

    Parameters
    ----------
    rows : float32 array, shape (row, column)
    taps : float64 array
        An odd number of them.
    """
    out = np.zeros(rows.shape, np.float32)
    _filter(rows, taps[taps.size // 2 :].astype(np.float32), out)
    return out


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
        self.change: FloatArray = np.zeros((bins, self.rows, self.rows))
        self.weight: FloatArray = np.zeros(bins)

    def add(self, other: CrossSpectra) -> None:
        """Add the sums of other windows."""
        self.within += other.within
        self.change += other.change
        self.weight += other.weight

    def spectra(self, *, largest_lag_px: int, change_lag_px: int, length: int) -> tuple[FloatArray, FloatArray]:
        """Return C_f and C′_f.

        Parameters
        ----------
        largest_lag_px, change_lag_px : int
            For C and for C′: the lag window is 1 to half of it and falls to zero as a cosine.
        length : int
            Of the transform in whose bins the answer is wanted.

        Returns
        -------
        C, change : float64 arrays, shape (length // 2 + 1, row, row)
        """

        def smoothed(sums: FloatArray, lag_px: int) -> FloatArray:
            u = np.arange(lag_px + 1) / (lag_px + 1)
            taper = np.where(u < 0.5, 1.0, 0.5 * (1 + np.cos(2 * np.pi * (u - 0.5))))
            columns = np.maximum(fft.irfft(self.weight, self.length)[: u.size], 1.0)
            covariance = fft.irfft(sums, self.length, axis=0)[: u.size] * (taper / columns)[:, None, None]
            full = np.zeros((length, self.rows, self.rows))
            full[: u.size] = covariance
            full[-u.size + 1 :] = covariance[1:][::-1]
            return np.asarray(fft.rfft(full, axis=0).real)

        return smoothed(self.within, largest_lag_px), smoothed(self.change, change_lag_px)


def cross_spectra(window: Float32Array, derivative: Float32Array, weight: Float32Array, *, length: int) -> CrossSpectra:
    """Return the cross-spectra of one window, zero where its columns have no weight.

    Parameters
    ----------
    window, derivative : float32 arrays, shape (row, column)
        Whitened.
    weight : float32 array, shape (column,)
        0 … 1, rising and falling softly.
    length : int
        Of the transforms.
    """
    out = CrossSpectra(window.shape[0], length)
    seen, moved = (_parts(fft.rfft(rows * weight, length)) for rows in (window, derivative))
    out.within += seen @ seen.transpose(0, 2, 1)
    half = moved @ seen.transpose(0, 2, 1)
    out.change += half + half.transpose(0, 2, 1)
    out.weight += np.abs(fft.rfft(weight.astype(np.float64), length)) ** 2
    return out


def _parts(spectrum: npt.NDArray[np.complex64]) -> Float32Array:
    """Return real and imaginary parts, shape (bin, row, 2)."""
    x = np.ascontiguousarray(spectrum.T)
    return np.stack([x.real, x.imag], axis=2)


def precision(
    c: FloatArray, *, band: slice, loading: float, smooth_bins: float = 16.0
) -> tuple[Float32Array, Float32Array]:
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
    float32 array, shape (bin in the band, row, row)
    """
    from scipy.ndimage import gaussian_filter1d

    value, vector = np.linalg.eigh(c[band])
    rows = c.shape[1]
    least = np.maximum(value[:, : rows // 3].mean(axis=1), 1e-12 * value[:, -1])
    floor = gaussian_filter1d(least, smooth_bins, mode="nearest")
    value = np.maximum(value, floor[:, None]) + loading * np.trace(c[band], axis1=1, axis2=2)[:, None] / rows
    inverse = (vector / value[:, None, :]) @ vector.transpose(0, 2, 1)
    return inverse.astype(np.float32), floor.astype(np.float32)
