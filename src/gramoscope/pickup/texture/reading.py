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
from functools import cached_property

import numba
import numpy as np

from gramoscope.cache_line import single_room
from gramoscope.conventions import INNER, OUTER, Float32Array, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.coarse_path import sign_of
from gramoscope.pickup.texture.filter_bank import FilterBank
from gramoscope.pickup.texture.following import channels, follow
from gramoscope.pickup.texture.hearing import Ear, Told, ear_of
from gramoscope.pickup.texture.lane_transform import PAIR, fast_length, plan_for, power_between, transform
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import QUIET_BAND, StripeStatistics
from gramoscope.pickup.texture.smoothing import smooth_both
from gramoscope.pickup.texture.spectrum import Band, filtered
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.tone import Tone


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

    @cached_property
    def ear(self) -> Ear:
        """The stripes that can be read, laid together."""
        return ear_of(
            self.stripes,
            self.layout.wall,
            self.whitener,
            half_px=self.half_px,
            band=self.band,
            length=self.length,
        )

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
        Columns with less of the texture, or more of anything, than so many times the usual are damaged.
    least_support : float
        Sharpness, of a typical sharp row, below which a stripe is not there.
    least_best_support : float
        Where no wall has that much, what is sharp may be anything, as the floor of a fracture that took both: neither is read.
    most_local_surprise : float
        Samples about which scores have more than so many times the power that they claim are not believed.
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
    least_best_support: float = 0.25
    most_local_surprise: float = 3.0
    smooth_px: float = 12.0
    step_noise_px: float = 0.08
    smooth_other_px: float = 200.0
    largest_step_px: float = 1.0
    gain: float = 1.3
    momentum: float = 0.3


UNJUDGED: FloatArray = np.full(2, np.nan)
"""The surprise of walls that nobody asks about, or nobody heard."""


def evidence(stretch: Stretch, model: Model, rules: Rules, *, judged: bool = True) -> Evidence:
    """Return what all stripes say about the present path of both walls, and whether that surprises, if it is to be judged."""
    ear, seen = model.ear, stretch.in_tone(model.tone)
    columns = seen.columns.shape[0]
    if not ear.number.size:
        return Evidence(np.zeros((2, columns)), np.zeros((2, columns)), UNJUDGED)
    require(columns <= ear.length, f"a stretch of {columns} columns", f"at most {ear.length}, as the passage taught")
    told = seen.device.told(ear, model.layout, seen, least_support=rules.least_support, power_limits=rules.power_limits)
    return Evidence(told.score, told.information, _surprise(ear, told) if judged else UNJUDGED)


def _surprise(ear: Ear, told: Told) -> FloatArray:
    plan = plan_for(fast_length(2 * told.said.shape[1]))
    low, high = (int(np.ceil(f * plan.length)) for f in QUIET_BAND)
    surprise = np.empty(2)
    _compare(told.said, told.weight, (plan.radix, plan.twiddle, plan.turn), (low, high), (ear.wall, ear.trust, ear.score_power), surprise)  # fmt: skip  # noqa: E501
    return surprise


@numba.njit(cache=True, nogil=True)
def _compare(said, weight, plan, band, learned, surprise):  # type: ignore[no-untyped-def]
    """Write the power of the scores of each wall where no sound is over what was learned, NaN of a wall that was not heard."""
    radix, twiddle, turn = plan
    wall, trust, score_power = learned
    m = len(turn) - 1
    lanes, one, other = single_room(m * PAIR).reshape(2 * m, LANES), single_room(m * PAIR), single_room(m * PAIR)
    lanes[:] = np.float32(0)
    found, usual = np.zeros(2), np.zeros(2)
    for first in range(0, wall.size, LANES):
        some = range(first, min(first + LANES, wall.size))
        for i in some:
            columns = 0.0
            for x in range(said.shape[1]):
                lanes[x, i - first] = said[i, x] * weight[i, x]
                columns += np.float64(weight[i, x]) * weight[i, x]
            usual[wall[i]] += columns * trust[i] ** 2 * score_power[i]
        where = transform(lanes.reshape(lanes.size), 0, radix, twiddle, one, other)
        for i in some:
            found[wall[i]] += power_between(one if where == 0 else other, turn, band, i - first)
    for side in range(2):
        surprise[side] = found[side] / usual[side] if usual[side] > 0 else np.nan


def step(found: Evidence, cut: Cut, rules: Rules) -> FloatArray:
    """Return how far each wall should be moved, shape (2, column), pixels.

    What both walls say together moves the groove in the direction of its cut, what they say against each other in the
    other one, slowly. Where one wall is silent it goes along with the other.
    """
    moved = np.empty(found.score.shape)
    _step(found.score, found.information, *_allowed(cut, rules), moved)
    return moved


