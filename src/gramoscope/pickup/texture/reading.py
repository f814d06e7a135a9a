"""One stretch read by what the passage taught: where its walls run, column by column, and how surely.

The path is improved in a few rounds of Fisher scoring. Each round lays a window about the present path of every stripe that
can be seen, hears both sides of the path in it, weights what they say by how far it can be trusted, and moves the walls by the
smoothed ratio of score and information. Both sides, because a path settles where its score is zero: there the score's noise
looks like an answer, and a little further off it has been forgotten. Rounds go from forgiving models to exact ones, the very
models that were learned while the passage's own paths improved in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numba
import numpy as np
import numpy.typing as npt
from scipy import fft

from gramoscope.conventions import INNER, OUTER, BoolArray, Float32Array, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.pickup.texture.filter_bank import FilterBank
from gramoscope.pickup.texture.following import channels, follow
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import StripeStatistics, believable, quiet_power, said, softened
from gramoscope.pickup.texture.spectrum import Band, filtered
from gramoscope.pickup.texture.tone import Tone

AS_IT_IS = Tone()
BURNT_SHARE = 0.15
"""Of the rows of a window in one column: a bright grain or two do no harm, a scratch does."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch laid ready for reading.

    Attributes
    ----------
    columns : float32 array, shape (column, row)
        The registered picture, transposed.
    usable : bool array, shape (column,)
        Columns that rest on enough frames.
    burnt : bool array, shape (column, row)
        Places at full scale.
    displacement_px : float64 array, shape (2, column)
        The present path of each wall.
    support : float64 array, shape (stripe, column)
        How sharp the coarse search found each stripe.
    tone : Tone
        In which the picture is seen: before it is interpolated, for bright grains ring less then.
    """

    columns: Float32Array
    usable: BoolArray
    burnt: BoolArray
    displacement_px: FloatArray
    support: FloatArray
    tone: Tone = AS_IT_IS

    def in_tone(self, tone: Tone) -> Stretch:
        """Return the same stretch seen in a tone; only a picture that is as it was can be seen in another one."""
        if tone == self.tone or tone.compression == self.tone.compression == 0:
            return self
        assert self.tone.compression == 0
        return replace(self, columns=tone(self.columns), tone=tone)

    def moved(self, step_px: FloatArray) -> Stretch:
        """Return the same stretch with its paths moved, shape (2, column)."""
        return replace(self, displacement_px=self.displacement_px + step_px)


@dataclass(frozen=True, eq=False)
class Model:
    """What the passage taught in one round of learning.

    Attributes
    ----------
    layout : StripeLayout
    tone : Tone
        In which windows are seen.
    whitener : float64 array
    half_px : int
        Rows of the windows on each side of a path.
    band : Band
    length : int
        Of the transforms.
    stripes : tuple of StripeStatistics or None
        None for a stripe of which too little was seen.
    spread_px : float
        How far on either side of a path it is heard.
    """

    layout: StripeLayout
    tone: Tone
    whitener: FloatArray
    half_px: int
    band: Band
    length: int
    stripes: tuple[StripeStatistics | None, ...]
    spread_px: float = 0.0

    def window(self, columns: Float32Array, stripe_row: FloatArray) -> Float32Array:
        """Return the whitened window about a path and the rows beyond it, shape (column, row)."""
        return filtered(follow(columns, stripe_row, self.half_px), self.whitener)

    def channels(self, columns: Float32Array, stripe_row: FloatArray, bank: FilterBank) -> Float32Array:
        """Return the channels of the whitened window about a path, shape (column, channel)."""
        return filtered(channels(columns, stripe_row, self.half_px, bank.basis), self.whitener)

    def path_noise_px(self, smooth_px: float) -> float:
        """Return the standard error that a path would have if errors were as claimed, smoothed by a Gaussian."""
        information = sum(one.trust * one.information for one in self.stripes if one is not None)
        return float(1 / np.sqrt(2 * np.sqrt(np.pi) * smooth_px * max(information, 1e-3)))

    @property
    def precision(self) -> float:
        """What all stripes told about their places in the passage that was learned from: Σ columns · I²/J."""
        return sum(one.columns * one.trust * one.information for one in self.stripes if one is not None)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the stripes say about the walls, each column for itself.

    Attributes
    ----------
    score, information : float64 arrays, shape (2, column)
        Sums over the stripes of each wall, weighted so that the information is the inverse of the variance of
        score/information; 0 where nothing was read.
    surprise : float64 array, shape (2,)
        Power of the score in this stretch over what was learned; 1 on average, NaN for a wall that was not read or judged.
    """

    score: FloatArray
    information: FloatArray
    surprise: FloatArray


