"""A sound filmed: the recording characteristic applied, the groove cut and filmed, the truth put beside the frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from gramoscope.apparatus.capture_writer import CaptureWriter, WrittenLayout
from gramoscope.conventions import FloatArray
from gramoscope.disc.characteristic_filter import recording_filter
from gramoscope.disc.characteristics import characteristic
from gramoscope.disc.cutting import cut_sound
from gramoscope.disc.formats import Disc
from gramoscope.simulation.film import film
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.scene import Scene, filming_bench
from gramoscope.simulation.truth import save_truth

LOWEST_PICTURE_PX, HIGHEST_PICTURE_PX = 512, 1024
"""The paper's camera has 1024 rows; fewer make smaller films."""
MARGIN_M = 15e-6
"""Room beyond the outermost stripe, for its blur and for a rig that is off."""


def framing_height_px(samples: FloatArray, rate_hz: float, *, level_m_s: float, disc: Disc) -> int:
    """Return how many rows a picture needs to hold the stripes of a sound at its loudest, as a good operator would.

    Parameters
    ----------
    samples : float array, shape (sample,) or (sample, 2)
    rate_hz : float
    level_m_s : float
        As in `disc.cutting.cut_sound`.
    disc : Disc

    Returns
    -------
    int
        A multiple of 32, 512 … 1024.
    """
    recorded = _recorded(samples, rate_hz, disc)
    cutting = cut_sound(recorded, rate_hz=rate_hz, level_m_s=level_m_s, cut=disc.cut)
    lateral, vertical = cutting.displacement_at(np.arange(len(samples)) / rate_hz)
    swing_m = float(np.max(np.abs(lateral) + np.abs(vertical) / np.tan(disc.wall_angle_rad)))
    bench = filming_bench()
    pitch_m = bench.sensor.pixel_pitch_m
    middle = (bench.sensor.height_px - 1) / 2
    outermost_m = max(abs(row - middle) for row in bench.stripe_rows()) * pitch_m
    height = 2 * (outermost_m + swing_m + MARGIN_M) / pitch_m
    return int(np.clip(32 * np.ceil(height / 32), LOWEST_PICTURE_PX, HIGHEST_PICTURE_PX))


def film_sound(
    samples: FloatArray,
    rate_hz: float,
    scene: Scene,
    folder: Path,
    layout: WrittenLayout = "tiff",
    *,
    compress: bool = False,
    overwrite: bool = False,
    live: bool = False,
    workers: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> Passage:
    """Film all of a sound, and write the capture with `truth.npz` in it.

    Parameters
    ----------
    samples : float array, shape (sample,) or (sample, 2)
        In any unit: the scene says how loud it is cut.
    rate_hz : float
    scene : Scene
        Its disc names the recording characteristic, flat if it names none; its number of groups is not looked at.
    folder, layout, compress, overwrite, live
        As in `CaptureWriter`.
    workers : int
        Groups rendered at the same time.
    progress : callable, optional
        Told how many groups are done, and of how many.

    Returns
    -------
    Passage
        What was cut.

    Raises
    ------
    ArgumentError, OutputError
        If the sound or the folder is of no use. No half of a capture stays.
    """
    cut = _recorded(samples, rate_hz, scene.bench.disc)
    scene = scene.lasting(len(samples) / rate_hz)
    # a video cannot leave a group out
    lost: Literal["leave out", "black"] = "black" if layout == "video" else "leave out"
    with CaptureWriter(folder, scene.bench, layout=layout, compress=compress, overwrite=overwrite, live=live) as writer:
        passage = film(cut, rate_hz, scene, writer, workers=workers, lost=lost, progress=progress)
    save_truth(folder, scene, passage)
    return passage


def _recorded(samples: FloatArray, rate_hz: float, disc: Disc) -> FloatArray:
    """The sound with the recording characteristic that the disc names, flat if it names none."""
    recording = recording_filter(characteristic(disc.characteristic or "flat"), rate_hz=rate_hz)
    channels = [recording.apply(np.ascontiguousarray(channel)) for channel in samples.reshape(len(samples), -1).T]
    return channels[0] if len(channels) == 1 else np.column_stack(channels)
