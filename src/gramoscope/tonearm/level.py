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

from gramoscope.conventions import INNER, OUTER, FloatArray, IntArray
from gramoscope.disc.formats import Direction
from gramoscope.quantile import quantile
from gramoscope.tonearm.groove_prior import BEND_M

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
LIKE_A_MEAN_OF = 5
"""So many neighbours have a mean with about the errors of the median of seven, whether they are alike or not."""
EIGHTH_DIFFERENCE = np.array([1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0])
ENOUGH = 1500
"""For each sample of a block so many differences must be known: they overlap, and fewer would be off by more than 3 %."""
SOUND_GROWS = 1.25
"""Errors that a block of one sample more hears so many times as large are sound. Errors of readings grow by 0.93 … 1.19; a
groove whose slope falls by only 6 dB an octave up to 40 kHz, by 1.47."""
AT_LEAST = 0.25
"""Of the power of what bends so much is sound, where neighbours share errors: such claims cannot be put right (`claim_error`),
and a prior that takes sound for silence loses it, while one that takes silence for sound hardly loses anything."""
NEIGHBOURS = 2
"""So many stretches on each side take part in a level."""


@dataclass(frozen=True, eq=False)
class OneDirection:
    """One direction along stretches: place and its variance, shape (stretch, sample), NaN where unknown."""

    place_m: FloatArray
    variance: FloatArray


def one_direction(
    place_m: FloatArray,
    variance: FloatArray,
    direction: Direction,
    gains: FloatArray,
    *,
    listening: bool,
    size: IntArray | None = None,
) -> OneDirection:
    """Return what both walls together say of one direction.

    Parameters
    ----------
    place_m, variance : float64 arrays, shape (stretch, 2, sample)
        NaN where unknown.
    direction : {"lateral", "vertical"}
    gains : float64 array, shape (2,)
        How far the inner and the outer wall move towards +l when the groove rises by one.
    listening : bool
        If hardly ever both walls were seen, the one that was seen better is taken as if the groove moved in this
        direction only.
    size : int64 array, shape (stretch,), optional
        Of each stretch only so many samples are its own; all if left out.

    Returns
    -------
    OneDirection
        Free of the other direction; NaN where not both walls were seen.
    """
    place, error = np.empty((2, len(place_m), place_m.shape[2]))
    own = np.full(len(place_m), place_m.shape[2]) if size is None else size
    _of_each(place_m, variance, direction == "lateral", gains, listening, own, place, error)
    return OneDirection(place, error)


@numba.njit(cache=True, nogil=True)
def _of_each(place_m, variance, lateral, gains, listening, size, out, error):  # type: ignore[no-untyped-def]
    for i in range(len(place_m)):
        _one_direction(place_m[i], variance[i], lateral, gains, listening, size[i], out[i], error[i])


@numba.njit(cache=True, nogil=True)
def _one_direction(place_m, variance, lateral, gains, listening, own, out, error):  # type: ignore[no-untyped-def]
    size, both = place_m.shape[1], 0
    seen = np.zeros(2, np.int64)
    for k in range(size):
        inner, outer = np.isfinite(place_m[INNER, k]), np.isfinite(place_m[OUTER, k])
        seen[INNER] += inner
        seen[OUTER] += outer
        both += inner and outer
    apart = gains[OUTER] - gains[INNER]
    weight = np.empty(2)
    if listening and both < BOTH_WALLS * own:
        best = np.argmax(seen)
        gain = 1.0 if lateral else gains[best]
        for k in range(size):
            out[k], error[k] = place_m[best, k] / gain, variance[best, k] / gain**2
        return
    weight[INNER], weight[OUTER] = (gains[OUTER] / apart, -gains[INNER] / apart) if lateral else (-1 / apart, 1 / apart)
    for k in range(size):
        out[k] = weight[0] * place_m[0, k] + weight[1] * place_m[1, k]
        error[k] = weight[0] ** 2 * variance[0, k] + weight[1] ** 2 * variance[1, k]


