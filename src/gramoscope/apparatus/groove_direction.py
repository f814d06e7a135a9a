"""Along which axis of a photograph its grooves run: the one along which structure is steady.

In a strip that lies along the grooves the mean over its length keeps land and groove apart, and changes steeply at each edge;
in a strip across them the mean is nearly the same everywhere. How steeply is asked at several scales, since nobody knows how
wide a groove is in pixels, and the scale that tells both axes apart best has the word. Very bright and dark pixels are clipped
before: dust and lettering have no direction to speak of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gramoscope.apparatus.still_bench import Axis
from gramoscope.conventions import FloatArray
from gramoscope.signal_path import ImageArray

STRIPS = 4
"""A strip is so many times shorter than the shorter side, or grooves would swing out of their own mean."""
LEAST_SCALES, LARGEST_SCALE = 4, 1 / 32
"""Scales of 1, 2, 4 … pixels: at least so many, and up to this share of the shorter side."""
CLIPPED = (5, 90)
"""Per cent of the pixels."""
LONGEST_PX = 2048
"""Larger pictures are looked at in strides: grooves are wide."""


@dataclass(frozen=True)
class DirectionFinding:
    """Which way grooves run.

    Attributes
    ----------
    groove_along : {"columns", "rows"}
    coherence : float
        0 … 1: by how much what is steady along one axis outweighs what is along the other, 0 for a picture without direction.
    """

    groove_along: Axis
    coherence: float


def groove_direction(image: ImageArray) -> DirectionFinding:
    """Return along which index the grooves of a picture run.

    Parameters
    ----------
    image : uint8 or uint16 array, shape (row, column)
        As stored.

    Returns
    -------
    DirectionFinding
        "columns" if s changes with the column, so that the grooves lie from side to side.
    """
    stride = max(1, max(image.shape) // LONGEST_PX)
    seen = image[::stride, ::stride].astype(np.float64)
    seen = np.clip(seen, *np.percentile(seen, CLIPPED))
    length = max(min(seen.shape) // STRIPS, 4)
    aside, down = _steepness(seen, length), _steepness(seen.T, length)
    total = aside + down
    differences = np.divide(aside - down, total, out=np.zeros_like(total), where=total > 0)
    difference = float(differences[np.argmax(np.abs(differences))])
    return DirectionFinding("columns" if difference >= 0 else "rows", abs(difference))


def _steepness(image: FloatArray, length: int) -> FloatArray:
    """Mean square slope of what is steady along the columns, by scale: the median over strips of so many columns."""
    strips = np.array_split(image, max(image.shape[1] // length, 1), axis=1)
    means = np.array([strip.mean(axis=1) for strip in strips])
    scales = 2.0 ** np.arange(max(LEAST_SCALES, int(np.log2(max(min(image.shape) * LARGEST_SCALE, 1))) + 1))
    slopes = (np.diff(gaussian_filter1d(means, scale, axis=1)) for scale in scales)
    return np.array([np.median((slope**2).mean(axis=1)) for slope in slopes])
