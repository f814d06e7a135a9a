"""A small scene that renders in a few hundredths of a second."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Sequence
from gramoscope.camera.noise import SensorNoise
from gramoscope.simulation.scene import Scene, filming_bench


@pytest.fixture
def small() -> Scene:
    bench = filming_bench(height_px=430)
    return Scene(
        replace(
            bench,
            sensor=replace(bench.sensor, width_px=208),
            sequence=Sequence(groups=5, frames_per_group=3, frame_step_m=0.8e-6, group_step_m=70e-6),
        ),
        seed=6,
    )


@pytest.fixture
def quiet(small: Scene) -> Scene:
    """The same with hardly any noise."""
    return replace(small, noise=SensorNoise(full_well_electrons=1e9, read_electrons=0.0))


@pytest.fixture
def sound() -> np.ndarray:
    """Forty milliseconds at 48 kHz."""
    time_s = np.arange(1920) / 48_000
    return np.sin(2 * np.pi * 910 * time_s + 0.3) + 0.4 * np.sin(2 * np.pi * 2370 * time_s)
