"""Windows of picture rows that follow a stripe along the groove.

A sharp stripe wanders across the rows as the groove does. A window of rows that is laid about its path, column by column
and to a fraction of a pixel, shows the texture as if the groove were straight: only then are the statistics of its rows the
same all along the passage. Filtering along the columns without following would smear by the groove's slope.

Between rows the picture is interpolated by a Kaiser-windowed sinc; the derivative along the rows tells how the window would
change if the path were moved across them.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import Float32Array, FloatArray

TAPS = 10
PHASES = 512
KAISER_BETA = 4.0
BEFORE = TAPS // 2 - 1
"""Rows that the kernel reaches before the one at or below a place."""


def interpolation_taps(fraction: FloatArray) -> Float32Array:
    """Return the weights of ten rows for places between the fifth and the sixth.

    Parameters
    ----------
    fraction : float64 array, shape (place,)
        0 … 1.

    Returns
    -------
    float32 array, shape (place, 10)
        sinc(i − f) I₀(β√(1 − ((i − f)/5)²)), normalised to sum 1.
    """
    away = np.arange(-BEFORE, TAPS - BEFORE) - fraction[:, None]
    window = np.i0(KAISER_BETA * np.sqrt(np.maximum(0.0, 1 - (away / (TAPS / 2)) ** 2)))
    taps = np.sinc(away) * window
    return np.asarray(taps / taps.sum(axis=1, keepdims=True), np.float32)


_TAPS = interpolation_taps(np.arange(PHASES + 1) / PHASES)


REACH = 7
"""Rows that a derivative needs on each side."""
GENTLE = np.array([45.0, -9.0, 1.0]) / 60
"""Weights of x₁ − x₋₁, x₂ − x₋₂, x₃ − x₋₃ in a derivative that is exact up to the sixth degree and fades beyond a third of a
cycle a row: it forgives rows that are too far apart for what they show."""


SLOPE_BETA = 6.0


def sharp_slope() -> FloatArray:
    """Return the weights of x₁ − x₋₁ … x₇ − x₋₇ in a derivative that holds nearly up to half a cycle a row.

    Within 4 % to a third of a cycle, 6 % to four tenths, and even. The slope of the sinc series, (−1)^(k+1)/k, under a
    Kaiser window, scaled to be exact for a straight line.
    """
    k = np.arange(1, REACH + 1)
    taps = -((-1.0) ** k) / k * np.i0(SLOPE_BETA * np.sqrt(1 - (k / (REACH + 1)) ** 2))
    return np.asarray(taps / np.sum(2 * k * taps))


SHARP = sharp_slope()


def follow(
    columns: Float32Array,
    path_row: FloatArray,
    half_px: int,
) -> Float32Array:
    """Return a window of rows about a path, and as many more on each side as derivatives need.

    Parameters
    ----------
    columns : float32 array, shape (column, row)
        The picture, transposed, so that a column lies together in memory.
    path_row : float64 array, shape (column,)
        Row of the path in each column; where the window leaves the picture its outermost row is repeated.
    half_px : int
        Rows of the window on each side of the path.

    Returns
    -------
    float32 array, shape (2 (half_px + 7) + 1, column)
        Row j shows the picture at path_row + j − half_px − 7. The window proper is `[REACH:-REACH]`; `across` of the whole
        is its derivative with the path.
    """
    wide = np.empty((2 * (half_px + REACH) + 1, columns.shape[0]), np.float32)
    _follow(columns, path_row, _TAPS, wide)
    return wide


def across(rows: Float32Array, slope: FloatArray) -> Float32Array:
    """Return the derivative of rows with their number.

    Parameters
    ----------
    rows : float32 array, shape (row, column)
    slope : float64 array
        `GENTLE` or `SHARP`.

    Returns
    -------
    float32 array, shape (row − 14, column)
    """
    n = rows.shape[0]
    out = np.zeros((n - 2 * REACH, rows.shape[1]), np.float32)
    for k, tap in enumerate(slope.astype(np.float32), start=1):
        out += tap * (rows[REACH + k : n - REACH + k] - rows[REACH - k : n - REACH - k])
    return out


@numba.njit(cache=True, nogil=True)
def _follow(columns, path_row, taps, window):  # type: ignore[no-untyped-def]
    rows, width = window.shape
    half = rows // 2
    height = columns.shape[1]
    stretch = np.empty(rows + taps.shape[1] - 1, np.float32)
    value = np.empty(rows, np.float32)
    for x in range(width):
        floor = int(np.floor(path_row[x]))
        phase = int((path_row[x] - floor) * (taps.shape[0] - 1) + 0.5)
        first = floor - half - (taps.shape[1] // 2 - 1)
        if first >= 0 and first + stretch.size <= height:
            stretch[:] = columns[x, first : first + stretch.size]
        else:
            for j in range(stretch.size):
                stretch[j] = columns[x, min(max(first + j, 0), height - 1)]
        _interpolate(stretch, taps[phase], value)
        for j in range(rows):
            window[j, x] = value[j]


@numba.njit(cache=True, nogil=True)
def _interpolate(stretch, taps, value):  # type: ignore[no-untyped-def]
    value[:] = np.float32(0)
    for i in range(taps.size):
        _add_scaled(taps[i], stretch[i : i + value.size], value)


@numba.njit(cache=True, nogil=True)
def _add_scaled(w, row, value):  # type: ignore[no-untyped-def]
    for j in range(value.size):
        value[j] += w * row[j]
