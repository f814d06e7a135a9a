"""Where a picture is sharp: the energy of its texture, in cells of a few columns by one row.

Texture in focus has strong differences from column to column, blurred texture has weak ones, and shading has none. What
every cell has anyway (camera noise) is measured in the quietest rows, and the root of the energy above it is what the search
for the groove adds up: a stripe is a ridge in it, three rows or so wide on either side. A scratch or a speck is brighter than
any stripe, so the root is cut off.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import Float32Array, FloatArray

CELL_PX = 8
"""Columns in a cell."""


@numba.njit(cache=True, nogil=True)
def _cell_energy(columns, energy):  # type: ignore[no-untyped-def]
    cells, height = energy.shape
    width = columns.shape[0]
    for cell in range(cells):
        for x in range(max(cell * CELL_PX, 3), min((cell + 1) * CELL_PX, width - 3)):
            for y in range(height):
                # the derivative of a Gaussian of about one pixel, from six columns
                difference = columns[x + 1, y] - columns[x - 1, y]
                difference += np.float32(0.5) * (columns[x + 2, y] - columns[x - 2, y])
                energy[cell, y] += difference * difference


def sharpness(columns: Float32Array, *, ceiling: float = 1.5) -> FloatArray:
    """Return how sharp the picture is, cell by cell.

    Parameters
    ----------
    columns : float32 array, shape (column, row)
    ceiling : float
        Cells are not believed to be sharper than so many times the picture's sharpest row.

    Returns
    -------
    float64 array, shape (cell, row)
        Root of the energy above the noise, a little smoothed, in units of the sharpest row of a typical cell.
    """
    cells = columns.shape[0] // CELL_PX
    energy = np.zeros((cells, columns.shape[1]), np.float32)
    _cell_energy(columns, energy)
    energy = _smoothed(energy)
    noise = float(np.quantile(np.median(energy, axis=0), 0.1))
    amplitude = np.sqrt(np.maximum(energy - noise, 0.0))
    reference = float(np.median(amplitude.max(axis=1)))
    return np.minimum(amplitude / reference, ceiling) if reference > 0 else np.zeros_like(amplitude)


def _smoothed(values: FloatArray) -> FloatArray:
    """A triangle of three cells along the groove: texture is random, and one cell is a poor witness."""
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    total = padded[:-4] + 2 * padded[1:-3] + 3 * padded[2:-2] + 2 * padded[3:-1] + padded[4:]
    return np.asarray(total / 9, np.float64)


def ridges(sharp: FloatArray, *, half_px: int = 3, flank_px: tuple[int, int] = (8, 16)) -> FloatArray:
    """Return how much sharper each place is than the rows on either side of it.

    Parameters
    ----------
    sharp : float64 array, shape (cell, row)
    half_px : int
        Half width of a ridge.
    flank_px : (int, int)
        Nearest and furthest row of the flanks.

    Returns
    -------
    float64 array, same shape
        Mean over the ridge minus mean over both flanks; rows beyond the picture repeat the outermost.
    """
    near, far = flank_px
    total = np.concatenate(
        [np.zeros((sharp.shape[0], 1)), np.cumsum(np.pad(sharp, ((0, 0), (far, far)), mode="edge"), axis=1)], axis=1
    )
    rows = np.arange(sharp.shape[1]) + far

    def mean(first: int, last: int) -> FloatArray:
        return np.asarray((total[:, rows + last + 1] - total[:, rows + first]) / (last - first + 1))

    return mean(-half_px, half_px) - 0.5 * (mean(-far, -near) + mean(near, far))
