"""What `report.json` says of a transfer."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from gramoscope.apparatus.capture import Capture
from gramoscope.disc.formats import direction_of_cut
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.monitor import Monitor
from gramoscope.player.outputs import EQUALISED, FLAT, Outputs
from gramoscope.player.provenance import InputHashes, bench_of, command_line, recipe_of, versions
from gramoscope.player.recipe import Recipe
from gramoscope.player.repair_files import REPAIRED
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
    files: Outputs,
    elapsed_s: float,
) -> dict[str, Any]:
    """Return the report of a transfer as plain numbers, texts, lists and dicts."""
    seconds = monitor.samples / settings.rate_hz
    return {
        "format": REPORT_FORMAT,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command_line(),
        "capture": str(capture.folder),
        "layout": capture.layout,
        "seconds": seconds,
        "rate_hz": settings.rate_hz,
        "direction": direction_of_cut(capture.bench.disc.cut),
        "walls_read": list(pickup.walls),
        "remarks": list(_remarks(capture, pickup.walls)),
        "calibration": dict(pickup.calibration),
        **monitor.as_dict(),
        "files": {
            FLAT: {
                "what": "velocity of the groove in the direction of the cut, no equalisation; sample 0 is s = 0",
                "full_scale_m_s": files.flat.full_scale_m_s,
                "clipped_samples": files.flat.clipped_samples,
            },
            EQUALISED: {
                "what": f"{_equalised_from(files)} with the recording characteristic undone, 0 dB at 1 kHz",
                "characteristic": settings.characteristic_name,
                "full_scale_m_s": files.equalised.full_scale_m_s,
                "clipped_samples": files.equalised.clipped_samples,
            },
            **(files.repair.files() if files.repair is not None else {}),
        },
        "repair": files.repair.as_dict(recipe.repair) if files.repair is not None else None,
        "flags": {str(flag.name).lower(): describe(flag) for flag in Quality},
        "capture_problems": list(capture.problems),
        "recipe": recipe_of(recipe),
        "bench": bench_of(capture),
        "inputs": hashes.as_dict(capture),
        "versions": versions(),
        "elapsed_s": elapsed_s,
        "real_time_factor": seconds / elapsed_s,
    }


def _equalised_from(files: Outputs) -> str:
    return "the same" if files.repair is None else f"{REPAIRED}"


def _remarks(capture: Capture, walls: tuple[str, ...]) -> tuple[str, ...]:
    """What a listener should know before judging."""
    disc = capture.bench.disc
    if len(walls) == 2:
        return ()
    if disc.cut == "stereo":
        return (f"only the {walls[0]} wall was read: flat.wav is that wall's channel, not the sum of both",)
    other = "vertical" if disc.cut == "lateral" else "lateral"
    return (f"only the {walls[0]} wall was read: {other} motion of the groove (warp, say) sounds like the cut",)
