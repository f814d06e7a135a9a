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

from gramoscope.conventions import Float32Array, FloatArray, IntArray
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.vector_lanes import interpolate

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


TAPS_OF_PHASES = interpolation_taps(np.arange(PHASES + 1) / PHASES)
STEP_BITS = 5
STEPS = 1 << STEP_BITS
"""A path that is read is followed in so many steps a row: see `stepped`."""
REACH = 8
"""Rows beyond a window on each side that its derivatives, and windows a little to the side of it, need."""
GENTLE = np.array([45.0, -9.0, 1.0]) / 60
"""Weights of x₁ − x₋₁, x₂ − x₋₂, x₃ − x₋₃ in a derivative that is exact up to the sixth degree and fades beyond a third of a
cycle a row: it forgives rows that are too far apart for what they show."""
SLOPE_ROWS = 7
SLOPE_BETA = 6.0


def sharp_slope() -> FloatArray:
    """Return the weights of x₁ − x₋₁ … x₇ − x₋₇ in a derivative that holds nearly up to half a cycle a row.

    Within 4 % to a third of a cycle, 6 % to four tenths, and even. The slope of the sinc series, (−1)^(k+1)/k, under a
    Kaiser window, scaled to be exact for a straight line.
    """
    k = np.arange(1, SLOPE_ROWS + 1)
    taps = -((-1.0) ** k) / k * np.i0(SLOPE_BETA * np.sqrt(1 - (k / (SLOPE_ROWS + 1)) ** 2))
    return np.asarray(taps / np.sum(2 * k * taps))


SHARP = sharp_slope()


