"""Windows of picture rows that follow a stripe along the groove.

A sharp stripe wanders across the rows as the groove does. A window of rows that is laid about its path, column by column
and to a fraction of a pixel, shows the texture as if the groove were straight: only then are the statistics of its rows the
same all along the passage. Filtering along the columns without following would smear by the groove's slope.

Between rows the picture is interpolated by a Kaiser-windowed sinc; the derivative of the same kernel gives how the window
would change if the path were moved across the rows.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray

Float32Array = npt.NDArray[np.float32]

TAPS = 10
PHASES = 512
KAISER_BETA = 6.0
BEFORE = TAPS // 2 - 1
"""Rows that the kernel reaches before the one at or below a place."""


def interpolation_taps(fraction: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Return the weights of ten rows for places between the fifth and the sixth, and their derivatives.

    Parameters
    ----------
    fraction : float64 array, shape (place,)
        0 … 1.

    Returns
    -------
    taps, slope : float32 arrays, shape (place, 10)
        w_i = sinc(i − f) I₀(β√(1 − ((i − f)/5)²)), normalised to Σw = 1; dw_i/df by central differences.
    """

    def weights(f: FloatArray) -> FloatArray:
        away = np.arange(-BEFORE, TAPS - BEFORE) - f[:, None]
        window = np.i0(KAISER_BETA * np.sqrt(np.maximum(0.0, 1 - (away / (TAPS / 2)) ** 2)))
        taps = np.sinc(away) * window
        return np.asarray(taps / taps.sum(axis=1, keepdims=True))

    step = 1e-4
    slope = (weights(fraction + step) - weights(fraction - step)) / (2 * step)
    return weights(fraction).astype(np.float32), slope.astype(np.float32)


_TAPS, _SLOPES = interpolation_taps(np.arange(PHASES + 1) / PHASES)


def follow(columns: Float32Array, path_row: FloatArray, half_px: int) -> tuple[Float32Array, Float32Array]:
    """Return a window of rows about a path, and its derivative with the path.

    Parameters
    ----------
    columns : float32 array, shape (column, row)
        The picture, transposed, so that a column lies together in memory.
    path_row : float64 array, shape (column,)
        Row of the path in each column; where the window leaves the picture its outermost row is repeated.
    half_px : int
        Rows on each side of the path.

    Returns
    -------
    window : float32 array, shape (2 half_px + 1, column)
        Row j shows the picture at path_row + j − half_px.
    derivative : float32 array, same shape
        d(window)/d(path_row), grey levels a row.
    """
    shape = (2 * half_px + 1, columns.shape[0])
    window, derivative = np.empty(shape, np.float32), np.empty(shape, np.float32)
    _follow(columns, path_row, _TAPS, _SLOPES, window, derivative)
    return window, derivative


@numba.njit(cache=True, nogil=True)
def _follow(columns, path_row, taps, slopes, window, derivative):  # type: ignore[no-untyped-def]
    rows, width = window.shape
    half = rows // 2
    height = columns.shape[1]
    stretch = np.empty(rows + taps.shape[1] - 1, np.float32)
    value = np.empty(rows, np.float32)
    change = np.empty(rows, np.float32)
    for x in range(width):
        floor = int(np.floor(path_row[x]))
        phase = int((path_row[x] - floor) * (taps.shape[0] - 1) + 0.5)
        first = floor - half - (taps.shape[1] // 2 - 1)
        if first >= 0 and first + stretch.size <= height:
            stretch[:] = columns[x, first : first + stretch.size]
        else:
            for j in range(stretch.size):
                stretch[j] = columns[x, min(max(first + j, 0), height - 1)]
        _interpolate(stretch, taps[phase], slopes[phase], value, change)
        for j in range(rows):
            window[j, x] = value[j]
            derivative[j, x] = change[j]


@numba.njit(cache=True, nogil=True)
def _interpolate(stretch, taps, slopes, value, change):  # type: ignore[no-untyped-def]
    value[:] = np.float32(0)
    change[:] = np.float32(0)
    for i in range(taps.size):
        w, d = taps[i], slopes[i]
        for j in range(value.size):
            value[j] += w * stretch[i + j]
            change[j] += d * stretch[i + j]
