"""What `gramoscope info` says of photographs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gramoscope.cli.terminal import FINE, FOUND_WRONG, Terminal, several

if TYPE_CHECKING:
    from gramoscope.apparatus.inspection_still import StillInspection
    from gramoscope.apparatus.still import StillCapture

SHOWN_FINDINGS = 10


def info_still(capture: StillCapture, terminal: Terminal, *, quick: bool) -> int:
    """Look through photographs and say what is in them."""
    from gramoscope.apparatus.inspection_still import inspect_stills

    with terminal.progress("Looking") as progress:
        found = inspect_stills(capture, quick=quick, progress=progress)
    terminal.result({**found.as_dict(), "sound": found.sound})
    _tell(terminal, found)
    return FINE if found.sound else FOUND_WRONG


def _tell(terminal: Terminal, found: StillInspection) -> None:
    bench, sensor = found.bench, found.bench.sensor
    turn = "" if bench.row.turn_px is None else f", a turn is {bench.row.turn_px:g} pixels"
    how = "found in the picture" if bench.found_direction else "as told"
    terminal.table(
        {
            "photographs": f"{found.path} ({found.size_bytes / 1e6:.1f} MB)",
            "pictures": f"{found.pictures_found} of {found.pictures_expected}"
            + ("" if found.complete else " (the first and the last were looked at)")
            + (f", {bench.row.step_px:g} pixels apart" if found.pictures_expected > 1 else "")
            + turn,
            "disc": f"{bench.disc.cut} cut, {bench.rotation.rpm:g} rpm, radius {bench.rotation.radius_m * 1e3:g} mm",
            "camera": f"{sensor.width_px} × {sensor.height_px} as turned, {sensor.bits} bit {sensor.colour}, "
            f"{sensor.pixel_pitch_m * 1e6:.4g} µm a pixel",
            "grooves run": f"along the {bench.groove_along}, {how}; {sensor.columns}, the centre of the disc {sensor.rows}",
            "scale": "known" if not bench.assumed else f"not known; assumed: {', '.join(bench.assumed)}",
            "sound": f"{found.seconds:.4g} s a groove from side to side, {found.pixel_rate_hz / 1e3:.4g} kpixel/s",
        }
    )
    for finding in found.findings[:SHOWN_FINDINGS]:
        terminal.say(f"[yellow]Found:[/] {finding}")
    if len(found.findings) > SHOWN_FINDINGS:
        more = several(len(found.findings) - SHOWN_FINDINGS, "more finding")
        terminal.say(f"[yellow]Found:[/] {more}; --json lists all")
    if found.sound:
        terminal.say("[green]Nothing wrong was found.[/]")
