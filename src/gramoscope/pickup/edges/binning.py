"""Pixels of large pictures binned, so that an edge is as many pixels wide as everything here expects; edges brought back.

Where grooves are hundreds of pixels apart the blur of an edge, its grain and its halos are many pixels wide, and the spacing
of pixels tells nothing new. Blocks of k × k pixels are averaged then, without those that are burnt; a place in the binned
picture is one at k times the row and the column, as the middle of a block lies at (k − 1)/2 of the pixels in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.signal_path import GrooveEdges, StillPicture

BINNED_PITCH_PX = 128.0
"""Pictures are binned so that grooves are about so far apart; nearer ones are left as they are."""
LEAST_COLUMNS = 64
"""Of a binned picture."""
BURNT_SHARE = 0.25
"""A block of which more is burnt is burnt."""
HIGHEST = 65_535


def binning_factor(pitch_px: float, columns: int) -> int:
    """Return k for grooves that are so many rows apart, in a picture of so many columns; 1 where nothing is to be binned."""
    return max(1, min(round(pitch_px / BINNED_PITCH_PX), columns // LEAST_COLUMNS))


def binned_picture(picture: StillPicture, factor: int, burnt: int) -> StillPicture:
    """Return a picture with blocks of `factor` × `factor` pixels averaged.

    Parameters
    ----------
    picture : StillPicture
    factor : int
        k, 2 or more.
    burnt : int
        From this pixel value on a pixel is burnt: it is left out, and a block of many is burnt as a whole.

    Returns
    -------
    StillPicture
        16 bits, with a `white_level` as many times higher as that holds, so that no mean is rounded away. Blocks at the right
        and lower border go on as the last pixels do.
    """
    blocks, seen = _blocks(picture.image, factor), _blocks(picture.seen, factor)
    clear = seen & (blocks < burnt)
    count = clear.sum(axis=(1, 3))
    gain = min(factor**2, HIGHEST // picture.white_level)
    mean = np.where(clear, blocks, 0).sum(axis=(1, 3), dtype=np.float64) / np.maximum(count, 1)
    is_burnt = (seen & ~clear).sum(axis=(1, 3)) > BURNT_SHARE * factor**2
    white_level = gain * picture.white_level
    image = np.where(is_burnt, white_level, np.rint(gain * mean)).astype(np.uint16)
    return replace(
        picture,
        image=image,
        pixel_pitch_m=factor * picture.pixel_pitch_m,
        white_level=white_level,
        seen=(count > 0) | is_burnt,
    )


def unbinned(edges: GrooveEdges, factor: int, columns: int) -> GrooveEdges:
    """Return edges of a binned picture as those of the picture itself, of so many columns: cubic splines between blocks."""
    middle = (factor - 1) / 2
    at = (np.arange(columns) - middle) / factor
    nearest = np.clip(np.rint(at).astype(np.intp), 0, edges.flags.shape[1] - 1)

    def rows(row_px: FloatArray) -> FloatArray:
        return factor * _between(row_px, at, nearest) + middle

    return replace(
        edges,
        row_px=np.stack([rows(one) for one in edges.row_px]),
        row_sigma_px=factor * edges.row_sigma_px[:, nearest],
        correlation_samples=factor * edges.correlation_samples,
        flags=edges.flags[:, nearest],
        bottom_row_px=rows(edges.bottom_row_px),
        bottom_row_sigma_px=factor * edges.bottom_row_sigma_px[nearest],
    )


def _blocks(pixels: np.ndarray, factor: int) -> np.ndarray:
    """Pixels as an array of shape (row, factor, column, factor)."""
    rows, columns = (-(-size // factor) for size in pixels.shape)
    beyond = rows * factor - pixels.shape[0], columns * factor - pixels.shape[1]
    whole = np.pad(pixels, ((0, beyond[0]), (0, beyond[1])), mode="edge")
    return whole.reshape(rows, factor, columns, factor)


def _between(value: FloatArray, at: FloatArray, nearest: IntArray) -> FloatArray:
    """Values between those at whole numbers; NaN where the nearest one is."""
    known = np.flatnonzero(np.isfinite(value))
    if known.size < 2:
        return value[nearest]
    return np.where(np.isfinite(value[nearest]), CubicSpline(known, value[known])(at), np.nan)