def _allowed(cut: Cut, rules: Rules) -> tuple[bool, FloatArray, tuple[float, float, float], float]:
    """Whether both walls move together, by which signs, by what steps, and how smoothly against each other."""
    limits = (rules.smooth_px, rules.step_noise_px, rules.largest_step_px)
    return cut != "stereo", sign_of(cut), limits, rules.smooth_other_px


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _step(score, information, together, sign, limits, smooth_other_px, moved):  # type: ignore[no-untyped-def]
    """Write how far each wall should be moved; see `step`."""
    if together:
        _step_together(score, information, sign, limits, smooth_other_px, moved)
        return
    smooth_px = smoothing_px(information, limits)
    for wall in (INNER, OUTER):
        steps_of(score[wall], information[wall], smooth_px, limits[2], moved[wall])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def smoothing_px(information, limits):  # type: ignore[no-untyped-def]
    """Return the σ of a Gaussian after which steps have the noise that the rules allow: 1/(2√π σ I) = noise²."""
    least, noise, _ = limits
    total, count = 0.0, 0
    for value in information.flat:
        if value > 0:
            total += value
            count += 1
    usual = total / count if count else 0.0
    wanted = 1 / (2 * np.sqrt(np.pi) * max(usual, 1e-9) * noise * noise)
    return min(max(wanted, least), 2 * least)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def steps_of(score, information, smooth_px, largest, out):  # type: ignore[no-untyped-def]
    """Write smoothed score over smoothed information, none larger than allowed; 0 where nothing is known at all."""
    most = information.max()
    if most <= 0:
        out[:] = 0.0
        return
    bottom = np.empty_like(information)
    smooth_both(score, information, smooth_px, out, bottom)
    least = 0.05 * most
    for x in range(out.size):
        out[x] = min(max(out[x] / max(bottom[x], least), -largest), largest)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _step_together(score, information, sign, limits, smooth_other_px, moved):  # type: ignore[no-untyped-def]
    width = score.shape[1]
    inner, outer = information[INNER], information[OUTER]
    total, said = np.empty(width), np.empty(width)
    both, against = np.empty(width), np.empty(width)
    for x in range(width):
        one, other = sign[INNER] * score[INNER, x], sign[OUTER] * score[OUTER, x]
        total[x], said[x] = inner[x] + outer[x], one + other
        # without a branch, which would take them one by one
        known = (inner[x] > 0) & (outer[x] > 0)
        together = inner[x] * outer[x] / total[x]
        apart = together * (other / outer[x] - one / inner[x]) / 2
        both[x], against[x] = together if known else 0.0, apart if known else 0.0
    common, apart = np.empty(width), np.empty(width)
    steps_of(said, total, smoothing_px(total, limits), limits[2], common)
    steps_of(against, both, smooth_other_px, limits[2], apart)
    for x in range(width):
        moved[INNER, x] = sign[INNER] * (common[x] - apart[x])
        moved[OUTER, x] = sign[OUTER] * (common[x] + apart[x])


def read(stretch: Stretch, models: Sequence[Model], cut: Cut, rules: Rules) -> tuple[Stretch, Evidence]:
    """Return the stretch with its path improved by one round with each model, and the evidence about that path."""
    begun = seen = replace(stretch, displacement_px=stretch.displacement_px.copy())
    path = seen.displacement_px
    move = np.zeros(path.shape)
    for model in models:
        if seen.tone != model.tone:
            seen = begun.in_tone(model.tone)
        # scores answer less to a path that is far off, and what was missing before is mostly missing still
        found = evidence(seen, model, rules, judged=False)
        _go_on(found.score, found.information, *_allowed(cut, rules), rules.gain, rules.momentum, move, path)
    return seen, evidence(seen, models[-1], rules)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _go_on(score, information, together, sign, limits, smooth_other_px, gain, momentum, move, path):  # type: ignore
    """Move paths by a step and some of the move before."""
    asked = np.empty(path.shape)
    _step(score, information, together, sign, limits, smooth_other_px, asked)
    for wall in range(len(path)):
        for x in range(path.shape[1]):
            move[wall, x] = gain * asked[wall, x] + momentum * move[wall, x]
            path[wall, x] += move[wall, x]


def spaced(count: int, rounds: int) -> list[int]:
    """Return which of so many models to read by in so many rounds: evenly spaced, the last one among them."""
    return sorted(
        {-(-count * (k + 1) // rounds) - 1 for k in range(min(count, rounds))} if rounds < count else range(count)
    )
