"""Where a picture is sharp: the energy of its texture, in cells of a few columns by one row.

Texture in focus has strong differences from column to column, blurred texture has weak ones, and shading has none. What
every cell has anyway (camera noise) is measured in the quietest rows, and the root of the energy above it is what the search
for the groove adds up: a stripe is a ridge in it, three rows or so wide on either side. A scratch or a speck is brighter than
any stripe, so the root is cut off.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import Float32Array

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


def sharpness(columns: Float32Array, *, ceiling: float = 1.5) -> Float32Array:
    """Return how sharp the picture is, cell by cell.

    Parameters
    ----------
    columns : float32 array, shape (column, row)
    ceiling : float
        Cells are not believed to be sharper than so many times the picture's sharpest row.

    Returns
    -------
    float32 array, shape (cell, row)
        Root of the energy above the noise, a little smoothed, in units of the sharpest row of a typical cell.
    """
    cells = columns.shape[0] // CELL_PX
    energy = np.zeros((cells, columns.shape[1]), np.float32)
    _cell_energy(columns, energy)
    energy = _smoothed(energy)
    # a row is quiet all along the stretch, or it is not
    noise = np.float32(np.quantile(np.median(energy[::EVERY], axis=0), 0.1))
    amplitude = np.sqrt(np.maximum(energy - noise, np.float32(0)))
    reference = np.float32(np.median(amplitude.max(axis=1)))
    return np.minimum(amplitude / reference, np.float32(ceiling)) if reference > 0 else np.zeros_like(amplitude)


EVERY = 4
"""Of so many cells one is looked at to find out how quiet the quietest rows are."""


def _smoothed(values: Float32Array) -> Float32Array:
    """A triangle of three cells along the groove: texture is random, and one cell is a poor witness."""
    padded = np.pad(values / np.float32(9), ((2, 2), (0, 0)), mode="edge")
    total = padded[:-4] + padded[4:]
    total += 2 * (padded[1:-3] + padded[3:-1])
    total += 3 * padded[2:-2]
    return np.asarray(total)


@numba.njit(cache=True, nogil=True)
def _ridges(sharp, half, near, far, out):  # type: ignore[no-untyped-def]
    cells, height = sharp.shape
    total = np.zeros(height + 2 * far + 1)
    for cell in range(cells):
        for k in range(total.size - 1):
            total[k + 1] = total[k] + sharp[cell, min(max(k - far, 0), height - 1)]
        # row r lies at total[r + far + 1] − total[r + far]
        ridge, below, above = total[far - half :], total, total[far + near :]
        for row in range(height):
            crest = (ridge[row + 2 * half + 1] - ridge[row]) / (2 * half + 1)
            flanks = below[row + far - near + 1] - below[row] + above[row + far - near + 1] - above[row]
            out[cell, row] = crest - 0.5 * flanks / (far - near + 1)


def ridges(sharp: Float32Array, *, half_px: int = 3, flank_px: tuple[int, int] = (8, 16)) -> Float32Array:
    """Return how much sharper each place is than the rows on either side of it.

    Parameters
    ----------
    sharp : float32 array, shape (cell, row)
    half_px : int
        Half width of a ridge.
    flank_px : (int, int)
        Nearest and furthest row of the flanks.

    Returns
    -------
    float32 array, same shape
        Mean over the ridge minus mean over both flanks; rows beyond the picture repeat the outermost.
    """
    out = np.empty(sharp.shape, np.float32)
    _ridges(sharp, half_px, *flank_px, out)
    return out
