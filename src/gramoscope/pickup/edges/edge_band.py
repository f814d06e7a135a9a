"""The strip of picture along an edge, straightened by whole rows: no pixel is interpolated, each keeps its own noise."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.ndimage import binary_erosion, maximum_filter

from gramoscope.conventions import INNER, BoolArray, Float32Array, FloatArray
from gramoscope.pickup.edges.halo import NO_HALO, Halo
from gramoscope.signal_path import StillPicture

BLUR_PX = 2
"""So far about a burnt pixel its neighbours are spoilt by its blur."""
BLOB_PX, GLARE_PX = 5, 8
"""A burnt square of this side glares so far about its middle."""


@dataclass(frozen=True, eq=False)
class EdgeBand:
    """Pixels about an edge.

    Attributes
    ----------
    level : float32 array, shape (column, place)
        Grey levels; the places are rows about the course, those nearest to the wall first.
    from_edge_px : float64 array, shape (column, place)
        Where each pixel lies, from the course towards the land: negative on the wall.
    usable : bool array, shape (column, place)
        Seen, in the picture, not burnt and not beside a burnt pixel.
    burnt : bool array, shape (column, place)
        Burnt, or beside a burnt pixel.
    halo : float64 array, shape (column, place)
        Share, 0 … 1, of the way to `burnt_level` by which what is burnt brightens a pixel.
    burnt_level : int
        From this value on a pixel is burnt.
    towards_land : int
        +1 where the land lies at larger rows, else −1.
    """

    level: Float32Array
    from_edge_px: FloatArray
    usable: BoolArray
    burnt: BoolArray
    halo: FloatArray
    burnt_level: int
    towards_land: int


@numba.njit(cache=True, nogil=True)
def _gather(image, seen, first, sign, burnt_level, level, usable, burnt):  # type: ignore[no-untyped-def]
    rows = image.shape[0]
    for c in range(level.shape[0]):
        for k in range(level.shape[1]):
            r = first[c] + sign * k
            if 0 <= r < rows and seen[r, c]:
                level[c, k] = image[r, c]
                burnt[c, k] = image[r, c] >= burnt_level
                usable[c, k] = not burnt[c, k]


def edge_band(
    picture: StillPicture, row: FloatArray, *, wall: int, half_px: int, burnt: int, halo: Halo = NO_HALO
) -> EdgeBand:
    """Return the pixels about the course of an edge.

    Parameters
    ----------
    picture : StillPicture
    row : float64 array, shape (column,)
        The course.
    wall : int
        `INNER` or `OUTER`: on which side the land lies.
    half_px : int
        So many rows on each side.
    burnt : int
        From this value on a pixel is burnt.
    halo : Halo
        How far what is burnt brightens its surroundings.
    """
    sign = 1 if wall == INNER else -1
    nearest = np.rint(row).astype(np.int64)
    reach = half_px + GLARE_PX
    shape = (row.size, 2 * reach + 1)
    level, usable, scorched = np.zeros(shape, np.float32), np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    _gather(picture.image, picture.seen, nearest - sign * reach, sign, burnt, level, usable, scorched)
    share = halo.share(scorched)
    scorched = _with_surroundings(scorched)
    kept = slice(GLARE_PX, -GLARE_PX)
    place = sign * (nearest - row)[:, None] + np.arange(-half_px, half_px + 1)
    clean = usable & ~scorched
    return EdgeBand(level[:, kept], place, clean[:, kept], scorched[:, kept], share[:, kept], burnt, sign)


def _with_surroundings(burnt: BoolArray) -> BoolArray:
    """Burnt pixels and those that they spoil: a few about specks and writing, more about blobs."""
    if not burnt.any():
        return burnt
    blobs = binary_erosion(burnt, np.ones((BLOB_PX, BLOB_PX), np.bool_))
    # a filter of squares goes row by row and column by column, where a dilation goes through the square
    blur, glare = (
        maximum_filter(part.view(np.uint8), 2 * reach + 1) for part, reach in ((burnt, BLUR_PX), (blobs, GLARE_PX))
    )
    return np.asarray((blur | glare) > 0)
