"""From the two walls to the two directions in which a groove can move.

With both walls standing at the angle φ against the land, a lateral displacement a and a vertical one h move the place of
the inner wall by a − h cot φ and that of the outer wall by a + h cot φ. So for slopes (derivatives along s)

    lateral = (outer + inner)/2,      vertical = (outer − inner)/2 · tan φ.

With one wall only, the direction of the cut is read on the assumption that the groove does not move in the other; for a
45/45 groove that is the wall's own channel, √2 times its velocity along the normal of the wall.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.quality import NOT_MEASURED, FlagArray
from gramoscope.signal_path import WallTrace


@dataclass(frozen=True, eq=False)
class Observations:
    """What one stretch says of one direction.

    Attributes
    ----------
    arc_m : float64 array, shape (sample,)
    slope, variance : float64 arrays, shape (sample,)
        NaN where nothing was seen.
    flags : uint16 array, shape (sample,)
    """

    arc_m: FloatArray
    slope: FloatArray
    variance: FloatArray
    flags: FlagArray

    def thinned(self, step: int, first: int = 0) -> Observations:
        """Return every `step`-th sample from the `first` on."""
        keep = slice(first, None, step)
        return Observations(self.arc_m[keep], self.slope[keep], self.variance[keep], self.flags[keep])


def observe(trace: WallTrace, direction: Direction, *, wall_angle_rad: float) -> Observations:
    """Return what a stretch says of one direction.

    Parameters
    ----------
    trace : WallTrace
    direction : {"lateral", "vertical"}
    wall_angle_rad : float
        φ.

    Returns
    -------
    Observations
        Lateral: both walls weighted by their information where both were measured, one where only one was. Vertical:
        half the difference where both were measured, else from the one. Flags are those of the walls that were used.
    """
    inner, outer = trace.slope[INNER], trace.slope[OUTER]
    variance = trace.slope_sigma**2
    seen = np.isfinite(trace.slope) & np.isfinite(variance)
    measured = seen & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
    # a wall that was measured wins over one that was filled in
    use = np.where(measured.any(axis=0), measured, seen)
    sign = np.array([1.0, 1.0]) if direction == "lateral" else np.array([-1.0, 1.0]) * np.tan(wall_angle_rad)
    weight = np.where(use, 1 / np.where(use, np.maximum(variance, 1e-18), 1.0), 0.0)
    if direction == "vertical":
        weight = use.astype(np.float64)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(total > 0, weight / total, np.nan)
        slope = np.nansum(share * sign[:, None] * np.where(use, [inner, outer], 0.0), axis=0)
        spread = np.nansum((share * sign[:, None]) ** 2 * np.where(use, variance, 0.0), axis=0)
    nothing = total == 0
    flags = np.bitwise_or.reduce(np.where(use | nothing, trace.flags, 0), axis=0).astype(np.uint16)
    arc = trace.arc_start_m + np.arange(inner.size) * trace.arc_step_m
    return Observations(arc, np.where(nothing, np.nan, slope), np.where(nothing, np.nan, spread), flags)
