"""`gramoscope unroll`: a picture of a whole disc in, a capture of photographs out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from gramoscope.cli.terminal import FINE, FINITE, Terminal
from gramoscope.conventions import MICROMETRES_PER_METRE

METRES_PER_INCH = 0.0254


def unroll(
    disc: Path,
    /,
    *,
    out: Path,
    dpi: Annotated[float | None, FINITE] = None,
    pixel_pitch_um: Annotated[float | None, FINITE] = None,
    rpm: str | None = None,
    cut: Literal["lateral", "vertical", "stereo"] = "lateral",
    groove_width_um: Annotated[float, FINITE] = 150.0,
    centre_px: Annotated[tuple[float, float] | None, FINITE] = None,
    inner_px: Annotated[float | None, FINITE] = None,
    outer_px: Annotated[float | None, FINITE] = None,
    turns: int | None = None,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Straighten a picture of a whole disc, from a flatbed scanner or a camera overhead, for `gramoscope play`.

    Centre, ellipse and pitch are measured by the grooves themselves. The capture that comes out shows them side by side, one
    turn and a little more; play it with `gramoscope play CAPTURE --out DIR`.

    Parameters
    ----------
    disc
        PNG, TIFF, JPEG or BMP, as one looks down on the record; not mirrored.
    out
        Folder for the capture; new or empty.
    dpi
        Pixels in an inch, of the scanner.
    pixel_pitch_um
        One pixel, measured on the record; in place of --dpi.
    rpm
        The speed at which the record was meant to turn: a number or a name, as for `gramoscope play`.
    cut
        Direction of the sound.
    groove_width_um
        Nominal, at the land.
    centre_px
        Column and row of the centre, roughly, where it is not found.
    inner_px, outer_px
        Radii between which there are grooves, where they are not found.
    turns
        Only so many turns, from the outermost inwards.
    quiet
        Say nothing.
    json
        Print what was found as JSON.
    """
    from gramoscope.apparatus.unroll import disc_scan
    from gramoscope.apparatus.unroll import unroll as unroll_scan
    from gramoscope.disc.formats import Disc
    from gramoscope.errors import require
    from gramoscope.turntable.speeds import speed_called

    terminal = Terminal(quiet, json)
    require(dpi is None or pixel_pitch_um is None, "--dpi and --pixel-pitch-um", "one of them")
    require(dpi is None or dpi > 0, f"--dpi {dpi}", "above 0")
    pitch_m = None if pixel_pitch_um is None else pixel_pitch_um / MICROMETRES_PER_METRE
    pitch_m = METRES_PER_INCH / dpi if dpi is not None else pitch_m
    known = Disc(cut=cut, groove_width_m=groove_width_um / MICROMETRES_PER_METRE)
    scan = disc_scan(disc, centre_px=centre_px, inner_px=inner_px, outer_px=outer_px, turns=turns)
    with terminal.progress("Unrolling") as progress:
        speed = None if rpm is None else speed_called(rpm).rpm
        manifest = unroll_scan(scan, out, disc=known, pixel_pitch_m=pitch_m, rpm=speed, progress=progress)
    centre = scan.centre
    found = {
        "centre_px": [centre.column_px, centre.row_px],
        "centre_sigma_px": centre.sigma_px,
        "ellipse_px": float((centre.cos2_px**2 + centre.sin2_px**2) ** 0.5),
        "pitch_px": centre.pitch_px,
        "inner_px": scan.inner_px,
        "outer_px": scan.outer_px,
        "turn_px": scan.turn_px,
        "pictures": len(manifest.pictures),
    }
    terminal.result(found)
    terminal.table(
        {
            "centre": f"column {centre.column_px:.2f}, row {centre.row_px:.2f}, ± {centre.sigma_px:.2f} pixels",
            "ellipse": f"radii differ by ± {found['ellipse_px']:.2f} pixels",
            "pitch": f"{centre.pitch_px:.2f} pixels a turn",
            "grooves": f"from {scan.outer_px:.0f} in to {scan.inner_px:.0f} pixels from the centre",
            "turn": f"{scan.turn_px} columns, in {len(manifest.pictures)} pictures",
            "capture": str(out),
        }
    )
    if pitch_m is None:
        terminal.say("[yellow]Note:[/] the scale is not known: the level of the sound will be arbitrary; say --dpi")
    return FINE
