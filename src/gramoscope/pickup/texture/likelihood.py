"""How likely a path of the groove is, and which way it should move.

Whitened windows x that follow the right path are Gaussian with the cross-spectra C_f that the passage taught. If the path is
moved by δ(s) across the rows, x changes by δ(s) x'(s), and the log-likelihood −½ Σ_f x_fᴴ C_f⁻¹ x_f by δ(s) times the score

    u(s) = −x̂'(s) · y(s) + constant,     y = C⁻¹ x,     x̂ = x − N y,

with C⁻¹ applied in the frequency domain: exact for every column, whatever the bandwidth of the sound. Only the texture x̂ moves
with the groove, the camera's noise of the power N does not, so its share is taken out of the derivative. The expected change
of the score with δ is Fisher's information I for one column. So u/I estimates what is missing from the path, with the error
√J/I, where J is the real power of the score: equal to I if the texture is what the model says, measured because it is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.texture.following import REACH, Float32Array, across
from gramoscope.pickup.texture.spectrum import Band

TAPER_PX = 16
"""Half the width of the soft edge of a weight: so far around a damaged place nothing is read."""
TEMPER = 0.3
LOUDNESS_PX = 3.0
"""Standard deviation of the smoothing of the local loudness: the length of a few grains."""
QUIET_BAND = (1 / 40, 1 / 18)
"""Cycles a pixel: above any sound and what smoothed paths can follow, below the correlation of the score with itself. The
power of the score there is that of its error."""


@dataclass(frozen=True, eq=False)
class StripeStatistics:
    """What the passage taught about one stripe.

    Attributes
    ----------
    inverse : float32 array, shape (bin in the band, row, row)
        C_f⁻¹.
    noise : float32 array, shape (bin in the band,)
        N.
    information : float
        I of one column, per row²: how the mean score answers to a move of the path.
    score_power : float
        J of one column.
    mean_score : float
        The constant that makes scores zero on average.
    row_power : float32 array, shape (row,)
        Mean square of each row of the whitened window.
    columns : int
        How many it was learned from.
    """

    inverse: Float32Array
    noise: Float32Array
    information: float
    score_power: float
    mean_score: float
    row_power: Float32Array
    columns: int

    @property
    def trust(self) -> float:
        """I/J: how far the score can be taken at its word."""
        return self.information / self.score_power if self.score_power > 0 else 0.0


def scores(
    window: Float32Array,
    derivative: Float32Array,
    weight: Float32Array,
    learned: StripeStatistics,
    *,
    band: Band,
    length: int,
) -> FloatArray:
    """Return the score of each column, without its constant, and tempered.

    Real texture is not Gaussian: a cluster of bright grains is louder than the rest in everything it says, truth and error
    alike. The score of each column is therefore divided by 0.3 + m, where m is the local value of xᵀC⁻¹x, 1 on average (the
    weight of a t-distribution with few degrees of freedom). On skewed textures that is worth 5 dB.

    Parameters
    ----------
    window, derivative : float32 arrays, shape (row, column)
        Whitened.
    weight : float32 array, shape (column,)
        0 … 1, soft.
    learned : StripeStatistics
    band : Band
    length : int
        Of the transform, at least the number of columns.
    """
    bins = band.bins(length)
    spectrum = fft.rfft(window * weight, length)
    inside = np.ascontiguousarray(spectrum[:, bins].T)
    both = np.stack([inside.real, inside.imag], axis=2)
    explained = learned.inverse @ both
    full = np.zeros_like(spectrum)
    full[:, bins] = (explained[:, :, 0] + 1j * explained[:, :, 1]).T
    y = fft.irfft(full, length)[:, : window.shape[1]]
    full[:, bins] *= learned.noise
    still = np.pad(fft.irfft(full, length)[:, : window.shape[1]], ((REACH, REACH), (0, 0))).astype(np.float32)
    moving = np.subtract(derivative, across(still))
    # as many degrees of freedom a column as rows, in the share of the spectrum that is used
    freedom = window.shape[0] * 2 * (bins.stop - bins.start) / length
    loudness = ndimage.gaussian_filter1d(np.einsum("ij,ij->j", window, y), LOUDNESS_PX, mode="nearest") / freedom
    tempered = np.einsum("ij,ij->j", moving, y) / (TEMPER + np.maximum(loudness, 0.0))
    return np.asarray(-tempered, np.float64)


def softened(valid: BoolArray) -> Float32Array:
    """Return a weight that is 1 well inside the valid columns and falls softly to 0 before their ends."""
    core = ndimage.binary_erosion(valid, np.ones(2 * TAPER_PX + 1, np.bool_), border_value=1)
    bell = np.hanning(2 * TAPER_PX + 3)[1:-1]
    return np.asarray(ndimage.convolve1d(core.astype(np.float64), bell / bell.sum(), mode="nearest"), np.float32)


def quiet_power(score: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Return the power of a score at frequencies where no sound is, times the weight it rests on, and that weight.

    Parameters
    ----------
    score : float64 array, shape (column,)
        Zero on average.
    weight : float64 array, shape (column,)
        0 … 1; the score counts so much.

    Returns
    -------
    power, columns : float
        Their ratio estimates J; sums of both over windows may be divided too.
    """
    length = fft.next_fast_len(2 * score.size, real=True)
    low, high = (int(np.ceil(f * length)) for f in QUIET_BAND)
    spectrum = fft.rfft(score * weight, length)[low:high]
    return float(np.mean(np.abs(spectrum) ** 2)), float(np.sum(weight**2))


def believable(
    window: Float32Array, row_power: Float32Array, *, limits: tuple[float, float], smooth_px: int = 25
) -> BoolArray:
    """Tell which columns have about the texture that they should: no scratch, no speck, no missing wall.

    Parameters
    ----------
    window : float32 array, shape (row, column)
        Whitened.
    row_power : float32 array, shape (row,)
        What each row has on average.
    limits : (float, float)
        Least and largest power, in units of the average, over `smooth_px` columns.

    Returns
    -------
    bool array, shape (column,)
    """
    power = np.mean(window**2 / np.maximum(row_power, 1e-12)[:, None], axis=0)
    local = ndimage.uniform_filter1d(power, smooth_px, mode="nearest")
    return np.asarray((local >= limits[0]) & (local <= limits[1]))
