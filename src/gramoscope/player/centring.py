"""Centring: where somebody asks for it, an off-centre hole is measured before the passage is read, and its wow taken away.

The groove's place must be known over whole turns before the first stretch can be put right, so that the passage is looked at
twice: a survey reads some hundred stretches spread over it, and says where the hole is; then all are read, put right and
joined. The whole passage measures the hole once more, for the report.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.capture import Capture
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.workers import in_order
from gramoscope.signal_path import WallTrace
from gramoscope.turntable.hole_gauge import LEAST_SIGMAS, LEAST_TURNS, HoleFinding, HoleGauge
from gramoscope.turntable.off_centre import OffCentreHole

SURVEYED_GROUPS = 512
GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Centring:
    """What is done about an off-centre hole.

    Attributes
    ----------
    asked : bool
        Whether somebody asked for its wow to be removed.
    hole : OffCentreHole or None
        What is removed; None for nothing.
    survey : HoleFinding or None
        From which it is known.
    surveyed_groups : int
    """

    asked: bool = False
    hole: OffCentreHole | None = None
    survey: HoleFinding | None = None
    surveyed_groups: int = 0

    def centred(self, traces: Iterable[WallTrace]) -> Iterator[WallTrace]:
        """Yield stretches where they would begin had the record been centred."""
        for trace in traces:
            yield trace if self.hole is None else self.hole.put_right(trace)

    def as_dict(self, found: HoleFinding) -> dict[str, Any]:
        """Return what the report says of the hole, which the whole passage has measured by now."""
        said = None if self.survey is None else {"groups": self.surveyed_groups, **_amplitude(self.survey)}
        steps = {"percent": 100 * found.step_wow, "sigma_percent": 100 * found.step_wow_sigma}
        return {
            "determined": found.reason is None,
            "reason": found.reason,
            **_amplitude(found),
            "turns": found.turns,
            "pitch_um": 1e6 * found.pitch_m,
            "pitch_sigma_um": 1e6 * found.pitch_sigma_m,
            "in_the_steps": steps,
            "removal": {"asked": self.asked, "applied": self.hole is not None, "survey": said},
        }

    def remarks(self, found: HoleFinding) -> Iterator[str]:
        """Say what was done, or could be done."""
        if self.hole is not None and self.survey is not None:
            yield f"the wow of an off-centre hole was removed: {in_words(self.survey)}"
        elif self.asked:
            yield f"no wow was removed: {_why_not(found if self.survey is None else self.survey)}"
        elif found.significant:
            yield f"the hole is off centre: {in_words(found)}; --remove-wow removes it"
        if self.hole is not None and -found.step_wow > max(found.wow / 2, LEAST_SIGMAS * found.step_wow_sigma):
            yield (
                "the overlaps say that the places in this capture followed the groove and not the spindle: the removal has put "
                "wow in; play again without --remove-wow"
            )


def in_words(found: HoleFinding) -> str:
    """Return a hole with its error bars, for people."""
    return (
        f"{1e6 * found.eccentricity_m:.1f} ± {1e6 * found.eccentricity_sigma_m:.1f} µm, "
        f"a wow of {100 * found.wow:.3f} ± {100 * found.wow_sigma:.3f} %"
    )


def surveyed(capture: Capture, pickup: Pickup, workers: int, *, asked: bool) -> Centring:
    """Return what is to be done about the hole of a record; reads nothing unless somebody asked.

    Parameters
    ----------
    capture : Capture
    pickup : Pickup
        Fitted to the passage.
    workers : int
    asked : bool
    """
    if not asked or _turns(capture.bench) < LEAST_TURNS:
        return Centring(asked)
    gauge, numbers = HoleGauge(capture.bench.rotation), spread_out(capture.group_count)
    for trace in in_order(lambda number: pickup.read(capture.group(number)), numbers, workers=workers):
        gauge.see(trace)
    found = gauge.finding()
    hole = found.hole(capture.bench.rotation) if found.significant else None
    return Centring(asked, hole, found, len(numbers))


def spread_out(count: int, most: int = SURVEYED_GROUPS) -> list[int]:
    """Return at most so many numbers from 0 to `count`, rising, spread evenly without a beat that a turn could follow."""
    if count <= most:
        return list(range(count))
    step = count / most
    return sorted({int((k + k * GOLDEN % 1) * step) for k in range(most)})


def _turns(bench: Bench) -> float:
    return float(bench.rotation.angle_of_arc_rad(bench.passage_length_m)) / (2 * np.pi)


def _why_not(found: HoleFinding) -> str:
    return found.reason or f"the hole is centred as far as can be told, {in_words(found)}"


def _amplitude(found: HoleFinding) -> dict[str, float]:
    return {
        "amplitude_um": 1e6 * found.eccentricity_m,
        "amplitude_sigma_um": 1e6 * found.eccentricity_sigma_m,
        "percent": 100 * found.wow,
        "sigma_percent": 100 * found.wow_sigma,
        "phase_deg": float(np.rad2deg(found.phase_rad)),
        "phase_sigma_deg": float(np.rad2deg(found.phase_sigma_rad)),
    }