def likeness(apart: IntArray, correlation_samples: float) -> FloatArray:
    """Return how alike errors of readings are that lie so many samples apart, 0 … 1.

    1 for the same reading, and nothing beyond where errors are independent (`correlation_samples` of 1). Else a Gaussian, as of
    readings that were averaged over their neighbours; its sum over all distances is `correlation_samples`.
    """
    if correlation_samples <= 1:
        return np.asarray(apart == 0, np.float64)
    return np.asarray(np.exp(-np.pi * (apart / correlation_samples) ** 2))


def bend_noise(lag: int, correlation_samples: float) -> float:
    """Return what is taken off the variance of a bend of running medians, for each unit of that of independent readings.

    As much as errors bend that neighbours share, but no more than medians of independent ones would: over lags at which
    shared errors bend more, claims come out a twentieth too small if that is taken off, and nothing else is better.

    Parameters
    ----------
    lag : int
        Samples over which the bend is taken.
    correlation_samples : float
        See `likeness`.
    """
    if correlation_samples <= 1:
        return MEDIAN_VARIANCE
    second = np.zeros(2 * lag + 1)
    second[[0, lag, -1]] = 1.0, -2.0, 1.0
    weight = np.convolve(second, np.full(LIKE_A_MEAN_OF, 1 / LIKE_A_MEAN_OF))
    apart = np.arange(1 - weight.size, weight.size)
    bent = float(np.correlate(weight, weight, "full") @ likeness(apart, correlation_samples))
    return min(bent / float(second @ second), MEDIAN_VARIANCE)


def bend_powers(
    middle_m: FloatArray,
    variance: FloatArray,
    gains: FloatArray,
    *,
    listened: Direction,
    step_m: float,
    correlation_samples: float,
) -> FloatArray:
    """Return the variances of the bends of one stretch in both directions, lateral first.

    Parameters
    ----------
    middle_m : float64 array, shape (2, sample)
        Running medians of the places of both walls (`stretches.running_median`), which outliers hardly move; NaN where unknown.
    variance : float64 array, shape (2, sample)
        Of the places themselves.
    gains : float64 array, shape (2,)
        See `one_direction`.
    listened : {"lateral", "vertical"}
        The direction that is listened to.
    step_m : float
        From one sample to the next.
    correlation_samples : float
        How many neighbours share one error.

    Returns
    -------
    float64 array, shape (2,)
        Below zero by chance when silent, but for errors that neighbours share (`AT_LEAST`); NaN when hardly seen.
    """
    lag = max(int(np.rint(BEND_M / step_m)), 1)
    noise = bend_noise(lag, correlation_samples) * variance
    at_least = AT_LEAST if correlation_samples > 1 else 0.0
    power: FloatArray = _bend_powers(middle_m, noise, gains, listened == "lateral", lag, at_least)
    return power / (lag * step_m) ** 2


@numba.njit(cache=True, nogil=True)
def _bend_powers(place_m, variance, gains, laterally, lag, at_least):  # type: ignore[no-untyped-def]
    power, place, error = np.empty(2), np.empty(place_m.shape[1]), np.empty(place_m.shape[1])
    for direction in range(2):
        _one_direction(
            place_m, variance, direction == 0, gains, (direction == 0) == laterally, place.size, place, error
        )
        power[direction] = bend_power(place, error, lag, at_least)
    return power


@numba.njit(cache=True, nogil=True)
def bend_power(place_m, variance, lag, at_least=0.0):  # type: ignore[no-untyped-def]
    """Return the variance of second differences over a lag, without what errors make of them; this share of it at least."""
    bends, noise = np.empty(place_m.size), np.empty(place_m.size)
    seen = 0
    for i in range(lag, place_m.size - lag):
        bends[seen] = abs(place_m[i + lag] - 2 * place_m[i] + place_m[i - lag])
        noise[seen] = variance[i + lag] + 4 * variance[i] + variance[i - lag]
        if np.isfinite(bends[seen]) and np.isfinite(noise[seen]):
            seen += 1
    if seen < LEAST_SAMPLES:
        return np.nan
    bent = (NORMAL * quantile(bends[:seen], 0.5)) ** 2
    power = bent - quantile(noise[:seen], 0.5)
    return max(power, at_least * bent) if at_least > 0 else power


