"""Light: how bright a matt surface looks from above, and how the picture darkens towards its corners.

Three lamps, each with its share of the light that falls on the land: light from all around, light down the lens (coaxial)
and a lamp at one side (oblique). A matt surface with the unit normal n, seen from above, has the brightness

    ambient + coaxial · n_z + oblique · max(0, n·L)/L_z,

which is 1 on the land. Towards the bottom of the groove the opposite wall hides some of the light; that is taken as a loss
proportional to depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require


@dataclass(frozen=True)
class Illumination:
    """The lamps of the microscope.

    Parameters
    ----------
    exposure : float
        Share of full scale that the land has in the middle of the picture, positive.
    coaxial, oblique : float
        Shares of the light, 0 … 1 together; the rest comes from all around.
    elevation_rad, azimuth_rad : float
        Where the oblique lamp stands: above the land, 0 … π/2, and from the direction of s towards that of l.
    hidden_per_m : float
        Light lost for each metre below the land, zero or more.
    vignetting : float
        Light lost at the corners of the picture, 0 … 1; it grows with the square of the distance from the middle.
    """

    exposure: float = 0.43
    coaxial: float = 0.45
    oblique: float = 0.1
    elevation_rad: float = np.pi / 3
    azimuth_rad: float = 1.0
    hidden_per_m: float = 1500.0
    vignetting: float = 0.12

    def __post_init__(self) -> None:
        require(self.exposure > 0, f"an exposure of {self.exposure}", "a positive share of full scale")
        both = self.coaxial + self.oblique
        require(min(self.coaxial, self.oblique) >= 0 and both <= 1, f"shares of light {both}", "0 … 1 together")
        require(0 < self.elevation_rad <= np.pi / 2, f"a lamp at {self.elevation_rad} rad", "0 … π/2 above the land")
        require(0 <= self.vignetting < 1, f"a vignetting of {self.vignetting}", "0 … 1")
        require(self.hidden_per_m >= 0, f"a loss of {self.hidden_per_m}/m", "zero or more")

    @property
    def lamps(self) -> FloatArray:
        """The numbers that shading kernels need: ambient, coaxial, oblique, its direction (s, l, z)/z, hidden_per_m."""
        sideways = 1 / float(np.tan(self.elevation_rad))
        towards = (sideways * float(np.cos(self.azimuth_rad)), sideways * float(np.sin(self.azimuth_rad)), 1.0)
        return np.array([1 - self.coaxial - self.oblique, self.coaxial, self.oblique, *towards, self.hidden_per_m])

    def brightness(self, slope_s: npt.ArrayLike, slope_l: npt.ArrayLike, *, height_m: npt.ArrayLike) -> FloatArray:
        """Return how bright a surface looks, relative to the land.

        Parameters
        ----------
        slope_s, slope_l : array_like
            ∂z/∂s and ∂z/∂l.
        height_m : array_like
            Height z of the surface, negative below the land.

        Returns
        -------
        float64 array
            NaN gives NaN.
        """
        slope_s, slope_l = np.asarray(slope_s, np.float64), np.asarray(slope_l, np.float64)
        upright = 1 / np.sqrt(1 + slope_s**2 + slope_l**2)
        ambient, coaxial, oblique, along, across, _, hidden = self.lamps
        facing = np.maximum(0, upright * (1 - slope_s * along - slope_l * across))
        seen = 1 + hidden * np.minimum(np.asarray(height_m, np.float64), 0)
        return np.asarray((ambient + coaxial * upright + oblique * facing) * np.maximum(seen, 0))

    def field(self, *, height_px: int, width_px: int) -> FloatArray:
        """Return the vignetting of a picture, shape (row, column): 1 in the middle, 1 − `vignetting` in the corners."""
        row = np.linspace(-1, 1, height_px)[:, None]
        column = np.linspace(-1, 1, width_px)[None, :]
        # distances are measured in halves of the longer side: a flat picture darkens mostly along its length
        longer = max(height_px, width_px)
        row, column = row * height_px / longer, column * width_px / longer
        return np.asarray(1 - self.vignetting * (row**2 + column**2) / (row.max() ** 2 + column.max() ** 2))
