"""The parts bolted together: what the apparatus is, as opposed to what we choose to do with it (`player.recipe`).

Everything here is *nominal* and canonical (see `gramoscope.conventions`): it comes from `capture.toml`, was measured with a
ruler or read off an objective, and the frames may tell a different truth.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import INNER, OUTER, row_of_lateral_px
from gramoscope.disc.formats import Disc
from gramoscope.errors import require
from gramoscope.microscope.cover_glass import CoverGlass
from gramoscope.microscope.focus import stripe_distance_from_middle_m
from gramoscope.microscope.objective import Objective
from gramoscope.turntable.rotation import Rotation

DEFAULT_FOCUS_BELOW_LAND_M = 20e-6
"""Where the sharp plane lies without glass when the manifest does not say: a guess that suits 78s."""


@dataclass(frozen=True)
class Sequence:
    """How the film was taken.

    Parameters
    ----------
    groups : int
        Stretches filmed.
    frames_per_group : int
    frame_step_m : float
        How far the groove moves between frames of a group, nominal; 0 or more.
    group_step_m : float
        From the start of one group to the start of the next, nominal; positive.
    """

    groups: int = 1
    frames_per_group: int = 12
    frame_step_m: float = 0.8e-6
    group_step_m: float = 469.53e-6

    def __post_init__(self) -> None:
        require(self.groups >= 1, f"{self.groups} groups", "at least one")
        require(self.frames_per_group >= 1, f"{self.frames_per_group} frames in a group", "at least one")
        require(self.frame_step_m >= 0, f"a frame step of {self.frame_step_m} m", "zero or more")
        require(self.group_step_m > 0, f"a group step of {self.group_step_m} m", "a positive length")


@dataclass(frozen=True)
class Stripe:
    """A place where a wall is sharp.

    Attributes
    ----------
    wall : int
        `INNER` or `OUTER`.
    depth_below_land_m : float
        Where the wall is sharp.
    row : float
        Canonical row, for a groove at rest.
    through_glass : bool
    """

    wall: int
    depth_below_land_m: float
    row: float
    through_glass: bool


@dataclass(frozen=True)
class Bench:
    """Disc, turntable, microscope, glass and camera, bolted together.

    `focus_below_land_m` is the depth of the sharp plane below the land, without glass.
    """

    disc: Disc = field(default_factory=Disc)
    rotation: Rotation = field(default_factory=lambda: Rotation(rpm=78.0, radius_m=0.115))
    objective: Objective = field(default_factory=Objective)
    cover_glass: CoverGlass | None = field(default_factory=CoverGlass)
    sensor: Sensor = field(default_factory=Sensor)
    sequence: Sequence = field(default_factory=Sequence)
    focus_below_land_m: float = DEFAULT_FOCUS_BELOW_LAND_M

    @property
    def focus_through_glass_m(self) -> float:
        """Depth of the sharp plane below the land, seen through the glass; without a glass, the plain one."""
        return self.focus_below_land_m + (self.cover_glass.shift_m if self.cover_glass else 0.0)

    @property
    def glass_edge_row(self) -> float:
        """Canonical row of the glass edge: measured if known, else the middle of the picture."""
        if self.cover_glass is not None and self.cover_glass.edge_row is not None:
            return self.cover_glass.edge_row
        return (self.sensor.height_px - 1) / 2

    @property
    def passage_length_m(self) -> float:
        """From s = 0 to the last column of the last frame, nominal."""
        sequence, sensor = self.sequence, self.sensor
        return (
            (sequence.groups - 1) * sequence.group_step_m
            + (sequence.frames_per_group - 1) * sequence.frame_step_m
            + (sensor.width_px - 1) * sensor.pixel_pitch_m
        )

    def stripes(self, groove_middle_m: float = 0.0) -> tuple[Stripe, ...]:
        """Return the sharp stripes that are expected of a groove at rest, by rising row.

        Parameters
        ----------
        groove_middle_m : float
            Lateral place l of the middle of the groove; 0 is the middle of the picture.

        Returns
        -------
        tuple of Stripe
            Three for a dual-focal objective: both walls through the glass, and one wall once more beside it; two without
            a glass. A row may lie outside the picture. Whether the glass edge hides one is not considered.
        """
        glass = self.cover_glass
        places = [(wall, self.focus_through_glass_m, glass is not None) for wall in (OUTER, INNER)]
        if glass is not None:
            places.append((INNER if glass.side == "low" else OUTER, self.focus_below_land_m, False))
        stripes = (
            Stripe(wall, depth, self._row_of(wall, depth, groove_middle_m), through) for wall, depth, through in places
        )
        return tuple(sorted(stripes, key=lambda stripe: stripe.row))

    def _row_of(self, wall: int, depth_m: float, groove_middle_m: float) -> float:
        distance_m = stripe_distance_from_middle_m(
            depth_m, groove_width_m=self.disc.groove_width_m, wall_angle_rad=self.disc.wall_angle_rad
        )
        lateral_m = groove_middle_m + (distance_m if wall == INNER else -distance_m)
        sensor = self.sensor
        return float(row_of_lateral_px(lateral_m, height_px=sensor.height_px, pixel_pitch_m=sensor.pixel_pitch_m))

    def as_dict(self) -> dict[str, Any]:
        """Return the apparatus in plain numbers, SI units."""
        return {**asdict(self), "focus_through_glass_m": self.focus_through_glass_m, "stripe_rows": self.stripe_rows()}

    def stripe_rows(self, groove_middle_m: float = 0.0) -> tuple[float, ...]:
        """Return the canonical rows of `stripes`, in rising order."""
        return tuple(stripe.row for stripe in self.stripes(groove_middle_m))
