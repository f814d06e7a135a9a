"""From the flags of samples, wherever they lie, to those of an even grid."""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.quality import NOT_MEASURED, FlagArray, Quality

OUTLIER = np.uint16(Quality.OUTLIER | Quality.INTERPOLATED)
"""The flags of a sample that was seen and given no weight."""


def grid_flags(grid: FloatArray, arc_m: FloatArray, flags: FlagArray, *, reach_m: float) -> FlagArray:
    """Return the flags of places on a grid from those of the samples around them.

    Parameters
    ----------
    grid : float64 array, shape (point,)
        Rising.
    arc_m, flags : arrays, shape (sample,)
        In any order.
    reach_m : float
        Samples further away than this do not support a point.

    Returns
    -------
    uint16 array, shape (point,)
        Where a sample in reach was measured, the flags of the measured ones; elsewhere `INTERPOLATED` and all reasons
        in reach.
    """
    order = np.argsort(arc_m, kind="stable")
    arc, flag = arc_m[order], flags[order]
    start, stop = np.searchsorted(arc, grid - reach_m), np.searchsorted(arc, grid + reach_m, side="right")
    measured_flags, all_flags = np.zeros(grid.size, np.uint16), np.zeros(grid.size, np.uint16)
    any_measured = np.zeros(grid.size, np.bool_)
    for k in range(int((stop - start).max(initial=0))):
        i = np.minimum(start + k, arc.size - 1)
        here = start + k < stop
        measured = here & ((flag[i] & np.uint16(NOT_MEASURED)) == 0)
        any_measured |= measured
        measured_flags |= np.where(measured, flag[i], 0).astype(np.uint16)
        all_flags |= np.where(here, flag[i], 0).astype(np.uint16)
    return np.where(any_measured, measured_flags, all_flags | np.uint16(Quality.INTERPOLATED)).astype(np.uint16)
