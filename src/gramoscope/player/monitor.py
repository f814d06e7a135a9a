"""The monitor watches what passes along the player, and remembers little: counts, sums, and an overview for the picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.player.hints import Hints
from gramoscope.player.quality_meter import QualityMeter
from gramoscope.quality import NOT_MEASURED, REPAIRS, Quality, count
from gramoscope.signal_path import Audio, GrooveMotion, WallTrace
from gramoscope.tonearm.splice import Match
from gramoscope.turntable.hole_gauge import HoleGauge

MOST_PROBLEMS = 200
"""So many problems are told one by one; the rest is counted."""
OVERVIEW_POINTS = 8192
"""The picture of the waveform has about so many points, whatever its length."""


@dataclass
class Overview:
    """The extremes of a waveform over runs of `samples_per_point` samples."""

    samples_per_point: int = 1
    points: list[FloatArray] = field(default_factory=list)
    _rest: FloatArray = field(default_factory=lambda: np.empty((3, 0)))

    def add(self, piece: Audio) -> None:
        """Take in the next piece."""
        missing = (piece.flags & np.uint16(NOT_MEASURED)) != 0
        columns = np.concatenate([self._rest, [piece.samples, piece.sigma, missing]], axis=1)
        n = self.samples_per_point
        whole = columns.shape[1] // n * n
        runs = columns[:, :whole].reshape(3, -1, n)
        self.points.append(_extremes(runs))
        self._rest = columns[:, whole:]

    def waveform(self, rate_hz: float) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return time, velocity, sigma and interpolated, at even steps: the samples themselves, or low and high in turn."""
        rest = [_extremes(self._rest[:, np.newaxis, :])] if self._rest.size else []
        low, high, sigma, missing = np.concatenate([np.empty((4, 0)), *self.points, *rest], axis=1)
        if self.samples_per_point == 1:
            return np.arange(low.size) / rate_hz, low, sigma, missing > 0
        velocity = np.column_stack([low, high]).ravel()
        time: FloatArray = np.arange(velocity.size, dtype=np.float64) * (self.samples_per_point / 2 / rate_hz)
        return time, velocity, np.repeat(sigma, 2), np.repeat(missing > 0, 2)


def _extremes(runs: FloatArray) -> FloatArray:
    """Of velocity, sigma and missing, shape (3, run, sample): lowest and highest velocity, largest of the others."""
    return np.array([runs[0].min(axis=1), runs[0].max(axis=1), *runs[1:].max(axis=2)])


