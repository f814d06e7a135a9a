"""`gramoscope info`: what is in a capture, and what is wrong with it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from gramoscope.cli.terminal import FINE, FOUND_WRONG, PROCESSORS, Terminal, Workers

if TYPE_CHECKING:
    from gramoscope.apparatus.inspection import Inspection
    from gramoscope.player.plan import Plan

SHOWN_GROUPS = 10


def info(
    capture: Path,
    /,
    *,
    quick: bool = False,
    plan: bool = False,
    recipe: str = "best",
    workers: Workers = PROCESSORS,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Say what is in a capture, what is wrong with it, and what it will sound like (rate, seconds).

    Exit code 1 when something is wrong: lost or useless frames, groups that do not overlap, stripes outside the picture.

    Parameters
    ----------
    capture
        Folder with `capture.toml` and frames or pictures, or one picture.
    quick
        Read a few groups only, and see whether the other files are there.
    plan
        Say what it takes to play it: disk, time and memory. The passage is learned and a few groups are read, to see how fast
        this machine is.
    recipe
        For the plan: how to read.
    workers
        For the plan: stretches read at the same time.
    quiet
        Say nothing; the exit code tells.
    json
        Print everything as JSON.
    """
    from gramoscope.apparatus.inspection import inspect
    from gramoscope.apparatus.opening import opened
    from gramoscope.apparatus.still import StillCapture
    from gramoscope.cli.info_still import info_still
    from gramoscope.player.plan import plan_of
    from gramoscope.player.recipe import load_recipe

    terminal = Terminal(quiet, json)
    found_there = opened(capture)
    if isinstance(found_there, StillCapture):
        return info_still(found_there, terminal, quick=quick)
    with terminal.progress("Looking") as progress:
        found = inspect(found_there, quick=quick, progress=progress)
    planned = plan_of(found_there, load_recipe(recipe), workers) if plan else None
    terminal.result({**found.as_dict(), "sound": found.sound, **({"plan": asdict(planned)} if planned else {})})
    _tell(terminal, found)
    if planned is not None:
        _tell_plan(terminal, planned)
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


def _tell_plan(terminal: Terminal, plan: Plan) -> None:
    workers, more = plan.workers, 16 * plan.workers
    terminal.table(
        {
            "frames": f"{plan.frames_bytes / 1e9:.2f} GB in {plan.groups} groups",
            "disk": f"{plan.store_bytes / 1e9:.2f} GB for the reading until the transfer is whole, "
            f"{plan.sound_bytes / 1e9:.3f} GB of sound at 96 kHz",
            "memory": f"{plan.working_bytes / 1e9:.2f} GB for the pieces of {workers} workers, whatever the length",
            "learning": f"{plan.learning_s:.0f} s, once",
            "time": f"{plan.group_s * 1e3:.0f} ms a group and worker: {_duration(plan.playing_s(workers))} with {workers}, "
            f"{_duration(plan.playing_s(more))} with {more}",
            "storage": f"{plan.bytes_a_second(workers) / 1e6:.0f} MB/s with {workers} workers, "
            f"{plan.bytes_a_second(more) / 1e6:.0f} MB/s with {more}",
        },
        title="To play it takes",
    )


def _duration(seconds: float) -> str:
    for unit, size in (("days", 86_400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
