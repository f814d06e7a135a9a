"""The thin cover glass over half the field, which gives the objective a second focal plane (paper, section 5).

A plane plate of thickness d and index n moves the point where a ray of angle θ meets the axis away from the lens by

    δ(θ) = d (1 − tan θ′/tan θ) = d (1 − cos θ / (n cos θ′)),      sin θ = n sin θ′.

The paper prints equation 2 without the factor d, and calls the index λ; its equation 3 is the paraxial limit θ → 0. Rays
at the rim of a 0.65 aperture are shifted a third more than the paraxial ones: the plate adds spherical aberration, and
where a real rig finds its second plane is best *calibrated* with `CoverGlass.focus_shift_m`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require

Side = Literal["low", "high"]


def shift_paraxial_m(thickness_m: float, *, refractive_index: float) -> float:
    """Return δ = d (1 − 1/n), equation 3 of the paper."""
    return thickness_m * (1 - 1 / refractive_index)


def shift_exact_m(thickness_m: float, angle_rad: npt.ArrayLike, *, refractive_index: float) -> FloatArray:
    """Return the shift of the ray that meets the glass at an angle, equation 2 of the paper with its missing factor d.

    Parameters
    ----------
    thickness_m : float
        Thickness d of the glass.
    angle_rad : array_like
        Angle θ of the ray in air, |θ| < π/2. NaN gives NaN.
    refractive_index : float
        n of the glass, at least 1.

    Returns
    -------
    float64 array, same shape as `angle_rad`
        δ, positive away from the lens.
    """
    angle = np.asarray(angle_rad, np.float64)
    inside = np.arcsin(np.sin(angle) / refractive_index)
    return np.asarray(thickness_m * (1 - np.cos(angle) / (refractive_index * np.cos(inside))), np.float64)


@dataclass(frozen=True)
class CoverGlass:
    """The cover glass of the dual-focal objective.

    Parameters
    ----------
    thickness_m : float
        d, positive.
    refractive_index : float
        n, above 1.
    side : {"low", "high"}
        Whether the glass covers the canonical rows below or above its edge.
    edge_row : float, optional
        Nominal canonical row of the edge; None when nobody has measured it.
    focus_shift_m : float, optional
        Calibrated shift of the sharp plane; wins over the one computed from the glass.
    """

    thickness_m: float = 0.11e-3
    refractive_index: float = 1.515
    side: Side = "low"
    edge_row: float | None = None
    focus_shift_m: float | None = None

    def __post_init__(self) -> None:
        require(self.thickness_m > 0, f"the glass is {self.thickness_m} m thick", "a positive thickness")
        require(self.refractive_index > 1, f"the index of the glass is {self.refractive_index}", "a number above 1")
        require(self.side in ("low", "high"), f"the glass lies on side {self.side!r}", '"low" or "high"')

    @property
    def shift_m(self) -> float:
        """How much deeper the sharp plane lies through the glass: calibrated if known, else paraxial."""
        if self.focus_shift_m is not None:
            return self.focus_shift_m
        return shift_paraxial_m(self.thickness_m, refractive_index=self.refractive_index)
