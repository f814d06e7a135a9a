"""What kind of disc it is: cut, nominal groove, and the words an archive keeps with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gramoscope.errors import require

Cut = Literal["lateral", "vertical", "stereo"]
Direction = Literal["lateral", "vertical"]


def direction_of_cut(cut: Cut) -> Direction:
    """Return the direction of motion that is the sound; a stereo groove played as mono is its lateral motion."""
    return "vertical" if cut == "vertical" else "lateral"


@dataclass(frozen=True)
class Disc:
    """A record, as far as anybody knows before it was filmed.

    Parameters
    ----------
    cut : {"lateral", "vertical", "stereo"}
        Direction of the sound: across the groove, up and down (hill-and-dale), or 45/45.
    groove_width_m : float
        At the land, nominal.
    wall_angle_rad : float
        Of each wall against the land, nominal, 0 … π/2.
    characteristic : str, optional
        The recording characteristic, when it is known.
    notes : dict
        Free text for the archive: title, performer, label, matrix, side, date.
    """

    cut: Cut = "lateral"
    groove_width_m: float = 150e-6
    wall_angle_rad: float = np.pi / 4
    characteristic: str | None = None
    notes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require(
            self.cut in ("lateral", "vertical", "stereo"), f"cut is {self.cut!r}", '"lateral", "vertical" or "stereo"'
        )
        require(self.groove_width_m > 0, f"the groove is {self.groove_width_m} m wide", "a positive width")
        require(0 < self.wall_angle_rad < np.pi / 2, f"the walls stand at {self.wall_angle_rad} rad", "0 … π/2")
