"""Which depth is sharp, how blurred the rest is, and where on a straight wall the sharp stripes lie.

A wall at angle φ against the land reaches the depth q below the land at the distance w/2 − q/tan φ from the middle of a
groove of width w. So a microscope that is sharp at depth q₀ without the glass and q₁ = q₀ + δ through it sees three sharp
stripes: both walls at q₁ under the glass, and one wall at q₀ beyond its edge.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.microscope.objective import Objective


def blur_radius_m(defocus_m: npt.ArrayLike, *, objective: Objective) -> FloatArray:
    """Return the radius of the blur disc, |dz| tan(asin NA), on the record (geometrical optics; NaN gives NaN)."""
    return np.asarray(np.abs(np.asarray(defocus_m, np.float64)) * objective.blur_radius_per_defocus, np.float64)


def stripe_distance_from_middle_m(depth_below_land_m: float, *, groove_width_m: float, wall_angle_rad: float) -> float:
    """Return how far from the middle of the groove a wall reaches a depth, w/2 − q/tan φ.

    Negative when the groove is not that deep: the two walls would have met before.
    """
    return groove_width_m / 2 - depth_below_land_m / float(np.tan(wall_angle_rad))


def stripe_separation_m(focus_shift_m: float, *, wall_angle_rad: float) -> float:
    """Return the distance between the two stripes of one wall, δ/tan φ, measured across the groove."""
    return focus_shift_m / float(np.tan(wall_angle_rad))
