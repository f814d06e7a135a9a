"""What a reading comes to: the place of each wall and its standard error, one sample for every few columns."""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.pickup.texture.reading import Evidence, Rules
from gramoscope.pickup.texture.smoothing import blur, half_bell
from gramoscope.pickup.texture.stretch import Stretch

STRIDE_PX = 8
"""Columns whose evidence makes one sample."""
SURPRISE_LIMITS = (0.7, 9.0)
"""A stretch whose scores are weaker or stronger than what was learned has its error bars changed by the root of it."""


def samples_of(stretch: Stretch, found: Evidence, rules: Rules) -> tuple[FloatArray, FloatArray]:
    """Return place and standard error of each wall, one sample for every 8 columns.

    A path settles where its scores are zero but for their noise. Where they are not, over a few samples, something drew it
    aside that is no wall (a scratch across both, say), and what the scores still ask for is not enough to put it right.

    Returns
    -------
    place_px, sigma_px : float64 arrays, shape (2, sample)
        Displacement from rest; NaN where nothing was read, or is not to be believed.
    """
    place, sigma = np.empty((2, 2, stretch.displacement_px.shape[1] // STRIDE_PX))
    told = found.score, found.information, found.surprise
    _sample_walls(stretch.displacement_px, told, rules.most_local_surprise, place, sigma)
    return place, sigma


NEAR_BELL = half_bell(3.0)
"""Over which scores must be what they claim, in samples: some eighty columns."""


@numba.njit(cache=True, nogil=True)
def _sums(path, score, information):  # type: ignore[no-untyped-def]
    """Return the sums over each sample, of what is told of the path, of the scores and of the information."""
    sums = np.zeros((3, path.size // STRIDE_PX))
    for n in range(sums.shape[1]):
        for x in range(n * STRIDE_PX, (n + 1) * STRIDE_PX):
            sums[0, n] += information[x] * path[x] + score[x]
            sums[1, n] += score[x]
            sums[2, n] += information[x]
    return sums


@numba.njit(cache=True, nogil=True)
def _sample_walls(path, told, most_local_surprise, place, sigma):  # type: ignore[no-untyped-def]
    """Write place and standard error of each wall; see `samples_of`."""
    score, information, surprise = told
    for wall in range(len(path)):
        sums = _sums(path[wall], score[wall], information[wall])
        _sample(sums, surprise[wall], most_local_surprise, place[wall], sigma[wall])


@numba.njit(cache=True, nogil=True)
def _sample(sums, surprise, most_local_surprise, place, sigma):  # type: ignore[no-untyped-def]
    """Write place and standard error of one wall, of the sums over each sample."""
    moment, score, information = sums
    power = 1.0 if np.isnan(surprise) else min(max(surprise, SURPRISE_LIMITS[0]), SURPRISE_LIMITS[1])
    known, local = np.zeros(place.size), np.zeros(place.size)
    least = 1e-12
    for total in information:
        least = max(least, total)
    for n in range(place.size):
        if information[n] > 1e-3 * least:
            known[n], local[n] = 1.0, score[n] ** 2 / (power * information[n])
    usual, found = np.empty(place.size), np.empty(place.size)
    blur(known, NEAR_BELL, 0.0, 0.0, usual)
    blur(local, NEAR_BELL, 0.0, 0.0, found)
    for n in range(place.size):
        seen = known[n] > 0 and found[n] <= most_local_surprise * usual[n]
        place[n] = moment[n] / information[n] if seen else np.nan
        sigma[n] = np.sqrt(power / information[n]) if seen else np.nan
