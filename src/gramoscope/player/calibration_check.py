"""What the film says of the apparatus, against what the manifest says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.still_bench import StillBench
from gramoscope.conventions import MICROMETRES_PER_METRE

AGREES, NEAR = 0.02, 0.1
"""Relative differences up to which a value is as stated, and near it."""
VERDICTS = ("as stated", "near: look at it", "not as stated: check the manifest")


def calibration_check(
    bench: Bench | StillBench, calibration: Mapping[str, Any], seen: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return every quantity that was both stated and found.

    Parameters
    ----------
    bench : Bench or StillBench
        The manifest's.
    calibration : mapping
        Of the pickup; empty for one that learns nothing.
    seen : mapping
        Of the monitor.

    Returns
    -------
    list of dict
        `what`, `unit`, `manifest`, `found`, `difference_percent` and `verdict`, one of `VERDICTS`.
    """
    rows = [*_of_pickup(calibration), *(_of_monitor(bench, seen) if isinstance(bench, Bench) else ())]
    return [_judged(*row) for row in rows if _known(row[2]) and _known(row[3])]


Row = tuple[str, str, Any, Any]


def _of_pickup(calibration: Mapping[str, Any]) -> Iterator[Row]:
    distances = calibration.get("stripe_distances", {})
    for key, what in (
        ("between_walls_um", "distance of the stripes of both walls"),
        ("between_planes_um", "distance of the two stripes of one wall"),
    ):
        yield what, "µm", distances.get("manifest", {}).get(key), distances.get("measured", {}).get(key)
    for key, found, what, unit in (
        ("focus_shift_um", "if_walls_are_as_stated", "depth between the two planes, if the walls are as stated", "µm"),
        ("wall_angle_deg", "if_the_glass_is_as_stated", "angle of the walls, if the glass is as stated", "°"),
        ("wall_angle_deg", "by_test_tones", "angle of the walls, by their test tones", "°"),
    ):
        told = calibration.get(key, {})
        yield what, unit, told.get("manifest"), told.get(found)


def _of_monitor(bench: Bench, seen: Mapping[str, Any]) -> Iterator[Row]:
    step_um = bench.sequence.frame_step_m * MICROMETRES_PER_METRE
    yield "step from frame to frame", "µm", step_um, seen["frame_step"]["measured_mean_um"]
    angle_deg = float(np.rad2deg(bench.disc.wall_angle_rad))
    for wall in ("inner", "outer"):
        yield f"angle of the {wall} wall, by its stripes", "°", angle_deg, seen["wall_angle_deg"][wall]


def _known(value: Any) -> bool:
    return value is not None and math.isfinite(value)


def _judged(what: str, unit: str, manifest: float, found: float) -> dict[str, Any]:
    off = found / manifest - 1 if manifest else math.nan
    verdict = VERDICTS[0] if abs(off) <= AGREES else VERDICTS[1] if abs(off) <= NEAR else VERDICTS[2]
    return {
        "what": what,
        "unit": unit,
        "manifest": manifest,
        "found": found,
        "difference_percent": 100 * off,
        "verdict": verdict,
    }
