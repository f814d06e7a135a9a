"""The section of a statement of quality that says how fast the record turned, and what speaks for or against it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gramoscope.listening.page import facts, section
from gramoscope.player.page_words import number
from gramoscope.player.speed import speed_in_words

Report = Mapping[str, Any]


def speed_section(report: Report) -> str:
    """Return the section of a report's speed, wow and hints."""
    rows = [
        *_chosen(report["speed"], report.get("scale")),
        *_places(report),
        *_hole(report["wow"]),
        *_hints(report["hints"]),
    ]
    return section("speed", "Speed and wow", facts(rows))


def _chosen(speed: Mapping[str, Any], scale: Mapping[str, Any] | None) -> Iterator[tuple[str, str]]:
    guessed = scale is not None and any("turns at" in one for one in scale["assumed"])
    said = f"the capture says {speed['capture_rpm']:g}"
    if speed["chosen"] is None:
        yield (
            "playing speed",
            f"{speed_in_words(speed)}, {'assumed: nobody knows' if guessed else 'as the capture says'}",
        )
    else:
        origin = f" ({speed['origin']})" if speed["origin"] else ""
        yield "playing speed", f"{speed_in_words(speed)}, chosen as {speed['chosen']}{origin}; {said}"


def _places(report: Report) -> Iterator[tuple[str, str]]:
    step, places = report["frame_step"], report["group_positions"]
    if step["steps_measured"]:
        found, spread = number(step["measured_mean_um"], "µm", digits=4), _nanometres(step["measured_spread_um"])
        nominal = number(1e6 * report["bench"]["sequence"]["frame_step_m"], "µm", digits=4)
        yield "step from frame to frame", f"{found} ± {spread} by {step['steps_measured']} pairs; stated {nominal}"
    yield "overlaps of groups matched", f"{places['overlaps_matched']}; {places['overlaps_not_matched']} not"
    yield "error of the stated group step", f"{_nanometres(places['rms_error_of_the_nominal_step_um'])} rms"


def _nanometres(length_um: float | None) -> str:
    return number(None if length_um is None else 1e3 * length_um, "nm")


def _hole(wow: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if not wow["determined"]:
        yield "off-centre hole", f"not known: {wow['reason']}"
    else:
        yield "off-centre hole", f"{_with_error(wow, 'amplitude_um', 'amplitude_sigma_um')} µm off"
        yield "its wow, peak", f"{_with_error(wow, 'percent', 'sigma_percent')} %"
        yield "groove farthest out", f"{_with_error(wow, 'phase_deg', 'phase_sigma_deg')}° past the start"
        yield "pitch of the spiral", f"{_with_error(wow, 'pitch_um', 'pitch_sigma_um')} µm"
    removal = wow["removal"]
    if removal["asked"]:
        yield (
            "removal of the wow",
            "asked for, and done" if removal["applied"] else "asked for, and not done: see the remarks",
        )


def _with_error(table: Mapping[str, Any], value: str, sigma: str) -> str:
    return f"{number(table[value])} ± {number(table[sigma], digits=2)}"


def _hints(hints: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for key, name in (("mains_hum", "hint of mains hum"), ("tuning", "hint of the tuning")):
        if key in hints:
            yield name, hints[key].get("words") or f"none: {hints[key]['reason']}"
