"""From groove to groove: the pitch in rows, by how the picture resembles itself a pitch away.

Each column is compared with itself shifted, and what the columns say is added up; so it does not matter how the grooves
wind, only that neighbours are alike in the same column.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import Float32Array, FloatArray

MOST_COLUMNS = 4000
LEAST_PITCH_PX = 12
NEARLY_HIGHEST = (0.6, 0.35)
"""The pitch need not be the highest peak, which may be a multiple of it: the first peaks of these shares of it are tried."""
LEAST_LIKENESS = 0.05
"""A correlation below this is no likeness."""
LONE_GROOVE = (0.75, 0.4, 0.2)
"""Shares of the picture's height that may be the pitch when nothing repeats."""


def row_autocorrelation(level: Float32Array) -> FloatArray:
    """Return how columns of a picture correlate with themselves some rows away.

    Parameters
    ----------
    level : float32 array, shape (column, row)

    Returns
    -------
    float64 array, shape (row // 3 * 2,)
        For shifts from 0, where it is 1; unbiased for the part that overlaps.
    """
    rows = level.shape[1]
    # the light may fall off across the grooves: what is left after a parabola repeats, or does not
    place = np.linspace(-1, 1, rows)
    centred = level - np.polynomial.polynomial.polyval(
        place, np.polynomial.polynomial.polyfit(place, level.T, 2)
    ).astype(np.float32)
    spectrum = np.abs(np.fft.rfft(centred, 2 * rows, axis=1)) ** 2
    shifts = max(rows * 2 // 3, 1)
    power = np.fft.irfft(spectrum.sum(axis=0))[:shifts] / np.arange(rows, rows - shifts, -1)
    return np.asarray(power / power[0] if power[0] > 0 else power, np.float64)


def groove_pitches_px(level: Float32Array, share: Float32Array) -> tuple[float, ...]:
    """Return what may be the distance from groove to groove.

    Parameters
    ----------
    level : float32 array, shape (column, row)
        Brightness.
    share : float32 array, shape (column, row)
        0 where nothing is known of it.

    Returns
    -------
    tuple of float
        The first shifts at which the autocorrelation has a peak of at least `NEARLY_HIGHEST` of its highest; where nothing
        repeats, `LONE_GROOVE` of the height. The likeliest first.
    """
    rows = level.shape[1]
    step = int(np.ceil(level.shape[0] / MOST_COLUMNS))
    some, known = level[::step], share[::step] > 0
    if not known.any():
        return ()
    low, middle, high = np.quantile(some[known], (0.02, 0.5, 0.97))
    likeness = row_autocorrelation(np.where(known, np.clip(some, low, high), middle).astype(np.float32))
    inner = np.arange(1, likeness.size - 1)
    rising = (likeness[inner] >= likeness[inner - 1]) & (likeness[inner] > likeness[inner + 1])
    peaks = inner[rising & (inner >= LEAST_PITCH_PX) & (likeness[inner] > LEAST_LIKENESS)]
    if peaks.size == 0:
        return tuple(part * rows for part in LONE_GROOVE if part * rows >= LEAST_PITCH_PX)
    first = [float(peaks[likeness[peaks] >= part * likeness[peaks].max()][0]) for part in NEARLY_HIGHEST]
    return tuple(dict.fromkeys(first))