@dataclass(frozen=True)
class Rules:
    """What is read, and how paths are improved.

    Parameters
    ----------
    power_limits : (float, float)
        Columns with less or more texture than so many times the usual are damaged.
    least_support : float
        Sharpness, of a typical sharp row, below which a stripe is not there.
    smooth_px : float
        Least standard deviation of the smoothing of steps in the direction of the cut.
    step_noise_px : float
        Steps are smoothed more where their standard error would be larger than this, up to twice `smooth_px`: what
        that takes from the treble the next rounds bring back.
    smooth_other_px : float
        The same for a direction that the cut does not use.
    largest_step_px : float
        In one round, before gain and momentum.
    gain, momentum : float
        While reading steps are so many times as long as scores ask for, and go on with so much of the step before.
        Not while learning: what has been learned from paths that hurry is worse.
    """

    power_limits: tuple[float, float] = (0.2, 4.0)
    least_support: float = 0.15
    smooth_px: float = 12.0
    step_noise_px: float = 0.08
    smooth_other_px: float = 200.0
    largest_step_px: float = 1.0
    gain: float = 1.3
    momentum: float = 0.3


def clear_columns(
    stretch: Stretch, number: int, stripe_row: FloatArray, visible: BoolArray, half_px: int, rules: Rules
) -> BoolArray:
    """Tell in which columns a stripe is there and can be seen whole, by enough frames and without burnt places."""
    clear = visible & stretch.usable & (stretch.support[number] >= rules.least_support)
    if clear.any() and stretch.burnt.any():
        clear &= _burnt_share(stretch.burnt, stripe_row, half_px) <= BURNT_SHARE
    return np.asarray(clear)


@numba.njit(cache=True, nogil=True)
def _burnt_share(burnt, stripe_row, half_px):  # type: ignore[no-untyped-def]
    """Share of the rows of a window that are burnt, column by column; beyond the picture its outermost row counts."""
    width, height = burnt.shape
    share = np.zeros(width)
    for x in range(width):
        middle = int(np.rint(stripe_row[x]))
        for row in range(middle - half_px, middle + half_px + 1):
            share[x] += burnt[x, min(max(row, 0), height - 1)]
    return share / (2 * half_px + 1)


def evidence(stretch: Stretch, model: Model, rules: Rules, *, judged: bool = True) -> Evidence:
    """Return what all stripes say about the present path of both walls, and whether that surprises, if it is to be judged."""
    width = stretch.columns.shape[0]
    score, information, surprise = np.zeros((2, width)), np.zeros((2, width)), np.zeros((2, 2))
    rows = model.layout.rows(stretch.displacement_px)
    visible = model.layout.visible(rows, half_px=model.half_px)
    seen = stretch.in_tone(model.tone)
    for number, statistics in enumerate(model.stripes):
        if statistics is None:
            continue
        wall = model.layout.wall[number]
        clear = clear_columns(stretch, number, rows[number], visible[number], model.half_px, rules)
        if not clear.any():
            continue
        heard = model.channels(seen.columns, rows[number], statistics.bank)
        weight = softened(clear & believable(statistics.bank.power(heard), limits=rules.power_limits))
        u = said(heard, weight, statistics.bank, band=model.band, length=model.length)
        u = (u - statistics.mean_score) * statistics.trust
        weight64 = weight.astype(np.float64)
        score[wall] += weight64 * u
        information[wall] += weight64 * statistics.trust * statistics.information
        if judged:
            power, columns = quiet_power(u[np.newaxis], weight64)
            surprise[wall] += power[0, 0], columns * statistics.trust**2 * statistics.score_power
    with np.errstate(invalid="ignore", divide="ignore"):
        return Evidence(score, information, surprise[:, 0] / surprise[:, 1])


