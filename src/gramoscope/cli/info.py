"""`gramoscope info`: what is in a capture, and what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gramoscope.cli.terminal import FINE, FOUND_WRONG, Terminal

if TYPE_CHECKING:
    from gramoscope.apparatus.inspection import Inspection

SHOWN_GROUPS = 10


def info(capture: Path, /, *, quick: bool = False, quiet: bool = False, json: bool = False) -> int:
    """Say what is in a capture, what is wrong with it, and what it will sound like (rate, seconds).

    Exit code 1 when something is wrong: lost or useless frames, groups that do not overlap, stripes outside the picture.

    Parameters
    ----------
    capture
        Folder with `capture.toml` and frames or pictures, or one picture.
    quick
        Read a few groups only, and see whether the other files are there.
    quiet
        Say nothing; the exit code tells.
    json
        Print everything as JSON.
    """
    from gramoscope.apparatus.inspection import inspect
    from gramoscope.apparatus.opening import opened
    from gramoscope.apparatus.still import StillCapture
    from gramoscope.cli.info_still import info_still

    terminal = Terminal(quiet, json)
    found_there = opened(capture)
    if isinstance(found_there, StillCapture):
        return info_still(found_there, terminal, quick=quick)
    with terminal.progress("Looking") as progress:
        found = inspect(found_there, quick=quick, progress=progress)
    terminal.result({**found.as_dict(), "sound": found.sound})
    _tell(terminal, found)
    return FINE if found.sound else FOUND_WRONG


def _tell(terminal: Terminal, found: Inspection) -> None:
    bench = found.bench
    sensor, glass = bench.sensor, bench.cover_glass
    overlap = "–" if found.overlap_m is None else f"{found.overlap_m * 1e6:.1f} µm"
    terminal.table(
        {
            "capture": f"{found.folder} ({found.layout}, {found.size_bytes / 1e6:.0f} MB)",
            "disc": f"{bench.disc.cut} cut, {bench.rotation.rpm:g} rpm, radius {bench.rotation.radius_m * 1e3:g} mm, "
            f"groove {bench.disc.groove_width_m * 1e6:g} µm wide",
            "recorded with": bench.disc.characteristic or "unknown characteristic",
            "microscope": f"{bench.objective.magnification:g}X/{bench.objective.numerical_aperture:g}, sharp "
            + f"{bench.focus_below_land_m * 1e6:.1f} µm below the land"
            + (f", {bench.focus_through_glass_m * 1e6:.1f} µm through the glass" if glass else ", no cover glass"),
            "camera": f"{sensor.width_px} × {sensor.height_px}, {sensor.bits} bit {sensor.colour}, "
            f"{sensor.pixel_pitch_m * 1e6:.4f} µm a pixel, columns {sensor.columns}, rows {sensor.rows}",
            "frames": f"{found.frames_found} of {found.frames_expected} in {found.groups_expected} groups"
            + ("" if found.complete else " (a sample was read)"),
            "overlap": overlap,
            "sharp stripes at rows": ", ".join(f"{row:.0f}" for row in found.stripe_rows) + " for a groove at rest",
            "sound": f"{found.seconds:.3f} s from {found.passage_m * 1e3:.2f} mm of groove at "
            f"{found.groove_speed_m_s * 1e3:.1f} mm/s; {found.pixel_rate_hz / 1e3:.1f} kpixel/s, 96 kHz by default",
        }
    )
    for finding in found.findings:
        terminal.say(f"[yellow]Found:[/] {finding}")
    for group in found.groups[:SHOWN_GROUPS]:
        terminal.say(f"[yellow]Found:[/] {'; '.join(group.problems)}")
    if len(found.groups) > SHOWN_GROUPS:
        terminal.say(
            f"[yellow]Found:[/] {len(found.groups) - SHOWN_GROUPS} more groups with problems; --json lists all"
        )
    if found.sound:
        terminal.say("[green]Nothing wrong was found.[/]")
