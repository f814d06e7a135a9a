"""The groove as a solid thing: two walls, a rounded bottom, and the land on either side.

In a section across the groove, with x = l − a(s) measured from its middle, the outer wall falls and the inner wall rises

    z = −(w/2 + x) tan φ_outer,       z = −(w/2 − x) tan φ_inner,

and a circle that touches both rounds the bottom, as the cutting stylus left it. A lateral cut moves the whole section by
a(s); a vertical cut lifts the walls by h(s) while the land stays where it is, so that the groove gets narrower as it gets
shallower: z(s, l) = min(0, profile(l − a(s)) + h(s)).

Along the section runs the arc length u, zero at the bottom: the place of a grain on the wall, whatever the groove does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Disc
from gramoscope.errors import require

BOTTOM_RADIUS_M = 10e-6
"""Radius of the rounded bottom: a guess; styli of the time left anything from a few micrometres to fifty."""


@dataclass(frozen=True)
class GrooveProfile:
    """The section of a groove at rest.

    Parameters
    ----------
    width_m : float
        Distance between the two edges at the land, positive.
    inner_angle_rad, outer_angle_rad : float
        Of each wall against the land, 0 … π/2.
    bottom_radius_m : float
        Radius of the circle that rounds the bottom, positive, small enough to leave some straight wall.
    """

    width_m: float = 150e-6
    inner_angle_rad: float = np.pi / 4
    outer_angle_rad: float = np.pi / 4
    bottom_radius_m: float = BOTTOM_RADIUS_M

    def __post_init__(self) -> None:
        require(self.width_m > 0, f"the groove is {self.width_m} m wide", "a positive width")
        for angle in (self.inner_angle_rad, self.outer_angle_rad):
            require(0 < angle < np.pi / 2, f"a wall stands at {angle} rad", "0 … π/2")
        require(self.bottom_radius_m > 0, f"the bottom has a radius of {self.bottom_radius_m} m", "a positive radius")
        left, right = self._touching_m
        require(
            -self.width_m / 2 < left < right < self.width_m / 2,
            f"a bottom of radius {self.bottom_radius_m * 1e6:g} µm in a groove {self.width_m * 1e6:g} µm wide",
            "a radius that leaves some straight wall",
        )

    @classmethod
    def of_disc(
        cls, disc: Disc, *, inner_error_rad: float = 0.0, outer_error_rad: float = 0.0, bottom_radius_m: float = 10e-6
    ) -> GrooveProfile:
        """Return the groove of a disc, its walls off their nominal angle by the errors given."""
        return cls(
            disc.groove_width_m,
            disc.wall_angle_rad + inner_error_rad,
            disc.wall_angle_rad + outer_error_rad,
            bottom_radius_m,
        )

    @property
    def centre_m(self) -> tuple[float, float]:
        """Place (x, z) of the centre of the bottom's circle: at the distance of its radius from both walls."""
        inner, outer = self.inner_angle_rad, self.outer_angle_rad
        half, radius = self.width_m / 2, self.bottom_radius_m
        # the distance from the outer wall is (half + x) sin φ + z cos φ, and likewise for the inner one
        walls = np.array([[np.sin(outer), np.cos(outer)], [-np.sin(inner), np.cos(inner)]])
        x, z = np.linalg.solve(walls, [radius - half * np.sin(outer), radius - half * np.sin(inner)])
        return float(x), float(z)

    @property
    def _touching_m(self) -> tuple[float, float]:
        """Places x where the bottom passes into the outer and the inner wall."""
        x = self.centre_m[0]
        radius = self.bottom_radius_m
        return x - radius * float(np.sin(self.outer_angle_rad)), x + radius * float(np.sin(self.inner_angle_rad))

    @property
    def depth_m(self) -> float:
        """Depth of the lowest point below the land, positive."""
        return self.bottom_radius_m - self.centre_m[1]

    @property
    def shape(self) -> FloatArray:
        """The numbers that `section` needs, as one array, so that kernels can take them along."""
        x, z = self.centre_m
        return np.array(
            [
                self.width_m / 2,
                float(np.tan(self.inner_angle_rad)),
                float(np.tan(self.outer_angle_rad)),
                self.bottom_radius_m,
                x,
                z,
                *self._touching_m,
                self.inner_angle_rad,
                self.outer_angle_rad,
            ]
        )

    def height_m(self, across_m: npt.ArrayLike, *, lift_m: npt.ArrayLike = 0.0) -> FloatArray:
        """Return the height of the surface at a distance from the groove's middle.

        Parameters
        ----------
        across_m : array_like
            x = l − a, metres.
        lift_m : array_like
            Vertical displacement h of the walls, positive upwards; broadcasts with `across_m`.

        Returns
        -------
        float64 array
            z ≤ 0, metres; NaN gives NaN.
        """
        return np.asarray(_heights(np.asarray(across_m, np.float64), np.asarray(lift_m, np.float64), self.shape))


@numba.njit(cache=True, nogil=True)
def section(x: float, shape: FloatArray) -> tuple[float, float, float]:
    """Return height z, slope dz/dx and arc length u of the walls at x, land not yet cut off (kernel; see the module)."""
    half, tan_inner, tan_outer, radius = shape[0], shape[1], shape[2], shape[3]
    if x < shape[6]:
        along = (x - shape[6]) * np.sqrt(1 + tan_outer * tan_outer) - radius * shape[9]
        return -(half + x) * tan_outer, -tan_outer, along
    if x > shape[7]:
        along = (x - shape[7]) * np.sqrt(1 + tan_inner * tan_inner) + radius * shape[8]
        return -(half - x) * tan_inner, tan_inner, along
    sideways = x - shape[4]
    upright = np.sqrt(radius * radius - sideways * sideways)
    return shape[5] - upright, sideways / upright, radius * np.arcsin(sideways / radius)


def _heights(across_m: FloatArray, lift_m: FloatArray, shape: FloatArray) -> FloatArray:
    across, lift = np.broadcast_arrays(across_m, lift_m)
    walls = _section_heights(np.ascontiguousarray(across).ravel(), shape).reshape(across.shape)
    return np.asarray(np.minimum(walls + lift, 0.0))


@numba.njit(cache=True, nogil=True)
def _section_heights(across_m: FloatArray, shape: FloatArray) -> FloatArray:
    heights = np.empty(across_m.size)
    for i in range(across_m.size):
        heights[i] = section(across_m[i], shape)[0]
    return heights
