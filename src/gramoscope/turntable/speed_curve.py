"""A speed that changes within a side: the clockwork ran down, the belt slipped.

Between knots of a curve the turns a minute go in a straight line, ω(t) = ω_k + κ_k (t − t_k); before the first and after the
last they stay. The angle turned is its integral, a parabola between knots,

    φ(t) = φ_k + ω_k (t − t_k) + κ_k (t − t_k)²/2,

and since ω is positive everywhere it can be inverted exactly,

    t(φ) = t_k + 2 (φ − φ_k) / (ω_k + √(ω_k² + 2 κ_k (φ − φ_k))).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.errors import require
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speeds import HIGHEST_RPM, LOWEST_RPM


@dataclass(frozen=True)
class SpeedCurve:
    """Turns a minute over time.

    Parameters
    ----------
    time_s : tuple of float
        Knots, rising; times in the sound that comes out, 0 at s = 0.
    rpm : tuple of float
        The speed at each, 10 … 200.
    """

    time_s: tuple[float, ...]
    rpm: tuple[float, ...]

    def __post_init__(self) -> None:
        require(len(self.time_s) == len(self.rpm) >= 1, "a speed curve without points", "a time and a speed for each")
        require(bool(np.all(np.isfinite(self.time_s))), "a speed curve at times that are no numbers", "finite times")
        for before, after in pairwise(self.time_s):
            require(after > before, f"a speed curve goes from {before:g} s to {after:g} s", "times that rise")
        for rpm in self.rpm:
            require(
                LOWEST_RPM <= rpm <= HIGHEST_RPM,
                f"a speed curve with {rpm:g} rpm",
                f"{LOWEST_RPM:g} … {HIGHEST_RPM:g} rpm",
            )

    def rpm_at(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return the turns a minute at a time; NaN gives NaN."""
        return np.asarray(np.interp(np.asarray(time_s, np.float64), self.time_s, self.rpm), np.float64)

    def angle_of_time_rad(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return by how much the record has turned since t = 0; NaN gives NaN."""
        return self._angle_since_first_rad(np.asarray(time_s, np.float64)) - self._offset_rad

    def time_of_angle_s(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return when the record has turned by φ since t = 0; the inverse of `angle_of_time_rad`."""
        angle = np.asarray(angle_rad, np.float64) + self._offset_rad
        k, known = self._piece(self._knots.angle_rad, angle), self._knots
        beyond = angle - known.angle_rad[np.maximum(k, 0)]
        omega, bend = known.omega_rad_s[np.maximum(k, 0)], known.bend(k)
        return known.time_s[np.maximum(k, 0)] + 2 * beyond / (omega + np.sqrt(omega**2 + 2 * bend * beyond))

    @cached_property
    def _knots(self) -> _Knots:
        return _Knots.of(self)

    @cached_property
    def _offset_rad(self) -> float:
        """What was turned from the first knot to t = 0; negative where the curve begins later."""
        return float(self._angle_since_first_rad(np.zeros(1))[0])

    def _angle_since_first_rad(self, time_s: FloatArray) -> FloatArray:
        k, known = self._piece(self._knots.time_s, time_s), self._knots
        beyond = time_s - known.time_s[np.maximum(k, 0)]
        return known.angle_rad[np.maximum(k, 0)] + beyond * (
            known.omega_rad_s[np.maximum(k, 0)] + known.bend(k) * beyond / 2
        )

    @staticmethod
    def _piece(knots: FloatArray, values: FloatArray) -> IntArray:
        """Which piece of the curve each value lies in; −1 before the first knot."""
        return np.asarray(np.searchsorted(knots, values, side="right") - 1, np.int64).clip(-1, knots.size - 1)


@dataclass(frozen=True, eq=False)
class _Knots:
    """The knots in radians, and how ω changes after each; `bend_rad_s2` begins with the 0 of before the first."""

    time_s: FloatArray
    omega_rad_s: FloatArray
    angle_rad: FloatArray
    bend_rad_s2: FloatArray

    @classmethod
    def of(cls, curve: SpeedCurve) -> _Knots:
        time, omega = np.asarray(curve.time_s, np.float64), np.asarray(curve.rpm, np.float64) * (2 * np.pi / 60)
        steps = np.diff(time)
        angle = np.concatenate([[0.0], np.cumsum((omega[1:] + omega[:-1]) / 2 * steps)])
        return cls(time, omega, angle, np.concatenate([[0.0], np.diff(omega) / steps, [0.0]]))

    def bend(self, piece: IntArray) -> FloatArray:
        return self.bend_rad_s2[piece + 1]


@dataclass(frozen=True)
class DriftingRotation(Rotation):
    """A rotation whose speed follows a curve.

    Parameters
    ----------
    rpm : float
        The speed at s = 0, as the curve says; see `following`.
    radius_m, pitch_m : float
        See `Rotation`.
    curve : SpeedCurve
    """

    curve: SpeedCurve = SpeedCurve((0.0,), (78.0,))

    @classmethod
    def following(cls, curve: SpeedCurve, rotation: Rotation) -> Self:
        """Return the spiral of a rotation, turned as the curve says."""
        return cls(float(curve.rpm_at(0.0)), rotation.radius_m, rotation.pitch_m, curve)

    def angle_of_time_rad(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return by how much the record has turned at a time, ∫ ω dt."""
        return self.curve.angle_of_time_rad(time_s)

    def time_of_angle_s(self, angle_rad: npt.ArrayLike) -> FloatArray:
        """Return when the record has turned by φ."""
        return self.curve.time_of_angle_s(angle_rad)

    def speed_at_m_s(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return the groove speed V = ω(t(s)) r(s)."""
        return self.curve.rpm_at(self.time_of_arc_s(arc_m)) * (2 * np.pi / 60) * self.radius_at_m(arc_m)

    def fastest_m_s(self, arc_m: float) -> float:
        """Return a groove speed that is nowhere passed from the place s inwards."""
        return 2 * np.pi / 60 * max(self.curve.rpm) * float(self.radius_at_m(arc_m))

    def in_words(self) -> str:
        """Return how the record turns, for the archive."""
        low, high = min(self.curve.rpm), max(self.curve.rpm)
        return f"{low:g} to {high:g} rpm by a curve of {len(self.curve.rpm)} points"
