"""Groove frames with a flow that is known exactly: the record slides by one step from frame to frame, at every row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.seed_paper.take import NOISE_RATE_HZ, film_in_memory, noise_sound, short_bench
from gramoscope.conventions import BoolArray
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.signal_path import ImageArray
from gramoscope.simulation.scene import Scene

SEED, GROUP, FRAMES, MIDDLE = 11, 4, 15, 7
WIDTH_PX = 480
"""Columns that are compared; a whole frame has 1280."""
SHARP_REACH_PX = 8.0
"""Points so near to the true line of a stripe count as inside a sharp zone: the blur is then under seven pixels."""


@dataclass(frozen=True, eq=False)
class Groove:
    """Frames, the step of the record in pixels, and where the middle frame is sharp."""

    images: ImageArray
    step_px: float
    sharp: BoolArray

    @property
    def true(self) -> Flow:
        """The exact flow: texture moves to smaller columns as the record turns."""
        height, width = self.images.shape[1:]
        return Flow(np.full((height, width), -self.step_px, np.float32), np.zeros((height, width), np.float32))


def film_groove() -> Groove:
    """Film a stretch of an ordinary 78 with aluminium powder, and cut the pictures to their first columns."""
    bench = short_bench(frames=FRAMES, groups=GROUP + 1)
    sound = noise_sound(low_hz=200, high_hz=4000, seconds=0.1, seed=SEED)
    take = film_in_memory(sound, NOISE_RATE_HZ, Scene(bench, seed=SEED), [GROUP])
    group = take.groups[0]
    starts = take.true_starts_m(group)
    step_px = float(np.diff(starts).mean() / group.pixel_pitch_m)
    columns = np.arange(WIDTH_PX) + step_px * MIDDLE
    rows = np.arange(group.images.shape[1])[:, None]
    nearest = np.min([np.abs(rows - stripe) for stripe in take.stripe_rows(group, columns)], axis=0)
    return Groove(np.ascontiguousarray(group.images[:, :, :WIDTH_PX]), step_px, nearest <= SHARP_REACH_PX)
