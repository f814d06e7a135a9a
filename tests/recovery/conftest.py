"""A short passage cut into a record, filmed with four frames a group, and read."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from gramoscope.apparatus.bench import Sequence
from gramoscope.disc.formats import Cut
from gramoscope.pickup.seed_paper import SeedPaperPickup
from gramoscope.signal_path import FrameGroup, WallTrace
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage, filmed_group, render_group
from gramoscope.simulation.scene import Scene, filming_bench

FIRST, GROUPS = 4, 5
"""The sound is faded in over two milliseconds, four groups."""
RATE_HZ = 48_000.0


@dataclass(frozen=True, eq=False)
class Take:
    """A film and what was cut."""

    scene: Scene
    passage: Passage
    groups: list[FrameGroup]

    @cached_property
    def traces(self) -> list[WallTrace]:
        pickup = SeedPaperPickup(self.scene.bench)
        return [pickup.read(group) for group in self.groups]


def noise_sound(seed: int) -> np.ndarray:
    """A tenth of a second of noise between 250 Hz and 4 kHz."""
    sos = butter(2, [250, 4000], "bandpass", fs=RATE_HZ, output="sos")
    return np.asarray(sosfiltfilt(sos, np.random.default_rng(seed + 100).normal(size=4800)))


def take(cut: Cut, *, seed: int, groups: int = GROUPS, frames: int = 4, **scene_settings: object) -> Take:
    bench = filming_bench(height_px=448)
    sequence = Sequence(groups=FIRST + groups, frames_per_group=frames, frame_step_m=0.8e-6, group_step_m=470e-6)
    bench = replace(bench, disc=replace(bench.disc, cut=cut), sequence=sequence)
    scene = Scene(bench, seed=seed, **scene_settings)
    passage = cut_passage(noise_sound(seed), rate_hz=RATE_HZ, scene=scene)
    return Take(scene, passage, [_group(scene, passage, number) for number in range(FIRST, FIRST + groups)])


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
        valid=np.ones(frames, bool),
    )


@pytest.fixture(scope="session")
def film_group() -> Callable[[Scene, Passage, int], FrameGroup]:
    return _group


@pytest.fixture(scope="session")
def filmed() -> Callable[..., Take]:
    return take


@pytest.fixture(scope="session")
def lateral() -> list[Take]:
    """Three records of the same kind, each with its own grains, camera noise and music."""
    return [take("lateral", seed=seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="session")
def vertical() -> Take:
    return take("vertical", seed=4)
