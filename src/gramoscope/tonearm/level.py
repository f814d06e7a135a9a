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

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.quantile import quantile
from gramoscope.tonearm.groove_prior import BEND_M
from gramoscope.tonearm.stretches import Stretch

LEAST_SAMPLES = 20
"""A stretch with fewer tells nothing."""
NORMAL = 1.4826
"""Standard deviation of normal numbers whose absolute values have the median one."""
WITHIN_SIGMA = 0.6827
"""Share of normal numbers within one standard deviation."""
BOTH_WALLS = 0.1
"""A stretch that shows both walls over less than this share is read by its best wall alone."""
MEDIAN_VARIANCE = 0.21
"""Variance of the median of seven normal numbers, for each unit of theirs."""
EIGHTH_DIFFERENCE = np.array([1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0])
ENOUGH = 1500
"""For each sample of a block so many differences must be known: they overlap, and fewer would be off by more than 3 %."""
SOUND_GROWS = 1.25
"""Errors that a block of one sample more hears so many times as large are sound. Errors of readings grow by 0.93 … 1.19; a
groove whose slope falls by only 6 dB an octave up to 40 kHz, by 1.47."""
NEIGHBOURS = 2
"""So many stretches on each side take part in a level."""


@dataclass(frozen=True, eq=False)
class Walls:
    """Place and variance of both walls, shape (2, sample), NaN where unknown."""

    place_m: FloatArray
    variance: FloatArray


@dataclass(frozen=True, eq=False)
class OneDirection:
    """One direction along one stretch: place and its variance, shape (sample,), NaN where unknown."""

    place_m: FloatArray
    variance: FloatArray

    @property
    def known(self) -> int:
        """How many samples there are."""
        return int(np.count_nonzero(np.isfinite(self.place_m)))


def trusted(stretch: Stretch) -> Walls:
    """Return the samples of a stretch that are not suspect."""
    return Walls(np.where(stretch.suspect, np.nan, stretch.place_m), stretch.variance)


def calmed(stretch: Stretch) -> Walls:
    """Return the running medians of a stretch, which outliers hardly move."""
    return Walls(stretch.middle_m, MEDIAN_VARIANCE * stretch.variance)


def one_direction(walls: Walls, direction: Direction, gains: FloatArray, *, listening: bool) -> OneDirection:
    """Return what both walls together say of one direction.

    Parameters
    ----------
    walls : Walls
    direction : {"lateral", "vertical"}
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move towards +l when the groove rises by one.
    listening : bool
        If hardly ever both walls were seen, the one that was seen better is taken as if the groove moved in this
        direction only.

    Returns
    -------
    OneDirection
        Free of the other direction; NaN where not both walls were seen.
    """
    seen = np.isfinite(walls.place_m)
    if listening and np.count_nonzero(seen.all(axis=0)) < BOTH_WALLS * seen.shape[1]:
        best = int(np.argmax(seen.sum(axis=1)))
        gain = 1.0 if direction == "lateral" else gains[best]
        return OneDirection(walls.place_m[best] / gain, walls.variance[best] / gain**2)
    weight = np.array([gains[OUTER], -gains[INNER]] if direction == "lateral" else [-1.0, 1.0])
    weight = weight / (gains[OUTER] - gains[INNER])
    return OneDirection(weight @ walls.place_m, weight**2 @ walls.variance)


def bend_power(one: OneDirection, step_m: float) -> float:
    """Return the variance of the bends of one stretch; below zero by chance when silent, NaN when hardly seen."""
    lag = max(int(np.rint(BEND_M / step_m)), 1)
    return float(_bend_power(one.place_m, one.variance, lag) / (lag * step_m) ** 2)


@numba.njit(cache=True, nogil=True)
def _bend_power(place_m, variance, lag):  # type: ignore[no-untyped-def]
    bends, noise = np.empty(place_m.size), np.empty(place_m.size)
    seen = 0
    for i in range(lag, place_m.size - lag):
        bends[seen] = abs(place_m[i + lag] - 2 * place_m[i] + place_m[i - lag])
        noise[seen] = variance[i + lag] + 4 * variance[i] + variance[i - lag]
        if np.isfinite(bends[seen]) and np.isfinite(noise[seen]):
            seen += 1
    if seen < LEAST_SAMPLES:
        return np.nan
    return (NORMAL * quantile(bends[:seen], 0.5)) ** 2 - quantile(noise[:seen], 0.5)


def slope_power(one: OneDirection, step_m: float) -> float:
    """Return the mean square of the slopes of one stretch over `BEND_M`; below zero by chance when silent, or NaN."""
    lag = max(int(np.rint(BEND_M / step_m)), 1)
    moved = one.place_m[lag:] - one.place_m[:-lag]
    noise = one.variance[lag:] + one.variance[:-lag]
    seen = np.isfinite(moved) & np.isfinite(noise)
    if np.count_nonzero(seen) < LEAST_SAMPLES:
        return float("nan")
    return float((np.mean(moved[seen] ** 2) - np.mean(noise[seen])) / (lag * step_m) ** 2)


def claim_error(walls: Iterable[Walls], longest: int) -> float:
    """Return how many times as large as they claim the errors of places are, just above the frequencies of sound.

    By the eighth differences of means over blocks of neighbours, over what the claimed errors would make of them: they hear
    best what lasts twice as long as a block, and of what lasts four times as long 1/256. The error within which 68 of 100 lie
    does not see outliers. Neighbours' errors are a little alike, so single samples would claim less than sound has to bear,
    and blocks are as long as may be; but where a longer block hears much more, that is sound (`SOUND_GROWS`). A likelihood that
    learned this beside the groove's spectrum took treble for noise and noise for treble.

    Parameters
    ----------
    walls : iterable of Walls
    longest : int
        Samples of the longest block, at least one.

    Returns
    -------
    float
        Within 0.5 … 3; 1 where hardly anything was seen.
    """
    seen, error = list(walls), 1.0
    for block in range(1, longest + 1):
        off = [_eighth_differences(one.place_m, one.variance, block) for one in seen]
        known = np.concatenate(off) if off else np.empty(0)
        if known.size < ENOUGH * block:
            break
        longer = float(quantile(known, WITHIN_SIGMA))
        if block > 1 and longer > SOUND_GROWS * error:
            break
        error = longer
    return float(np.clip(error, 0.5, 3.0))


@numba.njit(cache=True, nogil=True)
def _eighth_differences(place_m, variance, block):  # type: ignore[no-untyped-def]
    """Sizes of the differences between means over blocks in units of what the claimed errors make of them, where known."""
    span = block * EIGHTH_DIFFERENCE.size
    off = np.empty(2 * max(place_m.shape[1] - span + 1, 0))
    known = 0
    for wall in range(2):
        for first in range(place_m.shape[1] - span + 1):
            difference, claimed = 0.0, 0.0
            for j in range(EIGHTH_DIFFERENCE.size):
                place_sum, variance_sum = 0.0, 0.0
                for k in range(first + j * block, first + (j + 1) * block):
                    place_sum += place_m[wall, k]
                    variance_sum += variance[wall, k]
                difference += EIGHTH_DIFFERENCE[j] * place_sum
                claimed += EIGHTH_DIFFERENCE[j] ** 2 * variance_sum
            if np.isfinite(difference) and claimed > 0:
                off[known] = abs(difference) / np.sqrt(claimed)
                known += 1
    return off[:known]


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
