"""A short stretch of groove, cut and filmed in memory, with the truth beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import FloatArray, row_of_lateral_px
from gramoscope.signal_path import FrameGroup
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage, filmed_group, render_group
from gramoscope.simulation.scene import Scene, filming_bench

NOISE_RATE_HZ = 96_000.0


@dataclass(frozen=True, eq=False)
class Take:
    """A film and what was cut."""

    scene: Scene
    passage: Passage
    groups: list[FrameGroup]

    def stripe_rows(self, group: FrameGroup, columns: FloatArray) -> FloatArray:
        """Return where the sharp stripes of a laterally cut groove truly run, shape (stripe, column)."""
        arc_m = self.true_starts_m(group)[0] + columns * group.pixel_pitch_m
        lateral_m = self.passage.displacement_m(arc_m)[0] + self.scene.groove_middle_m
        height_px = self.scene.bench.sensor.height_px
        rest = row_of_lateral_px(0.0, height_px=height_px, pixel_pitch_m=group.pixel_pitch_m)
        moved = row_of_lateral_px(lateral_m, height_px=height_px, pixel_pitch_m=group.pixel_pitch_m) - rest
        return np.array([stripe.row + moved for stripe in self.scene.bench.stripes()])

    def true_starts_m(self, group: FrameGroup) -> FloatArray:
        """Return where column 0 of each frame really was."""
        return filmed_group(self.scene, group.number).arc_start_m

    def slope(self, group: FrameGroup, columns: npt.ArrayLike) -> FloatArray:
        """Return the true slope of the groove at columns of the registered picture."""
        return np.asarray(
            self.passage.slope(self.true_starts_m(group)[0] + np.asarray(columns) * group.pixel_pitch_m)[0]
        )


def noise_sound(*, low_hz: float, high_hz: float, seconds: float, seed: int) -> FloatArray:
    """Return noise that is equally loud in every octave between two frequencies, at `NOISE_RATE_HZ`."""
    count = round(seconds * NOISE_RATE_HZ)
    white = np.random.default_rng(seed).normal(size=2 * count)
    spectrum = np.fft.rfft(white)
    f = np.fft.rfftfreq(2 * count, 1 / NOISE_RATE_HZ)
    pink = np.fft.irfft(spectrum / np.sqrt(np.maximum(f, low_hz)))[:count]
    band = butter(4, [low_hz, high_hz], "bandpass", fs=NOISE_RATE_HZ, output="sos")
    return np.asarray(sosfiltfilt(band, pink))


def short_bench(*, frames: int, groups: int, base: Bench | None = None) -> Bench:
    """Return the paper's bench for so many groups of so many frames."""
    bench = base or filming_bench()
    return replace(bench, sequence=replace(bench.sequence, frames_per_group=frames, groups=groups))


def film_in_memory(sound: FloatArray, rate_hz: float, scene: Scene, numbers: Sequence[int]) -> Take:
    """Cut a sound into the record of a scene and film some of its groups."""
    passage = cut_passage(sound, rate_hz=rate_hz, scene=scene)
    return Take(scene, passage, [_group(scene, passage, number) for number in numbers])


def _group(scene: Scene, passage: Passage, number: int) -> FrameGroup:
    filmed, sensor = filmed_group(scene, number), scene.bench.sensor
    frames = filmed.arc_start_m.size
    return FrameGroup(
        number=number,
        images=render_group(scene, passage, number),
        arc_start_m=filmed.nominal_start_m,
        stage_m=np.full(frames, filmed.stage_m),
        pixel_pitch_m=sensor.pixel_pitch_m,
        white_level=sensor.white_level,
        valid=np.ones(frames, np.bool_),
    )
