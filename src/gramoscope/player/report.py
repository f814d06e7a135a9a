"""What `report.json` says of a transfer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gramoscope.disc.characteristics import FLAT as FLAT_CHARACTERISTIC
from gramoscope.disc.characteristics import characteristic
from gramoscope.disc.formats import direction_of_cut
from gramoscope.player.calibration_check import calibration_check
from gramoscope.player.monitor import Monitor
from gramoscope.player.provenance import (
    bench_of,
    command_line,
    from_folder,
    recipe_of,
    settings_of,
    versions,
)
from gramoscope.player.reading import AnyCapture, Reading
from gramoscope.player.recipe import Recipe
from gramoscope.player.response import response_of
from gramoscope.player.tracks import EQUALISED, FLAT, REPAIRED
from gramoscope.quality import Quality, describe
from gramoscope.turntable.hole_gauge import HoleGauge

if TYPE_CHECKING:
    from gramoscope.player.outputs import Outputs
    from gramoscope.player.play import Settings

REPORT_FORMAT = "gramoscope-report/1"


def transfer_report(
    capture: AnyCapture,
    recipe: Recipe,
    reading: Reading,
    settings: Settings,
    monitor: Monitor,
    outputs: Outputs,
    folder: Path,
    elapsed_s: float,
) -> dict[str, Any]:
    """Return the report of a transfer into a folder as numbers, texts, arrays, lists and dicts; docs/reference/report.md."""
    seconds, files, seen = (
        (monitor.samples + monitor.silence_samples) / settings.rate_hz,
        outputs.complete(),
        monitor.as_dict(),
    )
    repair = None if outputs.cues is None else outputs.cues.as_dict(recipe.repair)
    curve = characteristic(settings.characteristic_name).name
    equalised = {"characteristic": curve, "made_of": (FLAT if repair is None else REPAIRED).name}
    gauge = monitor.gauge or HoleGauge(capture.bench.rotation)
    hole = gauge.finding()
    return {
        "format": REPORT_FORMAT,
        "made": settings.catalogue.made.isoformat(),
        "catalogue": {name: text for name, text in asdict(settings.catalogue).items() if name != "made"},
        "command": command_line(),
        "settings": settings_of(settings),
        "capture": str(capture.path.resolve()),
        "capture_name": capture.name,
        "capture_from_here": from_folder(capture.path, folder),
        "layout": capture.layout,
        "seconds": seconds,
        "rate_hz": settings.rate_hz,
        "speed": settings.speed.as_dict(capture.bench.rotation),
        "wow": reading.centring.as_dict(hole),
        "hints": monitor.hints.as_dict() if monitor.hints else {},
        "direction": direction_of_cut(capture.bench.disc.cut),
        "walls_read": list(reading.walls),
        "remarks": [
            *reading.remarks(),
            *_remarks(capture, reading.walls),
            *reading.centring.remarks(hole),
            *_clipped(files),
        ],
        "calibration": dict(reading.calibration),
        "calibration_check": calibration_check(capture.bench, reading.calibration, seen),
        **seen,
        **reading.as_dict(),
        "response": response_of(settings.characteristic_name, rate_hz=settings.rate_hz),
        "files": {
            **{name: {**file, "characteristic": FLAT_CHARACTERISTIC.name} for name, file in files.items()},
            EQUALISED.name: {**files[EQUALISED.name], **equalised},
        },
        "repair": repair,
        "flags": {str(flag.name).lower(): describe(flag) for flag in Quality},
        "capture_problems": list(capture.problems),
        "recipe": recipe_of(recipe),
        "device": settings.device.name,
        "bench": bench_of(capture),
        "inputs": reading.hashes.as_dict(capture),
        "versions": versions(),
        "elapsed_s": elapsed_s,
        "real_time_factor": seconds / elapsed_s,
    }


def _remarks(capture: AnyCapture, walls: tuple[str, ...]) -> tuple[str, ...]:
    """What a listener should know before judging."""
    disc = capture.bench.disc
    if len(walls) == 2:
        return ()
    unseen = "inner" if walls[0] == "outer" else "outer"
    silent = f"in walls.wav the {unseen} wall is silent" + (
        "" if disc.cut == "vertical" else ", and so is vertical.wav"
    )
    if disc.cut == "stereo":
        heard = "flat.wav is that wall's channel, not the sum of both"
    else:
        other = "vertical" if disc.cut == "lateral" else "lateral"
        heard = f"{other} motion of the groove (warp, say) sounds like the cut"
    return (f"only the {walls[0]} wall was read: {heard}; {silent}",)


def _clipped(files: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    clipped = {name: file["clipped_samples"] for name, file in files.items() if file["clipped_samples"]}
    if clipped:
        full_scale_cm_s = 100 * next(iter(files.values()))["full_scale_m_s"]
        counts = ", ".join(f"{samples} in {name}" for name, samples in clipped.items())
        yield (
            f"samples beyond full scale ({full_scale_cm_s:g} cm/s) were clipped: {counts}; "
            f"the scale to try next is --full-scale-cm-s {2 * full_scale_cm_s:g}"
        )
