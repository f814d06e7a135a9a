"""Angle, radius and time: a groove is a spiral that turns at constant angular speed.

With radius r₀ at s = 0 and a pitch p lost each turn, dr/dφ = −p/2π and ds = r dφ give r(s) = √(r₀² − p s/π), and the time
since s = 0 is φ/ω. Without a pitch the groove is a circle and time is s/(ω r₀).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require


@dataclass(frozen=True)
class Rotation:
    """How the record was meant to turn.

    Parameters
    ----------
    rpm : float
        Turns a minute, positive.
    radius_m : float
        Radius of the groove at s = 0, positive.
    pitch_m : float
        Radius lost in one turn; 0 for a closed circle.
    """

    rpm: float
    radius_m: float
    pitch_m: float = 0.0

    def __post_init__(self) -> None:
        require(self.rpm > 0, f"the record turns at {self.rpm} rpm", "a positive speed", "78 for most shellac discs")
        require(self.radius_m > 0, f"the groove's radius is {self.radius_m} m", "a positive radius")
        require(self.pitch_m >= 0, f"the pitch is {self.pitch_m} m", "a pitch of zero or more (grooves run inwards)")

    @property
    def angular_speed_rad_s(self) -> float:
        """ω = 2π rpm / 60."""
        return 2 * np.pi * self.rpm / 60

    def radius_at_m(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return the radius of the groove at the place s.

        Parameters
        ----------
        arc_m : array_like
            Place along the groove; may be negative (before the first frame). NaN gives NaN.

        Returns
        -------
        float64 array, same shape
            r(s) = √(r₀² − p s/π).

        Raises
        ------
        ArgumentError
            If the groove would have reached the centre of the disc before some `arc_m`.
        """
        squared = self.radius_m**2 - self.pitch_m * np.asarray(arc_m, np.float64) / np.pi
        require(
            not bool(np.any(squared <= 0)),
            f"the groove starts at radius {self.radius_m * 1e3:g} mm and loses {self.pitch_m * 1e6:g} µm a turn",
            "places before the centre of the disc",
            "check radius_mm and pitch_um",
        )
        return np.asarray(np.sqrt(squared), np.float64)

    def speed_at_m_s(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return the groove speed V = ω r(s) (paper, section 7)."""
        return self.angular_speed_rad_s * self.radius_at_m(arc_m)

    def angle_of_arc_rad(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return by how much the record has turned when the stylus is at the place s; 0 at s = 0.

        φ(s) = (r₀ − r(s)) 2π/p = 2 s / (r₀ + r(s)).
        """
        arc = np.asarray(arc_m, np.float64)
        # the second form: nothing cancels when the pitch is small
        return 2 * arc / (self.radius_m + self.radius_at_m(arc))

    def arc_of_angle_m(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return the place under the stylus when the record has turned by φ; the inverse of `angle_of_arc_rad`."""
        turned = np.asarray(angle_rad, np.float64)
        return turned * (self.radius_m - self.pitch_m * turned / (4 * np.pi))

    def angle_of_time_rad(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return by how much the record has turned at a time, ω t."""
        return np.asarray(time_s, np.float64) * self.angular_speed_rad_s

    def time_of_angle_s(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return when the record has turned by φ; the inverse of `angle_of_time_rad`."""
        return np.asarray(angle_rad, np.float64) / self.angular_speed_rad_s

    def time_of_arc_s(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return the time at which the stylus passes the place s; 0 at s = 0."""
        return self.time_of_angle_s(self.angle_of_arc_rad(arc_m))

    def arc_of_time_m(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return the place that the stylus has reached at a time; the inverse of `time_of_arc_s`."""
        return self.arc_of_angle_m(self.angle_of_time_rad(time_s))

    def fastest_m_s(self, arc_m: float) -> float:
        """Return the greatest groove speed from the place s inwards."""
        return float(self.speed_at_m_s(arc_m))

    def in_words(self) -> str:
        """Return how the record turns, for the archive."""
        return f"{self.rpm:g} rpm"


def pixel_rate_hz(groove_speed_m_s: float, *, pixel_pitch_m: float) -> float:
    """Return how many pixels pass the stylus in a second, f = V/Δ (paper, section 7)."""
    return groove_speed_m_s / pixel_pitch_m
