"""The course of a groove: what is known of it before the tonearm is lowered."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.turntable.rotation import Rotation


@dataclass(frozen=True)
class Course:
    """What is known of a passage before it is followed.

    Parameters
    ----------
    rotation : Rotation
        For the groove speed, which turns slopes into velocities.
    direction : {"lateral", "vertical"}
        What to listen to.
    wall_angle_rad : float or (float, float)
        φ of both walls, or of the inner and of the outer one.
    passage_length_m : float
        Where the passage ends, nominally; the last stretch may know better.
    """

    rotation: Rotation
    direction: Direction
    wall_angle_rad: float | tuple[float, float]
    passage_length_m: float

    @property
    def wall_angles_rad(self) -> FloatArray:
        """φ of the inner and of the outer wall."""
        return np.broadcast_to(np.asarray(self.wall_angle_rad, np.float64), 2)

    @cached_property
    def gains(self) -> FloatArray:
        """How far the inner and the outer wall move towards +l when the groove rises by one: ∓ cot φ."""
        return np.array([-1.0, 1.0]) / np.tan(self.wall_angles_rad)
