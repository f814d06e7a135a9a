"""Along which axis of a photograph its grooves run: the one along which structure is steady.

In a strip that lies along the grooves brightness hardly changes from end to end, so that the median over its length keeps
land and groove apart; in a strip across them the median is nearly the same everywhere. Medians pass over dust and
lettering. Grain leaves little of itself in either, since so many pixels go into a median.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.apparatus.still_bench import Axis
from gramoscope.conventions import FloatArray
from gramoscope.signal_path import ImageArray

STRIPS = 8
"""A strip is so many times shorter than the shorter side, or grooves would swing out of their own median."""
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
    length = max(min(seen.shape) // STRIPS, 4)
    aside, down = _steady_power(seen, length), _steady_power(seen.T, length)
    total = aside + down
    difference = (aside - down) / total if total > 0 else 0.0
    return DirectionFinding("columns" if difference >= 0 else "rows", abs(difference))


def _steady_power(image: FloatArray, length: int) -> float:
    """Variance of what is steady along the columns, the median over strips of so many columns."""
    strips = np.array_split(image, max(image.shape[1] // length, 1), axis=1)
    return float(np.median([np.var(np.median(strip, axis=1)) for strip in strips]))
