"""Octaves and their thirds, and what a sound is worth in each.

Bands are those of IEC 61260-1, with base ten: the middle of a third of an octave is 1000 · 10^(n/10) Hz and its edges lie
10^(±1/20) from there; three make an octave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.errors import require

LOWEST_HZ = 20.0
NOMINAL: FloatArray = np.array([1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0])
"""How the ten thirds of a decade are called."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Neighbouring bands.

    Attributes
    ----------
    centre_hz : float64 array, shape (band,)
        By their nominal names: 1250, not 1258.9.
    edge_hz : float64 array, shape (band + 1,)
    """

    centre_hz: FloatArray
    edge_hz: FloatArray


def third_octaves(highest_hz: float) -> Bands:
    """Return all thirds of an octave from 20 Hz up to those that end below a frequency."""
    return _bands(highest_hz, np.arange(-17, 40), 1)


def octaves(highest_hz: float) -> Bands:
    """Return all octaves from 31.5 Hz up to those that end below a frequency."""
    return _bands(highest_hz, np.arange(-15, 40, 3), 3)


def _bands(highest_hz: float, numbers: IntArray, thirds: int) -> Bands:
    centre = 1000 * 10 ** (numbers / 10)
    inside = centre * 10 ** (thirds / 20) <= highest_hz
    require(bool(inside.any()), f"bands up to {highest_hz:g} Hz", "a higher frequency")
    centre = centre[inside]
    names = NOMINAL[numbers[inside] % 10] * 10.0 ** (3 + numbers[inside] // 10)
    return Bands(names, np.append(centre * 10 ** (-thirds / 20), centre[-1] * 10 ** (thirds / 20)))


def band_power(frequency_hz: FloatArray, density: FloatArray, bands: Bands) -> FloatArray:
    """Return the power of each band.

    Parameters
    ----------
    frequency_hz, density : float64 arrays, shape (frequency,)
        Rising, and unit²/Hz there, drawn straight in between.
    bands : Bands

    Returns
    -------
    float64 array, shape (band,)
        Unit². NaN for a band that the frequencies do not tell apart from its neighbours, or do not reach.
    """
    steps = np.diff(frequency_hz)
    power = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * steps)])
    edge = bands.edge_hz
    at = np.clip(np.searchsorted(frequency_hz, edge, side="right") - 1, 0, steps.size - 1)
    into = edge - frequency_hz[at]
    height = density[at] + (density[at + 1] - density[at]) / steps[at] * into / 2
    reached = power[at] + into * height
    told = np.diff(edge) >= np.maximum(steps[at[:-1]], steps[at[1:]])
    inside = (edge[:-1] >= frequency_hz[0]) & (edge[1:] <= frequency_hz[-1])
    return np.where(told & inside, np.diff(reached), np.nan)


def usable_to_hz(bands: Bands, ratio_db: FloatArray, *, least_db: float) -> float:
    """Return the upper edge of the last band, going up from the best one, that has a ratio of so much; NaN if none has.

    Parameters
    ----------
    bands : Bands
    ratio_db : float64 array, shape (band,)
        Sound over error; NaN where unknown, which ends the search upwards.
    least_db : float
    """
    if not (ratio_db >= least_db).any():
        return float("nan")
    best = int(np.nanargmax(ratio_db))
    worse = np.flatnonzero(~(ratio_db[best:] >= least_db))
    stop = best + int(worse[0]) if worse.size else ratio_db.size
    return float(bands.edge_hz[stop])