def slope_power(one: OneDirection, correlation_samples: FloatArray, step_m: float) -> FloatArray:
    """Return the mean square of the slopes of each stretch over `BEND_M`; NaN where hardly anything was seen.

    Below zero by chance when silent, but for errors that neighbours share (`AT_LEAST`).
    """
    lag = max(int(np.rint(BEND_M / step_m)), 1)
    moved = one.place_m[:, lag:] - one.place_m[:, :-lag]
    alike = np.array([likeness(np.array(lag), shared) for shared in correlation_samples])
    noise = (one.variance[:, lag:] + one.variance[:, :-lag]) * (1 - alike[:, None])
    seen = np.isfinite(moved) & np.isfinite(noise)
    known = np.count_nonzero(seen, axis=1)
    power, moving = (
        np.where(seen, each, 0.0).sum(axis=1) / np.maximum(known, 1) for each in (moved**2 - noise, moved**2)
    )
    power = np.where(correlation_samples > 1, np.maximum(power, AT_LEAST * moving), power)
    return np.where(known < LEAST_SAMPLES, np.nan, power / (lag * step_m) ** 2)


def claim_error(place_m: FloatArray, variance: FloatArray, longest: int) -> float:
    """Return how many times as large as they claim the errors of places are, just above the frequencies of sound.

    By the eighth differences of means over blocks of neighbours, over what the claimed errors would make of them: they hear
    best what lasts twice as long as a block, and of what lasts four times as long 1/256. The error within which 68 of 100 lie
    does not see outliers. Neighbours' errors are a little alike, so single samples would claim less than sound has to bear,
    and blocks are as long as may be; but where a longer block hears much more, that is sound (`SOUND_GROWS`). A likelihood that
    learned this beside the groove's spectrum took treble for noise and noise for treble.

    Parameters
    ----------
    place_m, variance : float64 arrays, shape (stretch, 2, sample)
        NaN where unknown.
    longest : int
        Samples of the longest block, at least one.

    Returns
    -------
    float
        Within 0.5 … 3; 1 where hardly anything was seen.
    """
    error = 1.0
    for block in range(1, longest + 1):
        known = _eighth_differences(place_m, variance, block)
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
    stretches, walls, size = place_m.shape
    span = block * EIGHTH_DIFFERENCE.size
    off = np.empty(stretches * walls * max(size - span + 1, 0))
    place_sum, variance_sum = np.empty(size), np.empty(size)
    known = 0
    for i in range(stretches):
        for wall in range(walls):
            for first in range(size - block + 1):
                place_sum[first], variance_sum[first] = 0.0, 0.0
                for k in range(first, first + block):
                    place_sum[first] += place_m[i, wall, k]
                    variance_sum[first] += variance[i, wall, k]
            for first in range(size - span + 1):
                difference, claimed = 0.0, 0.0
                for j in range(EIGHTH_DIFFERENCE.size):
                    difference += EIGHTH_DIFFERENCE[j] * place_sum[first + j * block]
                    claimed += EIGHTH_DIFFERENCE[j] ** 2 * variance_sum[first + j * block]
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
            level = _level(np.array(window), level)
            yield level


@numba.njit(cache=True, nogil=True)
def _level(powers, before):  # type: ignore[no-untyped-def]
    """Return the root of the mean of what is known, or what it was before."""
    level = before.copy()
    for direction in range(level.size):
        total, known = 0.0, 0
        for power in powers[:, direction]:
            if np.isfinite(power):
                total += power
                known += 1
        if known > 0:
            level[direction] = np.sqrt(max(total / known, 0.0))
    return level
