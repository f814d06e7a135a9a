"""How likely a path of the groove is, and which way it should move.

Whitened windows x that follow the right path are Gaussian with the cross-spectra C_f that the passage taught. If the path is
moved by δ(s) across the rows, x changes by δ(s) x'(s), and its cross-spectra by δ C′. Two witnesses tell from that in which
direction a path should move, each with the constant that makes it zero on average:

    u₁(s) = −x'(s) · y(s),     y = C⁻¹ x,
    u₂(s) = −½ y(s) · (C′ y)(s),

with C⁻¹ and C′ applied in the frequency domain: local in every column, whatever the bandwidth of the sound. The first is the
derivative of −½ Σ_f x_fᴴ C_f⁻¹ x_f along the picture's own change. The second is the score of the Gaussian likelihood of the
window, and efficient if the texture is Gaussian and C′ well known; the first needs no C′ and forgives more. How far either
can be trusted is measured: with their answers I to a path that is moved and their real powers J, a matrix, the weights J⁻¹I
make of both the best score.
Of that score the strongest filters are kept (see `filter_bank`), and its own I and J measured; u/I estimates what is missing
from the path, with the error √J/I.

Real texture is not Gaussian: a cluster of bright grains is louder than the rest in everything it says, truth and error
alike. What is said is therefore divided by 0.3 + m, where m is the local loudness of the filters, 1 on average (the weight of
a t-distribution with few degrees of freedom). On skewed textures that is worth 5 dB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy import fft

from gramoscope.conventions import BoolArray, Float32Array, FloatArray
from gramoscope.pickup.texture.filter_bank import FilterBank
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
    bank : FilterBank
        What is heard of its window.
    information : float
        I of one column, per row²: how the mean score answers to a move of the path.
    score_power : float
        J of one column.
    mean_score : float
        The constant that makes scores zero on average.
    row_power : float64 array, shape (row,)
        Mean square of each row of the whitened window and beyond it.
    columns : float
        How many it was learned from.
    """

    bank: FilterBank
    information: float
    score_power: float
    mean_score: float
    row_power: FloatArray
    columns: float

    @property
    def trust(self) -> float:
        """I/J: how far the score can be taken at its word."""
        return self.information / self.score_power if self.score_power > 0 else 0.0


def said(channels: Float32Array, weight: Float32Array, bank: FilterBank, *, band: Band, length: int) -> FloatArray:
    """Return what a bank says in each column, without its constant, and tempered.

    Parameters
    ----------
    channels : float32 array, shape (column, channel)
        Whitened.
    weight : float32 array, shape (column,)
        0 … 1, soft.
    bank : FilterBank
    band : Band
    length : int
        Of the transform, at least the number of columns.

    Returns
    -------
    float64 array, shape (column,)
    """
    score, loudness = bank.heard(channels * weight[:, None], band=band, length=length)
    u = np.empty(score.size)
    temper(score, loudness, LOUDNESS_BELL, TEMPER, u)
    return u


LOUDNESS_BELL = np.exp(-0.5 * (np.arange(int(4 * LOUDNESS_PX) + 1) / LOUDNESS_PX) ** 2).astype(np.float32)
LOUDNESS_BELL /= 2 * LOUDNESS_BELL.sum() - LOUDNESS_BELL[0]
"""From its middle on."""


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_scaled(w, before, after, out):  # type: ignore[no-untyped-def]
    for x in range(out.size):
        out[x] += w * (before[x] + after[x])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def temper(score, loudness, half_bell, least, u):  # type: ignore[no-untyped-def]
    """Write scores over the local loudness and the least that it counts as."""
    width, reach = score.size, half_bell.size - 1
    wide = np.empty(width + 2 * reach, np.float32)
    wide[:reach], wide[reach : reach + width], wide[reach + width :] = loudness[0], loudness, loudness[-1]
    local = half_bell[0] * loudness
    for k in range(1, reach + 1):
        _add_scaled(half_bell[k], wide[reach - k : reach - k + width], wide[reach + k : reach + k + width], local)
    for x in range(width):
        u[x] = score[x] / (least + local[x])


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
    weight = np.empty(valid.size, np.float32)
    soften(valid, TAPERED, weight)
    return weight


TAPER = np.hanning(2 * TAPER_PX + 3)[1:-1]
TAPER /= TAPER.sum()
TAPERED = np.append(0.0, np.cumsum(TAPER))
"""By how much a weight has risen after so many columns of the way up."""


@numba.njit(cache=True, nogil=True)
def soften(valid, tapered, weight):  # type: ignore[no-untyped-def]
    """Erode by half the way up, and go that way about the ends of what is left; beyond the ends of all everything is valid."""
    width, reach = valid.size, tapered.size // 2 - 1
    weight[:] = 0.0
    begin = 0
    while begin < width:
        if not valid[begin]:
            begin += 1
            continue
        end = begin + 1
        while end < width and valid[end]:
            end += 1
        low = begin + reach if begin > 0 else -reach
        high = end - reach if end < width else width + reach
        if max(low, 0) < min(high, width):
            weight[max(low + reach, 0) : max(high - reach, 0)] = 1.0
            for x in range(max(low - reach, 0), min(low + reach, width)):
                weight[x] += tapered[min(max(high - x + reach, 0), 2 * reach + 1)] - tapered[low - x + reach]
            for x in range(max(high - reach, low + reach, 0), min(high + reach, width)):
                weight[x] += tapered[high - x + reach]
        begin = end


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
    spectrum = _quiet_spectrum(said * weight)
    return np.asarray((spectrum @ spectrum.conj().T).real), float(np.sum(weight**2))


def _quiet_spectrum(weighted: FloatArray) -> npt.NDArray[np.complex128]:
    """Return the spectra of rows where no sound is, of squares that add up to their mean power there."""
    length = fft.next_fast_len(2 * weighted.shape[1], real=True)
    low, high = (int(np.ceil(f * length)) for f in QUIET_BAND)
    return np.asarray(fft.rfft(weighted, length)[:, low:high] / np.sqrt(high - low))


TEXTURE_PX = 25
"""Texture is weighed over so many columns."""


def believable(
    power: FloatArray | Float32Array, *, limits: tuple[float, float], smooth_px: int = TEXTURE_PX
) -> BoolArray:
    """Tell which columns have about the texture that they should: no scratch, no speck, no missing wall.

    Parameters
    ----------
    power : float array, shape (column, 2)
        Of the texture and of anything, 1 on average.
    limits : (float, float)
        The least of the first and the most of the second, over `smooth_px` columns.

    Returns
    -------
    bool array, shape (column,)
    """
    told = np.empty(len(power), np.bool_)
    within(power, smooth_px // 2, *limits, told)
    return told


@numba.njit(cache=True, nogil=True)
def within(power, reach, low, high, told):  # type: ignore[no-untyped-def]
    """Whether the means over ± reach columns, the ends being held, are large enough and small enough; see `believable`."""
    width = len(power)
    texture, anything = 0.0, 0.0
    for k in range(-reach, reach + 1):
        texture += power[min(max(k, 0), width - 1), 0]
        anything += power[min(max(k, 0), width - 1), 1]
    least, most = low * (2 * reach + 1), high * (2 * reach + 1)
    for x in range(width):
        told[x] = texture >= least and anything <= most
        enters, leaves = min(x + 1 + reach, width - 1), max(x - reach, 0)
        texture += power[enters, 0] - power[leaves, 0]
        anything += power[enters, 1] - power[leaves, 1]
