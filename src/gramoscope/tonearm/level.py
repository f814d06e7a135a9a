"""How loud the groove is just here, told without any model, by how its course bends.

The level of a stretch is the standard deviation of (a(s + ℓ) − 2a(s) + a(s − ℓ))/ℓ, the change of slope over `BEND_M`, by the
median over the stretch and less what the readings' own errors bend. A prior that scales with it, stretch by stretch, is
neither deaf to a record that begins in silence nor nervous in its quiet passages; one level for many stretches lost the
groove at the first chord. The mean over five neighbours calms it, and announces an attack.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, repeat

import numpy as np

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.tonearm.groove_prior import BEND_M
from gramoscope.tonearm.stretches import Stretch

LEAST_SAMPLES = 20
"""A stretch with fewer tells nothing."""
NORMAL = 1.4826
"""Standard deviation of normal numbers whose absolute values have the median one."""
NEIGHBOURS = 2
"""So many stretches on each side take part in a level."""


@dataclass(frozen=True, eq=False)
class OneDirection:
    """One direction along one stretch: place and its variance, shape (sample,), NaN where unknown."""

    place_m: FloatArray
    variance: FloatArray
    step_m: float

    @property
    def known(self) -> int:
        """How many samples there are."""
        return int(np.count_nonzero(np.isfinite(self.place_m)))


def one_direction(stretch: Stretch, direction: Direction, gains: FloatArray) -> OneDirection:
    """Return what both walls together say of one direction.

    Parameters
    ----------
    stretch : Stretch
    direction : {"lateral", "vertical"}
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move outwards, in the picture, when the groove rises by one.

    Returns
    -------
    OneDirection
        Free of the other direction; NaN where not both walls were seen.
    """
    inner, outer = stretch.place_m
    weight = np.array([gains[OUTER], -gains[INNER]] if direction == "lateral" else [-1.0, 1.0])
    weight = weight / (gains[OUTER] - gains[INNER])
    return OneDirection(weight[INNER] * inner + weight[OUTER] * outer, weight**2 @ stretch.variance, stretch.step_m)


def one_wall(stretch: Stretch, direction: Direction, gains: FloatArray) -> OneDirection:
    """Return what the wall that was seen best says of one direction, if the groove does not move in the other."""
    best = int(np.argmax(np.isfinite(stretch.place_m).sum(axis=1)))
    gain = 1.0 if direction == "lateral" else gains[best]
    return OneDirection(stretch.place_m[best] / gain, stretch.variance[best] / gain**2, stretch.step_m)


def bend_power(one: OneDirection) -> float:
    """Return the variance of the bends of one stretch; below zero by chance when silent, NaN when hardly seen."""
    lag = max(int(np.rint(BEND_M / one.step_m)), 1)
    place, variance = one.place_m, one.variance
    bends = place[2 * lag :] - 2 * place[lag:-lag] + place[: -2 * lag]
    seen = np.isfinite(bends)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return float("nan")
    noise = np.median((variance[2 * lag :] + 4 * variance[lag:-lag] + variance[: -2 * lag])[seen])
    return float(((NORMAL * np.median(np.abs(bends[seen]))) ** 2 - noise) / (lag * one.step_m) ** 2)


def levels(powers: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Return the level of each stretch: the root of the mean of its own bend's power and its neighbours'.

    Parameters
    ----------
    powers : iterable of float64 arrays, shape (direction,)
        See `bend_power`; NaN where nothing is known.

    Yields
    ------
    float64 array, shape (direction,)
        Where nothing is known of all neighbours, what it was before; 0 in the beginning.
    """
    nothing = np.full(2, np.nan)
    window = deque(repeat(nothing, NEIGHBOURS), 2 * NEIGHBOURS + 1)
    level = np.zeros(2)
    for power in chain(powers, repeat(nothing, NEIGHBOURS)):
        window.append(power)
        if len(window) == 2 * NEIGHBOURS + 1:
            known = np.isfinite(window)
            mean = np.where(known, window, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
            level = np.where(known.any(axis=0), np.sqrt(np.maximum(mean, 0.0)), level)
            yield level
