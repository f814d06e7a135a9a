"""What `report.json` says of a transfer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from gramoscope.apparatus.capture import Capture
from gramoscope.disc.formats import direction_of_cut
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.monitor import Monitor
from gramoscope.player.provenance import InputHashes, bench_of, command_line, recipe_of, versions
from gramoscope.player.recipe import Recipe
from gramoscope.player.tracks import EQUALISED
from gramoscope.quality import Quality, describe

if TYPE_CHECKING:
    from gramoscope.player.play import Settings

REPORT_FORMAT = "gramoscope-report/1"


def transfer_report(
    capture: Capture,
    recipe: Recipe,
    pickup: Pickup,
    settings: Settings,
    hashes: InputHashes,
    monitor: Monitor,
    files: Mapping[str, Mapping[str, Any]],
    elapsed_s: float,
) -> dict[str, Any]:
    """Return the report of a transfer as plain numbers, texts, lists and dicts."""
    seconds = monitor.samples / settings.rate_hz
    return {
        "format": REPORT_FORMAT,
        "made": settings.catalogue.made.isoformat(timespec="seconds"),
        "catalogue": {name: text for name, text in asdict(settings.catalogue).items() if name != "made"},
        "command": command_line(),
        "capture": str(capture.folder),
        "layout": capture.layout,
        "seconds": seconds,
        "rate_hz": settings.rate_hz,
        "direction": direction_of_cut(capture.bench.disc.cut),
        "walls_read": list(pickup.walls),
        "remarks": [*_remarks(capture, pickup.walls), *_clipped(files)],
        "calibration": dict(pickup.calibration),
        **monitor.as_dict(),
        "files": {
            **files,
            EQUALISED.name: {**files[EQUALISED.name], "characteristic": settings.characteristic_name},
        },
        "flags": {str(flag.name).lower(): describe(flag) for flag in Quality},
        "capture_problems": list(capture.problems),
        "recipe": recipe_of(recipe),
        "device": settings.device.name,
        "bench": bench_of(capture),
        "inputs": hashes.as_dict(capture),
        "versions": versions(),
        "elapsed_s": elapsed_s,
        "real_time_factor": seconds / elapsed_s,
    }


def _remarks(capture: Capture, walls: tuple[str, ...]) -> tuple[str, ...]:
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
    for name, file in files.items():
        if file["clipped_samples"]:
            yield (
                f"{name}: {file['clipped_samples']} samples beyond full scale ({100 * file['full_scale_m_s']:g} cm/s) were "
                f"clipped; play again with --full-scale-cm-s {200 * file['full_scale_m_s']:g}"
            )
