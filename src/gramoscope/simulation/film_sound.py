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
from gramoscope.simulation.film import film
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.scene import Scene
from gramoscope.simulation.truth import save_truth


def film_sound(
    samples: FloatArray,
    rate_hz: float,
    scene: Scene,
    folder: Path,
    layout: WrittenLayout = "tiff",
    *,
    compress: bool = False,
    overwrite: bool = False,
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
    folder, layout, compress, overwrite
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
    recording = recording_filter(characteristic(scene.bench.disc.characteristic or "flat"), rate_hz=rate_hz)
    channels = [recording.apply(np.ascontiguousarray(channel)) for channel in samples.reshape(len(samples), -1).T]
    cut = channels[0] if len(channels) == 1 else np.column_stack(channels)
    scene = scene.lasting(len(samples) / rate_hz)
    # a video cannot leave a group out
    lost: Literal["leave out", "black"] = "black" if layout == "video" else "leave out"
    with CaptureWriter(folder, scene.bench, layout=layout, compress=compress, overwrite=overwrite) as writer:
        passage = film(cut, rate_hz, scene, writer, workers=workers, lost=lost, progress=progress)
    save_truth(folder, scene, passage)
    return passage
