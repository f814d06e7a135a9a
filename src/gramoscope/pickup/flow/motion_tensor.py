"""What two pictures say about the flow, gathered in square cells: the motion tensor.

At a flow w₀ the second picture is brought over the first, by cubic interpolation (R. G. Keys, IEEE Transactions on
Acoustics, Speech and Signal Processing 29, 1981), and what is left is t = I₂(x + w₀) − I₁(x). With g = ∇I₁ a further step d
of the flow is judged by Σ k (g·d + t)² over the pixels of a cell: a quadratic form of d, whose five numbers

    Σ k g_x²,   Σ k g_x g_y,   Σ k g_y²,   Σ k g_x t,   Σ k g_y t

are all that a solver needs. k = 1/√(1 + t²/s²) takes trust from pixels that disagree (dust, an edge of motion); where the
second picture does not reach, k = 0. Differentiating the first picture once, and not the warped second, is the inverse
compositional way (S. Baker and I. Matthews, IJCV 56, 2004).

Flow is given at the middles of the cells and drawn linearly between them.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy import ndimage

from gramoscope.conventions import Float32Array, FloatArray

XX, XY, YY, XT, YT = range(5)
"""Order of the five numbers."""
REACH = 2
"""Pixels that the differences reach over."""


@numba.njit(cache=True, nogil=True)
def between_cells(place, cell, count):  # type: ignore[no-untyped-def]
    """Number of the cell whose middle lies before a pixel, and the share of the next one; the ends count as constant."""
    at = min(max((place + 0.5) / cell - 0.5, 0.0), count - 1.0)
    before = min(int(at), max(count - 2, 0))
    return before, np.float32(at - before)


@numba.njit(cache=True, nogil=True)
def mix_rows(first, second, share, out):  # type: ignore[no-untyped-def]
    """Write a row between two others."""
    for x in range(out.size):
        out[x] = first[x] + share * (second[x] - first[x])


@numba.njit(cache=True, nogil=True)
def spread_row(nodes, index, share, out):  # type: ignore[no-untyped-def]
    """Draw a row of cells linearly to pixels; `nodes` has one more value at the end."""
    for x in range(out.size):
        i = np.uintp(index[x])
        here = nodes[i]
        out[x] = here + share[x] * (nodes[i + np.uintp(1)] - here)


@numba.njit(cache=True, nogil=True)
def column_places(width, cell, count):  # type: ignore[no-untyped-def]
    """`between_cells` for every column."""
    index, share = np.empty(width, np.uint32), np.empty(width, np.float32)
    for x in range(width):
        i, s = between_cells(x, cell, count)
        index[x], share[x] = i, s
    return index, share


@numba.njit(cache=True, nogil=True)
def spread_flow_row(field, y, cell, index, share, nodes, out):  # type: ignore[no-untyped-def]
    """Flow of one component along a row of pixels."""
    rows, columns = field.shape
    i, s = between_cells(y, cell, rows)
    mix_rows(field[i], field[min(i + 1, rows - 1)], s, nodes[:columns])
    nodes[columns] = nodes[columns - 1]
    spread_row(nodes, index, share, out)


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _warp_row(flat, width, height, y, u, v, out, seen):  # type: ignore[no-untyped-def]
    """Look the second picture up along a row by 4 × 4 points; `seen` is 0 where it does not reach."""
    right, bottom = np.float32(width - 2), np.float32(height - 2)
    zero, one, half = np.float32(0), np.float32(1), np.float32(0.5)
    two, three, four, five = np.float32(2), np.float32(3), np.float32(4), np.float32(5)
    stride = np.uintp(width)
    for x in range(out.size):
        column, row = np.float32(x) + u[x], np.float32(y) + v[x]
        column_in, row_in = min(max(column, one), right), min(max(row, one), bottom)
        seen[x] = one if (column_in == column) & (row_in == row) else zero
        i = min(np.int32(column_in), np.int32(width - 3))
        j = min(np.int32(row_in), np.int32(height - 3))
        f, g = column_in - np.float32(i), row_in - np.float32(j)
        ff, gg = f * f, g * g
        fff, ggg = ff * f, gg * g
        # Keys' weights of the four points
        a, d = half * (two * ff - fff - f), half * (fff - ff)
        b, c = one + half * (three * fff - five * ff), half * (f + four * ff - three * fff)
        k = np.uintp(np.int32(j - np.int32(1)) * np.int32(width) + i - np.int32(1))
        p = a * flat[k] + b * flat[k + np.uintp(1)] + c * flat[k + np.uintp(2)] + d * flat[k + np.uintp(3)]
        k += stride
        q = a * flat[k] + b * flat[k + np.uintp(1)] + c * flat[k + np.uintp(2)] + d * flat[k + np.uintp(3)]
        k += stride
        r = a * flat[k] + b * flat[k + np.uintp(1)] + c * flat[k + np.uintp(2)] + d * flat[k + np.uintp(3)]
        k += stride
        s = a * flat[k] + b * flat[k + np.uintp(1)] + c * flat[k + np.uintp(2)] + d * flat[k + np.uintp(3)]
        a, d = half * (two * gg - ggg - g), half * (ggg - gg)
        b, c = one + half * (three * ggg - five * gg), half * (g + four * gg - three * ggg)
        out[x] = a * p + b * q + c * r + d * s


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_products(  # type: ignore[no-untyped-def]
    north2, north, here, south, south2, west2, west, east, east2, warped, seen, per_scale2, xx, xy, yy, xt, yt
):
    one, near, far = np.float32(1), np.float32(2 / 3), np.float32(1 / 12)
    for x in range(xx.size):
        gx = near * (east[x] - west[x]) - far * (east2[x] - west2[x])
        gy = near * (south[x] - north[x]) - far * (south2[x] - north2[x])
        t = warped[x] - here[x]
        k = seen[x] / np.sqrt(one + per_scale2 * t * t)
        kx, ky = k * gx, k * gy
        xx[x] += kx * gx
        xy[x] += kx * gy
        yy[x] += ky * gy
        xt[x] += kx * t
        yt[x] += ky * t


@numba.njit(cache=True, nogil=True)
def _gather(pixels, cell, out):  # type: ignore[no-untyped-def]
    for i in range(out.size):
        total = np.float32(0)
        for x in range(i * cell, min((i + 1) * cell, pixels.size)):
            total += pixels[x]
        out[i] = total


@numba.njit(cache=True, nogil=True)
def _motion_tensor(padded, second, u, v, cell, per_scale2, tensor):  # type: ignore[no-untyped-def]
    height, width = second.shape
    flat = second.reshape(-1)
    index, share = column_places(width, cell, u.shape[1])
    nodes = np.empty(u.shape[1] + 1, np.float32)
    along, down, warped, seen = np.empty((4, width), np.float32)
    sums = np.empty((5, width), np.float32)
    for i in range(u.shape[0]):
        sums[:] = 0
        for y in range(i * cell, min((i + 1) * cell, height)):
            spread_flow_row(u, y, cell, index, share, nodes, along)
            spread_flow_row(v, y, cell, index, share, nodes, down)
            _warp_row(flat, width, height, y, along, down, warped, seen)
            row = padded[y + 2]
            _add_products(
                padded[y, 2:-2], padded[y + 1, 2:-2], row[2:-2], padded[y + 3, 2:-2], padded[y + 4, 2:-2],
                row[:-4], row[1:-3], row[3:-1], row[4:], warped, seen, per_scale2,
                sums[0], sums[1], sums[2], sums[3], sums[4],
            )  # fmt: skip
        for n in range(5):
            _gather(sums[n], cell, tensor[n, i])


def motion_tensor(
    first: Float32Array, second: Float32Array, u: Float32Array, v: Float32Array, *, cell_px: int, scale: float
) -> Float32Array:
    """Return the five sums of every cell.

    Parameters
    ----------
    first, second : float32 arrays, shape (row, column)
        At least 4 × 4.
    u, v : float32 arrays, shape (cell down, cell along)
        Flow at the middles of the cells, pixels; finite.
    cell_px : int
        Side of a cell; the last ones may reach beyond the picture.
    scale : float
        s, grey levels.

    Returns
    -------
    float32 array, shape (5, cell down, cell along)
        In the order `XX`, `XY`, `YY`, `XT`, `YT`.
    """
    tensor = np.empty((5, *u.shape), np.float32)
    _motion_tensor(np.pad(first, REACH, mode="edge"), second, u, v, cell_px, np.float32(1 / scale**2), tensor)
    return tensor


def motion_tensor_reference(
    first: Float32Array, second: Float32Array, u: Float32Array, v: Float32Array, *, cell_px: int, scale: float
) -> FloatArray:
    """Return the same as `motion_tensor`, in NumPy and double precision: slow, and meant to be read."""
    height, width = first.shape
    along, down = (flow_of_cells(f, first.shape, cell_px=cell_px).astype(np.float64) for f in (u, v))
    rows, columns = np.mgrid[:height, :width]
    row, column = rows + down, columns + along
    seen = (row >= 1) & (row <= height - 2) & (column >= 1) & (column <= width - 2)
    warped = _looked_up(second.astype(np.float64), np.clip(row, 1, height - 2), np.clip(column, 1, width - 2))
    t = warped - first
    kernel = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
    gx, gy = (ndimage.correlate1d(first.astype(np.float64), kernel, axis=a, mode="nearest") for a in (1, 0))
    k = seen / np.sqrt(1 + (t / scale) ** 2)
    products = k * np.array([gx * gx, gx * gy, gy * gy, gx * t, gy * t])
    full = np.zeros((5, u.shape[0] * cell_px, u.shape[1] * cell_px))
    full[:, :height, :width] = products
    return np.asarray(full.reshape(5, u.shape[0], cell_px, u.shape[1], cell_px).sum(axis=(2, 4)))


def _looked_up(picture: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
    j = np.minimum(row.astype(int), picture.shape[0] - 3)
    i = np.minimum(column.astype(int), picture.shape[1] - 3)
    down, along = _keys(row - j), _keys(column - i)
    return np.asarray(sum(down[m] * along[n] * picture[j + m - 1, i + n - 1] for m in range(4) for n in range(4)))


def _keys(f: FloatArray) -> list[FloatArray]:
    return [
        (2 * f**2 - f**3 - f) / 2,
        1 + (3 * f**3 - 5 * f**2) / 2,
        (f + 4 * f**2 - 3 * f**3) / 2,
        (f**3 - f**2) / 2,
    ]


@numba.njit(cache=True, nogil=True)
def _flow_of_cells(field, cell, out):  # type: ignore[no-untyped-def]
    index, share = column_places(out.shape[1], cell, field.shape[1])
    nodes = np.empty(field.shape[1] + 1, np.float32)
    for y in range(out.shape[0]):
        spread_flow_row(field, y, cell, index, share, nodes, out[y])


def flow_of_cells(field: Float32Array, shape: tuple[int, int], *, cell_px: int) -> Float32Array:
    """Return one component of the flow at every pixel.

    Parameters
    ----------
    field : float32 array, shape (cell down, cell along)
    shape : tuple
        Of the picture; the cells must cover it.
    cell_px : int

    Returns
    -------
    float32 array of that shape
        Linear between the middles of the cells, constant beyond the outermost.
    """
    out = np.empty(shape, np.float32)
    _flow_of_cells(field, cell_px, out)
    return out
