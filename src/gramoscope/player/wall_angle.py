"""At which angle the walls in photographs are taken to stand: as somebody says, as test tones tell, or at 45°."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gramoscope.pickup.edges.wall_angle import WallAngleFinding, wall_angle
from gramoscope.player.row_of_pictures import Stretch
from gramoscope.signal_path import GrooveEdges

MOST_STRETCHES = 24
"""So many, spread over all that there are, are looked at."""


@dataclass(frozen=True)
class WallAngle:
    """What is known of the angle of the walls.

    Attributes
    ----------
    stated_rad : float
        By the capture, or 45° where it says nothing.
    known : bool
        Whether somebody said so; then it counts, whatever the tones tell.
    found : WallAngleFinding
    """

    stated_rad: float
    known: bool = True
    found: WallAngleFinding = field(default_factory=WallAngleFinding)

    @property
    def told(self) -> bool:
        """Whether test tones have the last word."""
        return not self.known and self.found.reason is None

    @property
    def rad(self) -> float:
        """The angle that counts."""
        return self.found.angle_rad if self.told else self.stated_rad

    def as_dict(self) -> dict[str, Any]:
        """Return what the report says of it, as part of the calibration."""
        found = self.found
        told = found.reason is None
        tones = zip(("inner", "outer"), found.period_px, found.crosstalk, found.crosstalk_sigma, strict=True)
        return {
            "wall_angle_deg": {
                "manifest": float(np.rad2deg(self.stated_rad)) if self.known else None,
                "by_test_tones": float(np.rad2deg(found.angle_rad)) if told else None,
                "sigma": float(np.rad2deg(found.sigma_rad)) if told else None,
                "taken": float(np.rad2deg(self.rad)),
                "stretches": found.stretches,
                "test_tones": [
                    {"wall": wall, "period_px": period, "crosstalk": crosstalk, "sigma": sigma}
                    for wall, period, crosstalk, sigma in tones
                    if told
                ],
                "reason": found.reason,
            }
        }

    def remarks(self) -> Iterator[str]:
        """Say what was done, if anything was."""
        if self.told:
            inner_px, outer_px = self.found.period_px
            angle_deg, sigma_deg = np.rad2deg((self.rad, self.found.sigma_rad))
            yield (
                f"walls were taken to stand at {angle_deg:.1f} ± {sigma_deg:.1f}°: each has a tone of its own (periods of "
                f"{outer_px:.1f} pixels on the outer wall, {inner_px:.1f} on the inner one), and both tones move the other "
                f"edge, too, by {np.mean(self.found.crosstalk):.3f} of their swing, as they do at that angle; to take nothing "
                "off, say that walls stand at 45° (--wall-angle-deg 45, or wall_angle_deg in capture.toml)"
            )


def wall_angle_of(
    stated_rad: float, known: bool, passages: Sequence[Sequence[Stretch]], edges_of: Callable[[Stretch], GrooveEdges]
) -> WallAngle:
    """Return the angle of the walls of photographs, by the edges of stretches spread over all passages."""
    stretches = [stretch for passage in passages for stretch in passage]
    chosen = np.unique(np.linspace(0, len(stretches) - 1, min(len(stretches), MOST_STRETCHES)).round().astype(int))
    return WallAngle(stated_rad, known, wall_angle([edges_of(stretches[number]) for number in chosen]))