def step(found: Evidence, cut: Cut, rules: Rules) -> FloatArray:
    """Return how far each wall should be moved, shape (2, column), pixels.

    What both walls say together moves the groove in the direction of its cut, what they say against each other in the
    other one, slowly. Where one wall is silent it goes along with the other.
    """
    smooth_px = _smoothing_px(found.information if cut == "stereo" else found.information.sum(axis=0), rules)
    if cut == "stereo":
        return np.stack([_smoothed(found.score[w], found.information[w], smooth_px, rules) for w in (INNER, OUTER)])
    sign = np.array([[1.0], [1.0]]) if cut == "lateral" else np.array([[-1.0], [1.0]])
    common = _smoothed((sign * found.score).sum(axis=0), found.information.sum(axis=0), smooth_px, rules)
    inner, outer = found.information
    total = inner + outer
    both = np.divide(inner * outer, total, out=np.zeros_like(total), where=total > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        each = np.where(found.information > 0, sign * found.score / found.information, 0.0)
    against = _smoothed(both * (each[OUTER] - each[INNER]) / 2, both, rules.smooth_other_px, rules)
    return np.asarray(sign * (common + np.array([[-1.0], [1.0]]) * against))


def settled(displacement_px: FloatArray, support: FloatArray, cut: Cut, rules: Rules) -> FloatArray:
    """Return coarse paths without the jitter of single walls: the difference that the cut does not use is smoothed.

    Parameters
    ----------
    displacement_px, support : float64 arrays, shape (2, column)
        From the coarse search, and how sharp each wall was found; the wall with the better support counts for more.
    """
    if cut == "stereo":
        return displacement_px
    sign = np.array([[1.0], [1.0]]) if cut == "lateral" else np.array([[-1.0], [1.0]])
    signed = sign * displacement_px
    weight = support**2 + 1e-4
    inner, outer = weight
    both = inner * outer / (inner + outer)
    apart = gaussian(both * (signed[OUTER] - signed[INNER]) / 2, rules.smooth_other_px)
    apart = apart / gaussian(both, rules.smooth_other_px)
    middle = (weight * (signed + np.array([[1.0], [-1.0]]) * apart)).sum(axis=0) / weight.sum(axis=0)
    return np.asarray(sign * (middle + np.array([[-1.0], [1.0]]) * apart))


def _smoothing_px(information: FloatArray, rules: Rules) -> float:
    """Standard deviation of a Gaussian after which steps have the noise that the rules allow: 1/(2√π σ I) = noise²."""
    usual = float(np.median(information[information > 0])) if (information > 0).any() else 0.0
    wanted = 1 / (2 * np.sqrt(np.pi) * max(usual, 1e-9) * rules.step_noise_px**2)
    return float(np.clip(wanted, rules.smooth_px, 2 * rules.smooth_px))


def gaussian(values: FloatArray, sigma: float) -> FloatArray:
    """Return rows smoothed by a Gaussian that is cut off at four σ; beyond the ends the last value is held.

    Parameters
    ----------
    values : float64 array, shape (…, column)
    sigma : float
        Columns.
    """
    radius, width = int(4 * sigma + 0.5), values.shape[-1]
    held = np.concatenate(
        [np.repeat(values[..., :1], radius, axis=-1), values, np.repeat(values[..., -1:], radius, axis=-1)], axis=-1
    )
    length = fft.next_fast_len(held.shape[-1], real=True)
    smooth = fft.irfft(fft.rfft(held, length) * _bell_spectrum(sigma, radius, length), length)
    return np.asarray(smooth[..., 2 * radius : 2 * radius + width])


@lru_cache(maxsize=64)
def _bell_spectrum(sigma: float, radius: int, length: int) -> npt.NDArray[np.complex128]:
    bell = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return np.asarray(fft.rfft(bell / bell.sum(), length))


def _smoothed(score: FloatArray, information: FloatArray, smooth_px: float, rules: Rules) -> FloatArray:
    most = float(information.max(initial=0.0))
    if most == 0:
        return np.zeros_like(score)
    top, bottom = gaussian(np.stack([score, information]), smooth_px)
    return np.asarray(np.clip(top / np.maximum(bottom, 0.05 * most), -rules.largest_step_px, rules.largest_step_px))


def read(stretch: Stretch, models: Sequence[Model], cut: Cut, rules: Rules) -> tuple[Stretch, Evidence]:
    """Return the stretch with its path improved by one round with each model, and the evidence about that path."""
    seen = stretch
    move: FloatArray = np.zeros(())
    for model in models:
        if seen.tone != model.tone:
            seen = replace(stretch, displacement_px=seen.displacement_px).in_tone(model.tone)
        # scores answer less to a path that is far off, and what was missing before is mostly missing still
        move = rules.gain * step(evidence(seen, model, rules, judged=False), cut, rules) + rules.momentum * move
        seen = seen.moved(move)
    return seen, evidence(seen, models[-1], rules)


def spaced(count: int, rounds: int) -> list[int]:
    """Return which of so many models to read by in so many rounds: evenly spaced, the last one among them."""
    return sorted(
        {-(-count * (k + 1) // rounds) - 1 for k in range(min(count, rounds))} if rounds < count else range(count)
    )
