"""Learning from many stretches what the spectrum of the groove is like: the prior under which what was seen is most likely.

Where the groove is well seen the prior matters only above the frequency at which the readings drown, and for the error bars;
there it needs many samples, for what it is to find is hidden in their noise. What was believed before therefore counts as if
it had been measured to `DRIFT`, in natural logarithms, by the time of the next learning. How loud each stretch is, is not
learned but given (`tonearm.level`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from scipy import optimize

from gramoscope.conventions import FloatArray
from gramoscope.tonearm.groove_prior import GroovePrior, bend, process, steps
from gramoscope.tonearm.level import LEAST_SAMPLES, OneDirection, slope_power
from gramoscope.tonearm.place_likelihood import PlaceReadings, abreast, place_log_likelihood

GATE = 4.0
"""Samples further than this many standard errors from their prediction count as if they lay right there."""
DRIFT = np.array([0.7, 0.35, 0.25, 0.5, 0.35])
"""How much λ, μ, ν, the wide share and the share are expected to change from one learning to the next, e-folds."""
UNHEARD = np.array([np.inf, np.inf, 0.225, 0.6, np.inf])
"""How well they are known before anything was learned, e-folds: nothing of the body, something of what is wide."""
WIDE_SHARES = (1e-3, 0.3)
"""Least and largest √(var v / var u)."""
USUAL_WIDE_SHARE = 0.02
"""− 34 dB. Where what is wide drowns, only this is known of it. Recordings of speech, song, piano and orchestra, where they
were heard well enough, had 0.02 … 0.1."""
SHARES = (0.3, 10.0)
"""Least and largest bend, for each unit of the level."""
SLOPE_SIGMA = 0.05
"""By how much the rms of the slopes may be off, e-folds: firm, for the likelihood has thousands of samples to argue with."""
ANYWHERE_M = 1e-4
"""How little is known of the place at which a stretch begins, once its first sample is taken off."""


@dataclass(frozen=True)
class PriorLimits:
    """What a prior may be.

    Parameters
    ----------
    floor : float
        What a groove bends at the least.
    corner_per_m, cutoff_per_m, width_per_m : (float, float)
        Least and largest.
    usual_width_per_m : float
        Expected before anything was heard.
    """

    floor: float
    corner_per_m: tuple[float, float]
    cutoff_per_m: tuple[float, float]
    width_per_m: tuple[float, float]
    usual_width_per_m: float

    @property
    def logarithms(self) -> FloatArray:
        """Of least and largest, shape (5, 2)."""
        return np.log([self.corner_per_m, self.cutoff_per_m, self.width_per_m, WIDE_SHARES, SHARES])

    @property
    def middle(self) -> GroovePrior:
        """What is believed when nothing can be learned."""
        corner, cutoff = self.logarithms[:2].mean(axis=1)
        return _prior(np.array([corner, cutoff, np.log(self.usual_width_per_m), np.log(USUAL_WIDE_SHARE), 0.0]), self)


@dataclass(frozen=True, eq=False)
class Lessons:
    """What some stretches teach of one direction: readings, how loud each is, and the mean square of its slopes.

    Readings are means over blocks of `step_m`.
    """

    step_m: float
    readings: PlaceReadings
    level: FloatArray
    slope_power: FloatArray


def lessons(
    seen: OneDirection, level: FloatArray, correlation_samples: FloatArray, step_m: float, *, block: int = 1
) -> Lessons | None:
    """Return what all stretches teach together; None when all were hardly seen.

    Parameters
    ----------
    seen : OneDirection
    level : float64 array, shape (stretch,)
        How loud each is.
    correlation_samples : float64 array, shape (stretch,)
        How many neighbours share one error (`WallTrace`). To what is slower than that such readings are like independent
        ones of so many times the variance.
    step_m : float
        From one sample to the next.
    block : int
        So many neighbours are taken for one reading, where all of them are known: as good for what changes slowly, and
        learned from in so many times less time.
    """
    count = seen.place_m.shape[1] // block
    place, variance = (values[:, : count * block].reshape(-1, count, block) for values in (seen.place_m, seen.variance))
    means, errors = place.mean(axis=2), variance.sum(axis=2) / block**2
    known = np.isfinite(means)
    enough = block * np.count_nonzero(known, axis=1) >= LEAST_SAMPLES
    if not enough.any():
        return None
    means, errors, first = means[enough], errors[enough], known[enough].argmax(axis=1)
    counted_from_the_first = means - np.take_along_axis(means, first[:, None], axis=1)
    readings = abreast(counted_from_the_first, correlation_samples[enough, None] * errors)
    power = slope_power(OneDirection(seen.place_m[enough], seen.variance[enough]), correlation_samples[enough], step_m)
    return Lessons(block * step_m, readings, level[enough], power)


def learn(given: Lessons | None, limits: PriorLimits, *, before: GroovePrior | None = None) -> GroovePrior:
    """Return the prior under which the stretches are most likely.

    Parameters
    ----------
    given : Lessons or None
    limits : PriorLimits
    before : GroovePrior, optional
        What was believed so far.

    Returns
    -------
    GroovePrior
        By bounded Nelder–Mead over the logarithms of all five, begun twice where nothing was believed so far; `before`,
        or the middle of the limits, when there are no lessons.
    """
    if given is None:
        return before or limits.middle
    heard, bounds = np.isfinite(given.slope_power), limits.logarithms.T
    power = float(np.mean(given.slope_power[heard])) if heard.any() else 0.0
    known, first, step = (
        _logarithms(before or limits.middle),
        _logarithms(limits.middle),
        np.array([1.0, -0.7, 0.4, 1.0, 0.4]),
    )

    drift = DRIFT if before else UNHEARD
    readings = given.readings.seen, given.readings.count

    def cost(logarithms: FloatArray) -> float:
        inside = np.clip(logarithms, *bounds)
        away = (logarithms - known) / drift
        believed = 0.5 * float(away @ away)
        return believed + float(_cost(inside, limits.floor, given.step_m, given.level, heard, power, *readings))

    # what was learned in silence can be so far off that nothing leads away from it
    if before and cost(known) <= cost(first):
        first, step = known, 0.4 * step
    found = _least(cost, first, step, limits.logarithms, 100 if before else 250)
    if before is None:
        # a flat valley is taken for its bottom; looked at afresh it leads on, and what is wide is known better by two units
        found = _least(cost, found, 0.25 * step, limits.logarithms, 250)
    return _prior(found, limits)


@numba.njit(cache=True, nogil=True)
def _cost(logarithms, floor, step_m, level, heard, power, seen, count):  # type: ignore[no-untyped-def]
    """How unlikely the readings are, and how loud they, under a prior; of what was believed before only their part."""
    values = np.exp(logarithms)
    shape = (values[0], values[1], values[2], values[3])
    # the slopes of each stretch, of their bodies
    sigma = np.maximum(values[4] * level, floor) / bend(shape, step_m)
    a, q = steps(shape, step_m)
    likely = place_log_likelihood(a, q, process(shape, step_m)[2], seen, count, sigma, ANYWHERE_M, GATE)
    return 0.5 * _louder(sigma[heard], power) ** 2 - likely


@numba.njit(cache=True, nogil=True)
def _louder(sigma, power):  # type: ignore[no-untyped-def]
    """How many standard errors louder the prior believes the groove to be than the power of its slopes is.

    The likelihood knows the spectrum best where it meets the noise; extrapolated to the bass from there, it would fill gaps
    with thunder.
    """
    if power <= 0:
        return 0.0
    return 0.5 * np.log(np.sum(sigma**2) / sigma.size / power) / SLOPE_SIGMA


def _least(
    cost: Callable[[FloatArray], float], first: FloatArray, step: FloatArray, bounds: FloatArray, looks: int
) -> FloatArray:
    inside = np.clip(first, *bounds.T)
    there = inside + step
    step = np.where((there < bounds[:, 0]) | (there > bounds[:, 1]), -step, step)
    simplex = inside + np.vstack([np.zeros(step.size), np.diag(step)])
    options: Any = {"xatol": 0.1, "fatol": 0.3, "maxfev": looks, "initial_simplex": np.clip(simplex, *bounds.T)}
    found = optimize.minimize(cost, inside, method="Nelder-Mead", bounds=optimize.Bounds(*bounds.T), options=options)
    return np.asarray(found.x)


def _logarithms(prior: GroovePrior) -> FloatArray:
    return np.log([prior.corner_per_m, prior.cutoff_per_m, prior.width_per_m, prior.wide_share, prior.share])


def _prior(logarithms: FloatArray, limits: PriorLimits) -> GroovePrior:
    corner, cutoff, width, wide_share, share = np.exp(np.clip(logarithms, *limits.logarithms.T)).tolist()
    return GroovePrior(corner, cutoff, width, wide_share, share, limits.floor)
