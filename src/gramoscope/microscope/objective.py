"""A microscope objective as a thin lens (paper, sections 3 and 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.errors import require


@dataclass(frozen=True)
class Objective:
    """A microscope objective.

    Parameters
    ----------
    magnification : float
        Lateral magnification, e.g. 40.
    numerical_aperture : float
        sin of the half angle of the light cone, in air, 0 … 1.
    tube_length_m : float
        Image distance (the paper's "barrel length" u), 0.160 for a classic stand.
    """

    magnification: float = 40.0
    numerical_aperture: float = 0.65
    tube_length_m: float = 0.160

    def __post_init__(self) -> None:
        require(self.magnification > 0, f"the magnification is {self.magnification}", "a positive number")
        require(
            0 < self.numerical_aperture < 1,
            f"the numerical aperture is {self.numerical_aperture}",
            "a number between 0 and 1 (the light crosses air)",
        )
        require(self.tube_length_m > 0, f"the tube length is {self.tube_length_m} m", "a positive length")

    @property
    def object_distance_m(self) -> float:
        """Distance from the lens to the sharp plane, v = u/M (paper, section 3)."""
        return self.tube_length_m / self.magnification

    @property
    def focal_length_m(self) -> float:
        """F = 1/(1/u + 1/v), the thin lens equation (paper, section 3)."""
        return 1 / (1 / self.tube_length_m + 1 / self.object_distance_m)

    @property
    def half_angle_rad(self) -> float:
        """Half angle of the light cone in air, θ = asin NA."""
        return float(np.arcsin(self.numerical_aperture))

    @property
    def blur_radius_per_defocus(self) -> float:
        """Radius of the blur disc on the object side for a unit of defocus, tan(asin NA)."""
        return float(np.tan(self.half_angle_rad))

    def depth_of_field_m(
        self, *, wavelength_m: float = 0.55e-6, resolved_m: float = 0.0, refractive_index: float = 1.0
    ) -> float:
        """Return the depth of field, λn/NA² + n e/NA.

        Parameters
        ----------
        wavelength_m : float
            Of the light; 0.55 µm is the middle of the visible.
        resolved_m : float
            Smallest distance that the detector resolves, referred to the object (pixel pitch for a camera); 0 leaves the
            purely optical term, which for a 40X/0.65 gives the paper's 1 µm (section 4).
        refractive_index : float
            Of the medium between lens and object.

        Returns
        -------
        float
            Total depth, metres.

        References
        ----------
        S. Inoué and K. Spring, Video Microscopy, 2nd ed., 1997, section 2.5.
        """
        aperture = self.numerical_aperture
        return refractive_index * (wavelength_m / aperture**2 + resolved_m / aperture)

    def resolution_m(self, *, wavelength_m: float = 0.55e-6) -> float:
        """Return the Rayleigh resolution, 0.61 λ/NA."""
        return 0.61 * wavelength_m / self.numerical_aperture
