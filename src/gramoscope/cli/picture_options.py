"""Options that say what a single picture is, in place of a `capture.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from gramoscope.cli.terminal import FINITE
from gramoscope.conventions import MICROMETRES_PER_METRE, MILLIMETRES_PER_METRE

if TYPE_CHECKING:
    from gramoscope.apparatus.manifest_still import StillManifest


@Parameter(name="*")
@dataclass(frozen=True)
class PictureOptions:
    """What is known of a picture without `capture.toml`.

    Parameters
    ----------
    pixel_pitch_um
        Of a picture: one pixel, measured on the record. When nobody knows, one pixel is taken for 4 µm.
    radius_mm
        Of a picture: radius of its grooves. When nobody knows, 115 mm.
    groove_along
        Of a picture: columns if grooves run from side to side, rows if they run up and down. Found by itself when left out.
    along
        Of a picture: forward if the groove plays from left to right, or from top to bottom.
    across
        Of a picture: inward if the centre of the record lies below, or to the right. As a photograph taken from above shows it
        when left out; say it of a mirrored one, or left and right channels change places.
    turn_px
        Of a picture that shows whole turns side by side: pixels in a turn. Each groove then goes on as the next.
    cut
        Of a picture: direction of the sound.
    wall_angle_deg
        Of a picture: angle of each wall against the land. It says how far edges move apart when the groove gets deeper, and so
        which part of their motion goes to which channel of a stereo record. When left out, test tones tell it where each wall
        has its own; else it is 45.
    """

    pixel_pitch_um: Annotated[float | None, FINITE] = None
    radius_mm: Annotated[float | None, FINITE] = None
    groove_along: Literal["columns", "rows"] | None = None
    along: Literal["forward", "backward"] = "forward"
    across: Literal["inward", "outward"] | None = None
    turn_px: Annotated[float | None, FINITE] = None
    cut: Literal["lateral", "vertical", "stereo"] = "lateral"
    wall_angle_deg: Annotated[float | None, FINITE] = None

    def manifest(self, rpm: str | None = None) -> StillManifest:
        """Return what is known, in SI units."""
        from gramoscope.apparatus.manifest_still import StillManifest
        from gramoscope.apparatus.still_bench import Row
        from gramoscope.conventions import rad
        from gramoscope.disc.formats import Disc
        from gramoscope.errors import require
        from gramoscope.turntable.speeds import speed_called

        for name, value in (("--pixel-pitch-um", self.pixel_pitch_um), ("--radius-mm", self.radius_mm)):
            require(value is None or value > 0, f"{name} {value}", "a positive length")
        angle_deg = self.wall_angle_deg
        require(angle_deg is None or 0 < angle_deg < 90, f"--wall-angle-deg {angle_deg}", "above 0, below 90")
        return StillManifest(
            pictures=(),
            disc=Disc(cut=self.cut) if angle_deg is None else Disc(cut=self.cut, wall_angle_rad=rad(angle_deg)),
            wall_angle_known=angle_deg is not None,
            pixel_pitch_m=None if self.pixel_pitch_um is None else self.pixel_pitch_um / MICROMETRES_PER_METRE,
            rpm=None if rpm is None else speed_called(rpm).rpm,
            radius_m=None if self.radius_mm is None else self.radius_mm / MILLIMETRES_PER_METRE,
            groove_along=self.groove_along,
            along=self.along,
            across=self.across,
            row=Row(turn_px=self.turn_px),
        )


AS_IT_IS = PictureOptions()