@dataclass
class Monitor:
    """Counts and sums over a transfer.

    Parameters
    ----------
    gauge, hints : HoleGauge and Hints, optional
        Look on, and are asked in the end.
    quality : QualityMeter, optional
        Gathers the statement of quality.
    """

    gauge: HoleGauge | None = None
    hints: Hints | None = None
    quality: QualityMeter | None = None
    groups: int = 0
    groups_lost: list[int] = field(default_factory=list)
    frames_lost: int = 0
    problems: list[str] = field(default_factory=list)
    problems_count: int = 0
    pickup_samples: int = 0
    pickup_flags: dict[str, int] = field(default_factory=dict)
    frame_step_sum_m: float = 0.0
    frame_step_square_m2: float = 0.0
    frame_steps: int = 0
    wall_angle_sum_deg: FloatArray = field(default_factory=lambda: np.zeros(2))
    wall_angles: FloatArray = field(default_factory=lambda: np.zeros(2))
    matches: int = 0
    matches_missing: int = 0
    match_square_m2: float = 0.0
    samples: int = 0
    silence_samples: int = 0
    interpolated: int = 0
    power: float = 0.0
    measured_power: float = 0.0
    noise_power: float = 0.0
    peak_m_s: float = 0.0
    flags: dict[str, int] = field(default_factory=dict)
    overview: Overview = field(default_factory=Overview)

    def picked_up(self, trace: WallTrace, frames_lost: int) -> None:
        """Take note of a stretch that the pickup has read."""
        if self.quality is not None:
            self.quality.picked_up(trace)
        self.groups += 1
        self.frames_lost += frames_lost
        read = np.isfinite(trace.offset_m) & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
        if not read.any():
            self.groups_lost.append(trace.number)
        self.problems_count += len(trace.problems)
        room = max(MOST_PROBLEMS - len(self.problems), 0)
        self.problems += [_with_group(problem, trace.number) for problem in trace.problems[:room]]
        walls = np.isfinite(trace.offset_m).any(axis=1)
        if walls.any():
            flags = trace.flags[walls]
            self.pickup_samples += flags.size
            for name, number in count(flags).items():
                self.pickup_flags[name] = self.pickup_flags.get(name, 0) + number
        known = np.isfinite(trace.wall_angle_rad)
        self.wall_angle_sum_deg = self.wall_angle_sum_deg + np.where(known, np.rad2deg(trace.wall_angle_rad), 0.0)
        self.wall_angles = self.wall_angles + known
        steps = trace.frame_step_m[np.isfinite(trace.frame_step_m)]
        self.frame_steps += steps.size
        self.frame_step_sum_m += float(steps.sum())
        self.frame_step_square_m2 += float((steps**2).sum())

    def problem(self, words: str) -> None:
        """Take note of a problem that belongs to no single stretch."""
        self.problems_count += 1
        self.problems += [words] if len(self.problems) < MOST_PROBLEMS else []

    def spliced(self, match: Match | None, trace: WallTrace | None = None) -> None:
        """Take note of how a stretch fits the one before."""
        if self.gauge is not None and trace is not None:
            self.gauge.see(trace, match.error_m if match is not None else float("nan"))
        if match is None:
            return
        if np.isnan(match.error_m):
            self.matches_missing += 1
        else:
            self.matches += 1
            self.match_square_m2 += match.error_m**2

    def followed(self, pieces: Iterator[GrooveMotion]) -> Iterator[GrooveMotion]:
        """Take note of the tonearm's pieces as they pass by."""
        return pieces if self.quality is None else self.quality.followed(pieces)

    def heard(self, piece: Audio) -> None:
        """Take note of a piece of the flat transfer; silence between two passages is drawn, and counts for nothing else."""
        if piece.flags.size and bool(np.all(piece.flags & np.uint16(Quality.SILENCE))):
            self.silence_samples += piece.samples.size
            self.overview.add(piece)
            return
        if self.quality is not None:
            self.quality.heard(piece)
        if self.hints is not None:
            self.hints.hear(piece)
        measured = (piece.flags & np.uint16(NOT_MEASURED)) == 0
        self.samples += piece.samples.size
        self.interpolated += int(piece.samples.size - np.count_nonzero(measured))
        self.power += float((piece.samples**2).sum())
        self.measured_power += float((piece.samples[measured] ** 2).sum())
        self.noise_power += float(np.nansum(piece.sigma[measured] ** 2))
        self.peak_m_s = max(self.peak_m_s, float(np.abs(piece.samples).max(initial=0.0)))
        for name, number in count(piece.flags).items():
            self.flags[name] = self.flags.get(name, 0) + number
        self.overview.add(piece)

    @property
    def measured_share(self) -> float:
        """Share of the sound that was measured; NaN before any was heard."""
        return 1 - self.interpolated / self.samples if self.samples else float("nan")

    @property
    def noise_m_s(self) -> float:
        """Root mean square of the standard errors where the groove was measured."""
        measured = self.samples - self.interpolated
        return float(np.sqrt(self.noise_power / measured)) if measured else float("nan")

    @property
    def snr_db(self) -> float:
        """Signal to noise that the standard errors claim, where the groove was measured."""
        signal = self.measured_power - self.noise_power
        return float(10 * np.log10(signal / self.noise_power)) if signal > 0 and self.noise_power > 0 else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Return what was seen, for the report."""
        mean_step = self.frame_step_sum_m / self.frame_steps if self.frame_steps else float("nan")
        variance = self.frame_step_square_m2 / self.frame_steps - mean_step**2 if self.frame_steps else float("nan")
        return {
            "groups": {"read": self.groups - len(self.groups_lost), "lost": len(self.groups_lost)},
            "lost_groups": self.groups_lost[:MOST_PROBLEMS],
            "frames_lost": self.frames_lost,
            "share": {
                "measured": self.measured_share,
                "interpolated": 1 - self.measured_share,
                **(self.quality.shares() if self.quality is not None else {}),
            },
            "flagged_samples": {name: self.flags.get(name, 0) for name in _FLAG_NAMES},
            "flagged_pickup_samples": {name: self.pickup_flags.get(name, 0) for name in _FLAG_NAMES},
            "noise_estimate": {"sigma_rms_cm_s": 100 * self.noise_m_s, "signal_to_noise_db": self.snr_db},
            "level": {
                "rms_cm_s": 100 * float(np.sqrt(self.power / self.samples)) if self.samples else float("nan"),
                "peak_cm_s": 100 * self.peak_m_s,
            },
            "frame_step": {
                "measured_mean_um": 1e6 * mean_step,
                "measured_spread_um": 1e6 * float(np.sqrt(max(variance, 0.0))),
                "steps_measured": self.frame_steps,
            },
            "wall_angle_deg": {
                name: float(total / number) if number else float("nan")
                for name, total, number in zip(
                    ("inner", "outer"), self.wall_angle_sum_deg, self.wall_angles, strict=True
                )
            },
            "group_positions": {
                "overlaps_matched": self.matches,
                "overlaps_not_matched": self.matches_missing,
                "rms_error_of_the_nominal_step_um": (
                    1e6 * float(np.sqrt(self.match_square_m2 / self.matches)) if self.matches else float("nan")
                ),
            },
            "quality": self.quality.as_dict() if self.quality is not None else {},
            "problems": self.problems,
            "problems_not_listed": self.problems_count - len(self.problems),
        }


def _with_group(problem: str, number: int) -> str:
    return problem if problem.startswith(f"group {number}") else f"group {number}, {problem}"


_FLAG_NAMES = tuple(str(flag.name).lower() for flag in Quality if flag not in REPAIRS | Quality.SILENCE)
