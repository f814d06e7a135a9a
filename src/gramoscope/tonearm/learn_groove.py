"""Learning from a few stretches what to believe of the groove: the prior under which what was seen is most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.tonearm.groove_prior import GroovePrior, taylor
from gramoscope.tonearm.linear_gaussian import Moves, Readings, forward
from gramoscope.tonearm.stretches import Stretch

LEAST_SAMPLES = 20
"""A stretch with fewer teaches nothing."""
GATE = 4.0
"""Samples further than this many standard errors from their prediction count as if they lay right there."""
ANYWHERE_M = 1e-4
"""How little is known of the place at which a stretch begins, once its first sample is taken off."""


@dataclass(frozen=True)
class PriorLimits:
    """What a prior may be.

    Parameters
    ----------
    sigma, corner_per_m, cutoff_per_m : (float, float)
        Least and largest.
    """

    sigma: tuple[float, float]
    corner_per_m: tuple[float, float]
    cutoff_per_m: tuple[float, float]

    @property
    def logarithms(self) -> FloatArray:
        """Of least and largest, shape (3, 2)."""
        return np.log([self.sigma, self.corner_per_m, self.cutoff_per_m])

    @property
    def middle(self) -> GroovePrior:
        """What is believed when nothing can be learned."""
        return _prior(np.array([self.logarithms[0, 0] + 1.0, *self.logarithms[1:].mean(axis=1)]), self)


@dataclass(frozen=True, eq=False)
class Course1D:
    """One direction along one stretch: place and its variance, shape (sample,); NaN where unknown."""

    place_m: FloatArray
    variance: FloatArray

    @property
    def known(self) -> int:
        """How many samples there are."""
        return int(np.count_nonzero(np.isfinite(self.place_m)))


def one_direction(stretch: Stretch, direction: Direction, gains: FloatArray) -> Course1D:
    """Return what both walls together say of one direction.

    Parameters
    ----------
    stretch : Stretch
    direction : {"lateral", "vertical"}
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move outwards, in the picture, when the groove rises by one.

    Returns
    -------
    Course1D
        Free of the other direction; NaN where not both walls were seen.
    """
    inner, outer = stretch.place_m
    weight = np.array([gains[OUTER], -gains[INNER]] if direction == "lateral" else [-1.0, 1.0])
    weight = weight / (gains[OUTER] - gains[INNER])
    return Course1D(weight[INNER] * inner + weight[OUTER] * outer, weight**2 @ stretch.variance)


def one_wall(stretch: Stretch, direction: Direction, gains: FloatArray) -> Course1D:
    """Return what the wall that was seen best says of one direction, if the groove does not move in the other."""
    best = int(np.argmax(np.isfinite(stretch.place_m).sum(axis=1)))
    gain = 1.0 if direction == "lateral" else gains[best]
    return Course1D(stretch.place_m[best] / gain, stretch.variance[best] / gain**2)


def learn(
    courses: Sequence[Course1D], step_m: float, limits: PriorLimits, *, start: GroovePrior | None = None
) -> GroovePrior:
    """Return the prior under which the stretches are most likely.

    Parameters
    ----------
    courses : sequence of Course1D
    step_m : float
        From one sample to the next.
    limits : PriorLimits
    start : GroovePrior, optional
        Where to begin the search; from the data's own spread if left out.

    Returns
    -------
    GroovePrior
        By bounded Nelder–Mead over the logarithms of σ, λ and μ; `start`, or the middle of the limits, where hardly
        anything was seen.
    """
    useful = [_readings(course) for course in courses if course.known >= LEAST_SAMPLES]
    if not useful:
        return start or limits.middle
    bounds = limits.logarithms

    def cost(logarithms: FloatArray) -> float:
        return -_log_likelihood(useful, step_m, _prior(logarithms, limits))

    first = _logarithms(start) if start else _guess(useful, step_m, limits)
    step = np.array([0.5, 0.5, 0.25]) if start else np.array([1.0, 1.0, 0.7])
    inside = np.clip(first, bounds[:, 0], bounds[:, 1])
    step = np.where(inside + step > bounds[:, 1], -step, step)
    found = optimize.minimize(
        cost,
        inside,
        method="Nelder-Mead",
        bounds=list(map(tuple, bounds)),
        options={
            "xatol": 0.1,
            "fatol": 0.5,
            "maxfev": 60,
            "initial_simplex": inside + np.vstack([0 * step, np.diag(step)]),
        },
    )
    return _prior(found.x, limits)


def _readings(course: Course1D) -> Readings:
    known = np.flatnonzero(np.isfinite(course.place_m))
    place = course.place_m[known]
    variance = course.variance[known]
    h = np.repeat(taylor(np.zeros(1)), known.size, axis=0)
    return Readings(known - known[0], h, place - place[0], variance, variance)


def _log_likelihood(stretches: Sequence[Readings], step_m: float, prior: GroovePrior) -> float:
    a, q = prior.steps(step_m)
    covariance = prior.rest(step_m, place_sigma_m=ANYWHERE_M)
    total = 0.0
    for readings in stretches:
        moves = Moves(a[None, None], q[None, None], np.zeros(int(readings.bin[-1]) + 1, np.int64))
        total += forward(moves, readings, mean=np.zeros(a.shape[0]), covariance=covariance, gate=GATE).log_likelihood
    return total


def _guess(stretches: Sequence[Readings], step_m: float, limits: PriorLimits) -> FloatArray:
    """By how far the place moves over a twentieth of a millimetre, on the median."""
    lag = max(int(np.rint(5e-5 / step_m)), 1)
    moved = np.concatenate([r.value[lag:] - r.value[:-lag] for r in stretches])
    apart = np.concatenate([r.bin[lag:] - r.bin[:-lag] for r in stretches]) * step_m
    slope = 1.5 * float(np.median(np.abs(moved / apart))) if moved.size else 0.0
    corner, cutoff = limits.logarithms[1:]
    return np.array([np.log(max(slope, limits.sigma[0])), corner @ [0.6, 0.4], cutoff @ [0.5, 0.5]])


def _logarithms(prior: GroovePrior) -> FloatArray:
    return np.log([prior.sigma, prior.corner_per_m, prior.cutoff_per_m])


def _prior(logarithms: FloatArray, limits: PriorLimits) -> GroovePrior:
    sigma, corner, cutoff = np.exp(np.clip(logarithms, *limits.logarithms.T))
    return GroovePrior(float(sigma), float(corner), float(cutoff))
