"""How likely a path of the groove is, and which way it should move.

Whitened windows x that follow the right path are Gaussian with the cross-spectra C_f that the passage taught. If the path is
moved by δ(s) across the rows, x changes by δ(s) x'(s), and its cross-spectra by δ C′. Two witnesses tell from that in which
direction a path should move, each with the constant that makes it zero on average:

    u₁(s) = −x̂'(s) · y(s),     y = C⁻¹ x,     x̂ = x − N y,
    u₂(s) = −½ y(s) · (C′ y)(s),

with C⁻¹ and C′ applied in the frequency domain: local in every column, whatever the bandwidth of the sound. The first is the
derivative of −½ Σ_f x_fᴴ C_f⁻¹ x_f along the picture's own change, from which the camera's noise of the power N is left out, as
only the texture x̂ moves with the groove. The second is the score of the Gaussian likelihood of the window, and efficient if
the texture is Gaussian and C′ well known; the first needs no C′ and forgives more. How far either can be trusted is measured:
with their answers I to a path that is moved and their real powers J, a matrix, the weights J⁻¹I make of both the best score;
u/I, with the I and J of that score, estimates what is missing from the path, with the error √J/I.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy import fft, ndimage

from gramoscope.conventions import BoolArray, Float32Array, FloatArray
from gramoscope.pickup.texture.following import GENTLE, REACH, across
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
    inverse, change : float32 arrays, shape (bin in the band, row, row)
        C_f⁻¹ and C′_f.
    noise : float32 array, shape (bin in the band,)
        N.
    share : float64 array, shape (2,)
        By how much each witness takes part in the score.
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
    change: Float32Array
    noise: Float32Array
    share: FloatArray
    information: float
    score_power: float
    mean_score: float
    row_power: Float32Array
    columns: int

    @property
    def trust(self) -> float:
        """I/J: how far the score can be taken at its word."""
        return self.information / self.score_power if self.score_power > 0 else 0.0


def witnesses(
    window: Float32Array,
    derivative: Float32Array,
    weight: Float32Array,
    learned: StripeStatistics,
    *,
    band: Band,
    length: int,
) -> FloatArray:
    """Return what both witnesses say in each column, without their constants, and tempered.

    Real texture is not Gaussian: a cluster of bright grains is louder than the rest in everything it says, truth and error
    alike. What they say is therefore divided by 0.3 + m, where m is the local value of xᵀC⁻¹x, 1 on average (the
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

    Returns
    -------
    float64 array, shape (2, column)
        u₁ and u₂.
    """
    bins = band.bins(length)
    width = window.shape[1]
    spectrum = fft.rfft(window * weight, length)
    explained, still, turned = (np.zeros_like(spectrum) for _ in range(3))
    _explain(
        spectrum[:, bins],
        learned.inverse,
        learned.change,
        learned.noise,
        explained[:, bins],
        still[:, bins],
        turned[:, bins],
    )
    y, n_y, c_y = (fft.irfft(one, length)[:, :width] for one in (explained, still, turned))
    moving = derivative - across(np.pad(n_y, ((REACH, REACH), (0, 0))), GENTLE)
    # as many degrees of freedom a column as rows, in the share of the spectrum that is used
    freedom = window.shape[0] * 2 * (bins.stop - bins.start) / length
    loudness = ndimage.gaussian_filter1d(np.einsum("ij,ij->j", window, y), LOUDNESS_PX, mode="nearest") / freedom
    said = [np.einsum("ij,ij->j", moving, y), 0.5 * np.einsum("ij,ij->j", c_y, y)]
    return np.asarray(-np.array(said, np.float64) / (TEMPER + np.maximum(loudness, 0.0)))


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_product(matrix, x, out):  # type: ignore[no-untyped-def]
    """Add the product of a symmetric matrix, row by row, which is column by column."""
    for j in range(x.size):
        row, w = matrix[j], x[j]
        for i in range(out.size):
            out[i] += w * row[i]


@numba.njit(cache=True, nogil=True)
def _explain(spectrum, inverse, change, noise, explained, still, turned):  # type: ignore[no-untyped-def]
    """Write y = C⁻¹x, N y and C′y for each frequency of x, arrays of shape (row, bin)."""
    rows, bins = spectrum.shape
    x, y, z = np.empty((2, rows), np.float32), np.empty((2, rows), np.float32), np.empty((2, rows), np.float32)
    for b in range(bins):
        for i in range(rows):
            x[0, i], x[1, i] = spectrum[i, b].real, spectrum[i, b].imag
        y[:], z[:] = np.float32(0), np.float32(0)
        for part in range(2):
            _add_product(inverse[b], x[part], y[part])
            _add_product(change[b], y[part], z[part])
        for i in range(rows):
            explained[i, b] = complex(y[0, i], y[1, i])
            still[i, b] = complex(noise[b] * y[0, i], noise[b] * y[1, i])
            turned[i, b] = complex(z[0, i], z[1, i])


def best_shares(answers: FloatArray, powers: FloatArray) -> FloatArray:
    """Return how witnesses should take part in the score: J⁻¹I, none against its own word.

    A fiftieth is added to the diagonal of J, so that two witnesses that say the same are not played off against each other.

    Parameters
    ----------
    answers : float64 array, shape (2,)
        I: how the mean of each answers to a moved path.
    powers : float64 array, shape (2, 2)
        J: their power and what they have in common.

    Returns
    -------
    float64 array, shape (2,)
        Zero or more; both zero if neither answers.
    """
    own = np.diag(powers)
    alone = np.where((own > 0) & (answers > 0), answers / np.maximum(own, 1e-30), 0.0)
    both = np.linalg.solve(powers + np.diag(0.02 * own + 1e-30), answers)
    if (both > 0).all() and (alone > 0).all():
        return np.asarray(both)
    better = np.argmax(alone * answers)
    return np.asarray(np.where(np.arange(answers.size) == better, alone, 0.0))


def softened(valid: BoolArray) -> Float32Array:
    """Return a weight that is 1 well inside the valid columns and falls softly to 0 before their ends."""
    core = ndimage.binary_erosion(valid, np.ones(2 * TAPER_PX + 1, np.bool_), border_value=1)
    bell = np.hanning(2 * TAPER_PX + 3)[1:-1]
    return np.asarray(ndimage.convolve1d(core.astype(np.float64), bell / bell.sum(), mode="nearest"), np.float32)


def quiet_power(said: FloatArray, weight: FloatArray) -> tuple[FloatArray, float]:
    """Return the power of scores at frequencies where no sound is, times the weight it rests on, and that weight.

    Parameters
    ----------
    said : float64 array, shape (score, column)
        Zero on average.
    weight : float64 array, shape (column,)
        0 … 1; the score counts so much.

    Returns
    -------
    power : float64 array, shape (score, score)
    columns : float
        Their ratio estimates J; sums of both over windows may be divided too.
    """
    length = fft.next_fast_len(2 * weight.size, real=True)
    low, high = (int(np.ceil(f * length)) for f in QUIET_BAND)
    spectrum = fft.rfft(said * weight, length)[:, low:high]
    return np.asarray((spectrum @ spectrum.conj().T).real / (high - low)), float(np.sum(weight**2))


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
