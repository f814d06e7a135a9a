"""The apparatus of a photograph: a record, a camera, and how its pictures lie along the groove.

Nobody needs a rig for a photograph, and often nobody knows its scale. What is not known is assumed, by one rule for all
photographs, and `assumed` says so: one pixel is `ASSUMED_PIXEL_PITCH_M`, and the record turns at `ASSUMED_RPM` with the
groove at `ASSUMED_RADIUS_M`, as in the paper. The sound is then the groove's, on a time base and at a level that are not.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import MICROMETRES_PER_METRE, MILLIMETRES_PER_METRE, Columns, Rows
from gramoscope.disc.formats import Disc
from gramoscope.errors import require
from gramoscope.turntable.rotation import Rotation

ASSUMED_PIXEL_PITCH_M = 4e-6
"""Edges resolve waves down to a dozen pixels or so, which sound at 20 kHz then: what a picture shows can be heard."""
ASSUMED_RPM = 78.0
ASSUMED_RADIUS_M = 0.115

Axis = Literal["columns", "rows"]
"""Along which index of a stored picture the groove runs: "columns" from side to side, "rows" up and down."""


def sense_across(groove_along: Axis, along: Columns) -> Rows:
    """Return whether l grows or falls with the other index, in a photograph that was taken from above and not mirrored.

    The groove frame is right-handed (`gramoscope.conventions`): whoever travels with s has the centre of the disc to the left.
    """
    rising = (groove_along == "rows") == (along == "forward")
    return "inward" if rising else "outward"


@dataclass(frozen=True)
class Row:
    """How the pictures lie along the groove.

    Parameters
    ----------
    pictures : int
    step_px : float
        From the start of one picture to the start of the next, nominal; 0 for one picture.
    turn_px : float or None
        Columns in a whole turn, after which each groove goes on as the next one; None where the pictures do not show one.
    """

    pictures: int = 1
    step_px: float = 0.0
    turn_px: float | None = None

    def __post_init__(self) -> None:
        require(self.pictures >= 1, f"{self.pictures} pictures", "at least one")
        require(
            self.step_px > 0 or self.pictures == 1, f"a step of {self.step_px} pixels between pictures", "more than 0"
        )
        require(self.turn_px is None or self.turn_px > 0, f"a turn of {self.turn_px} pixels", "more than 0")


@dataclass(frozen=True)
class StillBench:
    """Record, camera and row of pictures of a photograph.

    Parameters
    ----------
    disc : Disc
    rotation : Rotation
        Of a circle: places count along it. With `Row.turn_px` its radius is that of one turn of so many pixels.
    sensor : Sensor
        Of the canonical picture; the first one has its size.
    groove_along : {"columns", "rows"}
        In the stored picture.
    row : Row
    assumed : tuple of str
        What nobody knows, in words, with the value that stands for it.
    found_direction : bool
        Whether `groove_along` was found in the picture, and not told.
    """

    disc: Disc = field(default_factory=Disc)
    rotation: Rotation = field(default_factory=lambda: Rotation(ASSUMED_RPM, ASSUMED_RADIUS_M))
    sensor: Sensor = field(default_factory=lambda: Sensor(pixel_pitch_m=ASSUMED_PIXEL_PITCH_M))
    groove_along: Axis = "columns"
    row: Row = field(default_factory=Row)
    assumed: tuple[str, ...] = ()
    found_direction: bool = False

    cover_glass = None
    """A photograph has none."""

    @property
    def passage_length_m(self) -> float:
        """From the first to the last column of the row, nominal: of one groove, before turns are joined."""
        columns = (self.row.pictures - 1) * self.row.step_px + self.sensor.width_px - 1
        return columns * self.sensor.pixel_pitch_m

    def as_dict(self) -> dict[str, Any]:
        """Return the apparatus in plain numbers, SI units."""
        return asdict(self)


def scale_of(
    *, pixel_pitch_m: float | None, rpm: float | None, radius_m: float | None, turn_px: float | None
) -> tuple[float, Rotation, tuple[str, ...]]:
    """Return pixel pitch and rotation, with what was assumed, in words.

    Parameters
    ----------
    pixel_pitch_m, rpm, radius_m : float or None
        As far as they are known.
    turn_px : float or None
        Pixels in a turn, which fix the radius of the circle that places count along: time and velocity of a spiral are
        right then in all its turns, since angle is what a column stands for.
    """
    pitch_m = ASSUMED_PIXEL_PITCH_M if pixel_pitch_m is None else pixel_pitch_m
    assumed = []
    if pixel_pitch_m is None:
        assumed.append(f"one pixel is {pitch_m * MICROMETRES_PER_METRE:g} µm")
    if rpm is None:
        assumed.append(f"the record turns at {ASSUMED_RPM:g} rpm")
    if turn_px is not None:
        radius_m = turn_px * pitch_m / (2 * np.pi)
    elif radius_m is None:
        radius_m = ASSUMED_RADIUS_M
        assumed.append(f"the groove has a radius of {radius_m * MILLIMETRES_PER_METRE:g} mm")
    return pitch_m, Rotation(ASSUMED_RPM if rpm is None else rpm, radius_m), tuple(assumed)
