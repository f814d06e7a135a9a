"""What is believed of the paths that the coarse search found for both walls, before they are read.

A groove that is cut laterally or vertically moves both walls alike; what they do against each other is warp, focus or a hole
off the centre, and changes little along a stretch. So where the two paths part at once, one of them has left its wall for
something beside it that is as sharp, as the floor of a fracture may be; and what else their distance does is jitter.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, BoolArray, FloatArray, IntArray
from gramoscope.disc.formats import Cut
from gramoscope.pickup.texture.smoothing import blur, smooth_both

MOST_PARTED_PX = 7.0
"""Further than this from their usual distance, in rows, walls are not: one of the paths has gone astray."""
LEAST_PARTED_COLUMNS = 24
"""Over fewer columns paths only jitter; and so far on either side of where they part they are not believed."""
LEAST_JUDGED_COLUMNS = 100
"""With both walls in sight, below which nobody can tell what distance is usual."""


def sign_of(cut: Cut) -> FloatArray:
    """Return how the walls move when the groove moves in the direction of its cut, lateral or vertical; shape (2,)."""
    return LATERAL if cut == "lateral" else VERTICAL


LATERAL, VERTICAL = np.array([1.0, 1.0]), np.array([-1.0, 1.0])
"""Signs of the inner and the outer wall."""


def along_columns(cells: FloatArray, columns: slice, *, cell_px: int, half_bell: FloatArray) -> FloatArray:
    """Return what was found cell by cell, smoothed and drawn column by column, on straight lines between their middles.

    Parameters
    ----------
    cells : float64 array, shape (line, cell)
    columns : slice
        Which columns are drawn; the first cell begins with column 0. Beyond the middles of the outermost cells their
        values are held.
    cell_px : int
        Columns of a cell.
    half_bell : float64 array
        Of the smoothing over cells, from its middle on.

    Returns
    -------
    float64 array, shape (line, column)
    """
    drawn = np.empty((len(cells), columns.stop - columns.start))
    _draw_along(cells, columns.start, cell_px, half_bell, drawn)
    return drawn


@numba.njit(cache=True, nogil=True)
def _draw_along(cells, first, cell_px, half_bell, drawn):  # type: ignore[no-untyped-def]
    """Write lines by column; see `along_columns`."""
    last = cells.shape[1] - 1
    smooth_cells = np.empty(last + 1)
    for i in range(len(cells)):
        blur(cells[i], half_bell, cells[i, 0], cells[i, last], smooth_cells)
        for k in range(drawn.shape[1]):
            place = first + k - (0.5 * cell_px - 0.5)
            cell = min(max(int(np.floor(place / cell_px)), 0), max(last - 1, 0))
            near, far = smooth_cells[cell], smooth_cells[min(cell + 1, last)]
            beyond = min(max(place - cell * cell_px, 0.0), 1.0 * cell_px)
            drawn[i, k] = (far - near) / cell_px * beyond + near


def of_walls(support: FloatArray, wall: IntArray) -> FloatArray:
    """Return the support of each wall, shape (2, column): that of its best stripe, 0 without any."""
    best = np.zeros((2, support.shape[1]))
    _raise_walls(support, wall, best)
    return best


@numba.njit(cache=True, nogil=True)
def _raise_walls(support, wall, best):  # type: ignore[no-untyped-def]
    """Raise the support of walls to that of each of their stripes."""
    for i in range(wall.size):
        for x in range(support.shape[1]):
            best[wall[i], x] = max(best[wall[i], x], support[i, x])


def silenced(support: FloatArray, lost: BoolArray, wall: IntArray, *, least_best_support: float) -> FloatArray:
    """Return the support of stripes, 0 where it is not believed.

    Parameters
    ----------
    support : float64 array, shape (stripe, column)
    lost : bool array, shape (2, column)
        Where each wall is astray.
    wall : int64 array, shape (stripe,)
    least_best_support : float
        Where no stripe at all has that much none is believed.
    """
    left = np.zeros(support.shape)
    _let_speak(support, lost, wall, least_best_support, left)
    return left


@numba.njit(cache=True, nogil=True)
def _let_speak(support, lost, wall, least_best_support, left):  # type: ignore[no-untyped-def]
    """Write the support that is believed; see `silenced`."""
    for x in range(support.shape[1]):
        best = 0.0
        for i in range(wall.size):
            best = max(best, support[i, x])
        for i in range(wall.size):
            if best >= least_best_support and not lost[wall[i], x]:
                left[i, x] = support[i, x]


def astray(displacement_px: FloatArray, support: FloatArray, cut: Cut, *, least_support: float) -> BoolArray:
    """Tell where the path of a wall follows something else.

    Where the walls are further from their usual distance (the median over the stretch) than they can be, the one with
    less support, in the mean of such a part, has left its wall.

    Parameters
    ----------
    displacement_px, support : float64 arrays, shape (2, column)
        From the coarse search: where each wall was found, and how sharp.
    cut : {"lateral", "vertical", "stereo"}
        A stereo cut moves each wall by itself, and nothing can be told.
    least_support : float
        Walls with no more than this are out of sight, and do not judge.

    Returns
    -------
    bool array, shape (2, column)
    """
    lost = np.zeros(displacement_px.shape, np.bool_)
    if cut != "stereo":
        _part(displacement_px, support, sign_of(cut), least_support, lost)
    return lost


@numba.njit(cache=True, nogil=True)
def _part(displacement, support, sign, least_support, lost):  # type: ignore[no-untyped-def]
    """Mark the walls that are astray; see `astray`."""
    width = displacement.shape[1]
    apart, judged, count = np.empty(width), np.empty(width), 0
    for x in range(width):
        apart[x] = np.nan
        if support[INNER, x] > least_support and support[OUTER, x] > least_support:
            apart[x] = judged[count] = sign[OUTER] * displacement[OUTER, x] - sign[INNER] * displacement[INNER, x]
            count += 1
    if count < LEAST_JUDGED_COLUMNS:
        return
    usual, start = np.median(judged[:count]), 0
    for x in range(width + 1):
        if x == width or not abs(apart[x] - usual) > MOST_PARTED_PX:
            if x - start >= LEAST_PARTED_COLUMNS:
                weaker = INNER if support[INNER, start:x].sum() <= support[OUTER, start:x].sum() else OUTER
                lost[weaker, max(start - LEAST_PARTED_COLUMNS, 0) : x + LEAST_PARTED_COLUMNS] = True
            start = x + 1


def settled(displacement_px: FloatArray, support: FloatArray, cut: Cut, *, smooth_px: float) -> FloatArray:
    """Return coarse paths without the jitter of single walls: the difference that the cut does not use is smoothed.

    Parameters
    ----------
    displacement_px, support : float64 arrays, shape (2, column)
        From the coarse search, and how sharp each wall was found; the wall with the better support counts for more, and
        one without any goes along with the other.
    cut : {"lateral", "vertical", "stereo"}
        Walls of a stereo cut are left alone.
    smooth_px : float
        Standard deviation of the smoothing of that difference.
    """
    if cut == "stereo":
        return displacement_px
    path = np.empty_like(displacement_px)
    _settle(displacement_px, support, sign_of(cut), float(smooth_px), path)
    return path


@numba.njit(cache=True, nogil=True)
def _settle(displacement, support, sign, smooth_px, path):  # type: ignore[no-untyped-def]
    """Write paths that differ smoothly; see `settled`."""
    width = displacement.shape[1]
    both, apart = np.empty(width), np.empty(width)
    for x in range(width):
        inner, outer = support[INNER, x] ** 2 + 1e-4, support[OUTER, x] ** 2 + 1e-4
        both[x] = inner * outer / (inner + outer)
        apart[x] = both[x] * (sign[OUTER] * displacement[OUTER, x] - sign[INNER] * displacement[INNER, x]) / 2
    weight, half = np.empty(width), np.empty(width)
    smooth_both(both, apart, smooth_px, weight, half)
    for x in range(width):
        inner, outer = support[INNER, x] ** 2 + 1e-4, support[OUTER, x] ** 2 + 1e-4
        aside = half[x] / weight[x]
        said = inner * (sign[INNER] * displacement[INNER, x] + aside)
        said += outer * (sign[OUTER] * displacement[OUTER, x] - aside)
        middle = said / (inner + outer)
        path[INNER, x], path[OUTER, x] = sign[INNER] * (middle - aside), sign[OUTER] * (middle + aside)
