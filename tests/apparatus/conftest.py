from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.camera.sensor import Sensor


@pytest.fixture
def bench():
    """A small bench, neither square nor centred; the glass edge is off the middle."""
    standard = Bench(
        sensor=Sensor(width_px=71, height_px=46, pixel_pitch_m=5e-6),
        sequence=Sequence(groups=5, frames_per_group=3, frame_step_m=0.7e-6, group_step_m=310e-6),
    )
    return replace(standard, cover_glass=replace(standard.cover_glass, edge_row=29.3))


@pytest.fixture
def film():
    """Return random pictures for a bench, one array (frame, row, column) a group."""

    def film(bench, seed=11):
        rng = np.random.default_rng(seed)
        sensor, sequence = bench.sensor, bench.sequence
        shape = (sequence.groups, sequence.frames_per_group, sensor.height_px, sensor.width_px)
        return rng.integers(3, sensor.white_level, shape).astype(sensor.dtype)

    return film


@pytest.fixture
def write():
    """Write pictures as a capture and return its folder."""

    def write(folder, bench, pictures, **options):
        with CaptureWriter(folder, bench, **options) as writer:
            for number, images in enumerate(pictures):
                writer.write_group(number, images)
        return folder

    return write
