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

import numba
import numpy as np
from scipy import fft, ndimage

from gramoscope.conventions import Float32Array, FloatArray, IntArray
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

    def frequencies(self, length: int) -> FloatArray:
        """Return those of these bins, cycles a pixel."""
        return np.arange(length // 2 + 1)[self.bins(length)] / length


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


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_products(x, within):  # type: ignore[no-untyped-def]
    """Add Re x_i x_j* of each bin, for j up to i."""
    bins, rows = x.shape
    real, imaginary = np.empty(rows), np.empty(rows)
    for b in range(bins):
        for i in range(rows):
            real[i], imaginary[i] = x[b, i].real, x[b, i].imag
        pair = 0
        for i in range(rows):
            for j in range(i + 1):
                within[b, pair + j] += real[i] * real[j] + imaginary[i] * imaginary[j]
            pair += i + 1


def pair_count(rows: int) -> int:
    """How many pairs of rows there are, each with itself included."""
    return rows * (rows + 1) // 2


def square(pairs: FloatArray, rows: int) -> FloatArray:
    """Return symmetric matrices, shape (…, row, row), of their pairs of rows 00, 10, 11, 20 and so on, shape (…, pair)."""
    number = np.empty((rows, rows), np.intp)
    lower = np.tril_indices(rows)
    number[lower] = number.T[lower] = np.arange(pair_count(rows))
    return np.asarray(pairs[..., number])


@dataclass(eq=False)
class CrossSpectra:
    """Sums of cross-spectra over many windows.

    Parameters
    ----------
    rows : int
    length : int
        Of the transforms; at least a window's width and the largest lag.

    Attributes
    ----------
    within : float64 array, shape (bin, pair)
        Of each pair of rows; see `square`.
    weight : float64 array, shape (bin,)
    """

    rows: int
    length: int

    def __post_init__(self) -> None:
        bins = self.length // 2 + 1
        self.within: FloatArray = np.zeros((bins, pair_count(self.rows)))
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
        _add_products(fft.rfft(window * weight[:, None], self.length, axis=0), self.within)
        self.weight += np.abs(fft.rfft(weight.astype(np.float64), self.length)) ** 2

    def add(self, other: CrossSpectra) -> None:
        """Add the sums of other windows."""
        self.within += other.within
        self.weight += other.weight

    def lags(self, largest_lag_px: int) -> LagSums:
        """Return what these sums are in lags of 0 … `largest_lag_px` columns."""
        lag = np.arange(largest_lag_px + 1)
        back = cosines(lag, np.arange(self.weight.size) / self.length) * (2 / self.length)
        back[:, 0] /= 2
        if self.length % 2 == 0:
            back[:, -1] /= 2
        return LagSums(self.rows, back @ self.within, back @ self.weight)


def cosines(lag: IntArray, frequency: FloatArray) -> FloatArray:
    """Return cos 2πfτ, shape (lag, frequency): what a Fourier transform of symmetric sequences is made of."""
    return np.asarray(np.cos(2 * np.pi * np.outer(lag, frequency)))


@dataclass(frozen=True, eq=False)
class LagSums:
    """Sums over many windows of the products of what lies so many columns apart.

    Attributes
    ----------
    rows : int
    product : float64 array, shape (lag, pair)
        Of each pair of rows; see `square`.
    weight : float64 array, shape (lag,)
        Of how many columns, each counted by its weight.
    """

    rows: int
    product: FloatArray
    weight: FloatArray

    def __add__(self, other: LagSums) -> LagSums:
        return LagSums(self.rows, self.product + other.product, self.weight + other.weight)

    @property
    def columns(self) -> float:
        """How many columns were summed over, each counted by the square of its weight."""
        return float(self.weight[0])

    @property
    def covariance(self) -> FloatArray:
        """Of the rows in one column, shape (row, row)."""
        return square(self.product[0] / max(self.columns, 1.0), self.rows)

    def spectra(self, frequency: FloatArray, *, largest_lag_px: int) -> FloatArray:
        """Return C_f.

        Parameters
        ----------
        frequency : float64 array, shape (bin,)
            Cycles a pixel.
        largest_lag_px : int
            No more than there are. The lag window is 1 to half of it and falls to zero as a cosine.

        Returns
        -------
        float64 array, shape (bin, row, row)
        """
        known = self.weight.size - 1
        require(largest_lag_px <= known, f"lags up to {largest_lag_px}", f"no more than the {known} that were summed")
        lag = np.arange(largest_lag_px + 1)
        u = lag / (largest_lag_px + 1)
        taper = np.where(u < 0.5, 1.0, 0.5 * (1 + np.cos(2 * np.pi * (u - 0.5))))
        both = np.where(lag == 0, 1.0, 2.0)
        share = both * taper / np.maximum(self.weight[: lag.size], 1.0)
        return square((cosines(lag, frequency) * share[:, None]).T @ self.product[: lag.size], self.rows)


def precision(c: FloatArray, *, loading: float, smooth_bins: float) -> tuple[FloatArray, FloatArray]:
    """Return the inverse of C_f, safe against what the sample could not tell.

    The least third of the eigenvalues of each C_f is noise; none is allowed below their mean (smoothed along f), and
    `loading` times the mean of all is added to each: much of it makes a reader that is less exact and forgives more.

    Parameters
    ----------
    c : float64 array, shape (bin, row, row)
    loading : float
        Zero or more.
    smooth_bins : float
        Standard deviation of the smoothing along f.

    Returns
    -------
    inverse : float64 array, shape (bin, row, row)
    noise : float64 array, shape (bin,)
        What the least eigenvalues have.
    """
    value, vector = np.linalg.eigh(c)
    rows = c.shape[1]
    least = np.maximum(value[:, : rows // 3].mean(axis=1), 1e-12 * value[:, -1])
    floor = ndimage.gaussian_filter1d(least, smooth_bins, mode="nearest")
    value = np.maximum(value, floor[:, None]) + loading * np.trace(c, axis1=1, axis2=2)[:, None] / rows
    inverse = (vector / value[:, None, :]) @ vector.transpose(0, 2, 1)
    return inverse, floor
