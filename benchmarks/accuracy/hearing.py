"""A capture played into memory: sound with its standard errors and flags, in both directions.

The signal path is that of `gramoscope.player.play`, whose files keep one direction and no errors. Where play changes, this
has to follow: a test compares the two sample by sample.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.conventions import FloatArray, stereo_of_motion
from gramoscope.disc.formats import Cut, Direction, direction_of_cut
from gramoscope.player.film import learned
from gramoscope.player.recipe import Recipe
from gramoscope.player.workers import in_order
from gramoscope.preamp.resample import Resampler
from gramoscope.signal_path import Audio, GrooveMotion, WallTrace
from gramoscope.tonearm.follow import Tonearm

RATE_HZ = 96_000.0


@dataclass(frozen=True, eq=False)
class Heard:
    """What was heard of a capture.

    Attributes
    ----------
    lateral, vertical : Audio or None
        The whole passage; None for a direction that the recipe does not read.
    cut : {"lateral", "vertical", "stereo"}
    played_s : float
        How long it took, learning included.
    """

    lateral: Audio | None
    vertical: Audio | None
    cut: Cut
    played_s: float

    @property
    def sound(self) -> Audio:
        """The direction that is the sound; lateral for a stereo cut."""
        one = self.vertical if direction_of_cut(self.cut) == "vertical" else self.lateral
        assert one is not None
        return one

    @property
    def channels(self) -> FloatArray | None:
        """Left and right, shape (sample, 2); None unless both directions were read."""
        if self.lateral is None or self.vertical is None:
            return None
        return np.stack(stereo_of_motion(self.lateral.samples, self.vertical.samples), axis=1)


def hear(folder: Path, recipe: Recipe, *, workers: int = 2, groups: int | None = None) -> Heard:
    """Play a capture.

    Parameters
    ----------
    folder : Path
        Of the capture.
    recipe : Recipe
    workers : int
    groups : int, optional
        Play so many groups at the most.
    """
    started = time.perf_counter()
    capture = open_capture(folder)
    bench, direction = capture.bench, direction_of_cut(capture.bench.disc.cut)
    count = min(groups or capture.group_count, capture.group_count)
    tonearm = Tonearm(bench.rotation, direction, bench.disc.wall_angle_rad, bench.passage_length_m, recipe.smoother)
    spliced = (trace for trace, _ in recipe.splice.join(_traces(capture, recipe, count, workers)))
    motion = list(tonearm.follow(spliced))
    lateral, vertical = (_sound(motion, capture, recipe, way) for way in ("lateral", "vertical"))
    return Heard(lateral, vertical, bench.disc.cut, time.perf_counter() - started)


def _traces(capture: Capture, recipe: Recipe, count: int, workers: int) -> Iterator[WallTrace]:
    pickup = learned(capture, recipe, workers)
    return in_order(lambda number: pickup.read(capture.group(number)), range(count), workers=workers)


def _sound(motion: list[GrooveMotion], capture: Capture, recipe: Recipe, direction: Direction) -> Audio | None:
    velocities = [m.lateral_velocity_m_s if direction == "lateral" else m.vertical_velocity_m_s for m in motion]
    if not any(np.isfinite(velocity).any() for velocity in velocities):
        return None
    resampler = Resampler(capture.bench.rotation, RATE_HZ, recipe.passband)
    both = resampler.resample(motion)
    pieces = [piece.lateral if direction == "lateral" else piece.vertical for piece in both]
    return Audio(
        start_sample=pieces[0].start_sample,
        rate_hz=RATE_HZ,
        samples=np.concatenate([piece.samples for piece in pieces]),
        sigma=np.concatenate([piece.sigma for piece in pieces]),
        flags=np.concatenate([piece.flags for piece in pieces]),
        history=pieces[0].history,
    )