def follow(columns: Float32Array, path_row: FloatArray, half_px: int) -> Float32Array:
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
    float32 array, shape (column, 2 (half_px + 8) + 1)
        Row j shows the picture at path_row + j − half_px − 8; the window proper is `[:, REACH:-REACH]`.
    """
    return np.ascontiguousarray(_followed(columns, path_row, half_px)[: columns.shape[0], : wide_rows(half_px)])


def wide_rows(half_px: int) -> int:
    """Return how many rows a window has with those beyond it."""
    return 2 * (half_px + REACH) + 1


def channels(columns: Float32Array, path_row: FloatArray, half_px: int, basis: Float32Array) -> Float32Array:
    """Return channels of the window about a path: each a weighted sum of its rows, those beyond it included.

    Parameters
    ----------
    columns, path_row, half_px
        See `follow`.
    basis : float32 array, shape (row, channel)

    Returns
    -------
    float32 array, shape (column, channel)
    """
    window = _followed(columns, path_row, half_px)
    padded = np.zeros((window.shape[1], basis.shape[1]), np.float32)
    padded[: basis.shape[0]] = basis
    # in small blocks, which no library spreads over threads of its own
    blocks = np.matmul(window.reshape(-1, BLOCK, window.shape[1]), padded)
    return np.asarray(blocks.reshape(-1, basis.shape[1])[: columns.shape[0]])


BLOCK = 128


def _followed(columns: Float32Array, path_row: FloatArray, half_px: int) -> Float32Array:
    """A window with columns up to a multiple of `BLOCK`, those beyond the picture black, and rows up to one of `LANES`."""
    rows = wide_rows(half_px)
    width = columns.shape[0]
    window = np.empty((-(-width // BLOCK) * BLOCK, padded_rows(rows)), np.float32)
    window[width:] = 0
    follow_rows(columns, path_row, TAPS_OF_PHASES, half_px + REACH, window[:width])
    return window


def padded_rows(rows: int) -> int:
    """Return how many rows a window is given in memory: sixteens."""
    return -(-rows // LANES) * LANES


def shifted(rows: int, px: float) -> FloatArray:
    """Return the matrix that takes rows to `rows` rows from their middle, each moved by less than one row.

    Returns
    -------
    float64 array, shape (rows, rows + 10)
        Of the interpolation that `follow` does.
    """
    whole = int(np.floor(px))
    taps = interpolation_taps(np.array([px - whole]))[0]
    matrix = np.zeros((rows, rows + TAPS))
    for row in range(rows):
        first = row + whole + TAPS // 2 - BEFORE
        matrix[row, first : first + TAPS] = taps
    return matrix


def across(rows: int, slope: FloatArray) -> FloatArray:
    """Return the matrix that takes rows to the derivative of the middle ones with their number.

    Parameters
    ----------
    rows : int
        How many derivatives are wanted.
    slope : float64 array
        `GENTLE` or `SHARP`.

    Returns
    -------
    float64 array, shape (rows, rows + 2 taps)
    """
    matrix = np.zeros((rows, rows + 2 * slope.size))
    middle = np.arange(rows)
    for k, tap in enumerate(slope, start=1):
        matrix[middle, middle + slope.size + k] = tap
        matrix[middle, middle + slope.size - k] = -tap
    return matrix


def places_of(path_row: FloatArray, half: int) -> tuple[IntArray, IntArray]:
    """Return what `follow_rows` finds of paths of any shape.

    Returns
    -------
    first_row, phase : int64 arrays
        The first row that the first row of a window is interpolated from, and which taps do it.
    """
    floor = np.floor(path_row)
    phase = ((path_row - floor) * PHASES + 0.5).astype(np.int64)
    return floor.astype(np.int64) - half - BEFORE, phase


@numba.njit(cache=True, nogil=True)
def stepped(path_row, aside):  # type: ignore[no-untyped-def]
    """Move paths to the nearest of `STEPS` places a row, and write how far they are from there, in rows.

    With so few places what interpolates and what mixes channels can be one for each, and stay in the cache. A score at a
    place beside the path differs from the path's by information times distance, which is known (`hearing.add_up`).
    """
    rows, left = path_row.reshape(path_row.size), aside.reshape(aside.size)
    for n in range(rows.size):
        nearest = np.floor(rows[n] * STEPS + 0.5) / STEPS
        left[n] = rows[n] - nearest
        rows[n] = nearest


@numba.njit(cache=True, nogil=True)
def step_of(row, half):  # type: ignore[no-untyped-def]
    """Return the first row that the first row of a window about a row is interpolated from, and the step between rows."""
    nearest = int(np.floor(row * STEPS + 0.5))
    return (nearest >> STEP_BITS) - half - BEFORE, nearest & (STEPS - 1)


def step_mixtures(basis: Float32Array) -> Float32Array:
    """Return what makes channels of the picture's own rows in place of a window's: the interpolation and the basis in one.

    Parameters
    ----------
    basis : float32 array, shape (row, channel)
        Of a window and the rows beyond it.

    Returns
    -------
    float32 array, shape (step, row + 9, channel)
    """
    rows = len(basis)
    taps = interpolation_taps(np.arange(STEPS) / STEPS)
    mixtures = np.zeros((STEPS, rows + TAPS - 1, basis.shape[1]), np.float32)
    for k in range(TAPS):
        mixtures[:, k : k + rows] += taps[:, k, None, None] * basis
    return mixtures


@numba.njit(cache=True, nogil=True)
def follow_rows(columns, path_row, taps, half, window):  # type: ignore[no-untyped-def]
    """Write a window, its rows in sixteens, that begins `half` rows before the path, by taps of phases from 0 to 1."""
    width, rows = window.shape
    height, count = columns.shape[1], taps.shape[1]
    reach = rows + LANES  # so many are looked at
    edge = np.empty(reach, np.float32)
    picture, tap, into = columns.reshape(columns.size), taps.reshape(taps.size), window.reshape(window.size)
    for x in range(width):
        floor = int(np.floor(path_row[x]))
        phase = int((path_row[x] - floor) * (taps.shape[0] - 1) + 0.5)
        first = floor - half - (count // 2 - 1)
        if first >= 0 and first + reach <= height:
            interpolate(picture, x * height + first, SOON * height, tap, phase * count, into, x * rows, rows)
        else:
            for j in range(reach):
                edge[j] = columns[x, min(max(first + j, 0), height - 1)]
            interpolate(edge, 0, 0, tap, phase * count, into, x * rows, rows)


SOON = 8
"""So many columns ahead the picture is called for; it is larger than the cache, and a path that rises is not foreseen by it."""
