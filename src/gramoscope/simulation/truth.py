"""What a simulated film is of, exactly: for tests, and for `compare`.

In the units of the capture format: `arc_um`, and the groove's velocity there at nominal speed, `lateral_um_s` and
`vertical_um_s`; `speed_um_s` (one number, or one for each place where the groove runs inwards); `starts_um`, where each
group truly started. Besides: the displacement `lateral_um`, `vertical_um`; `frame_starts_um` (group, frame), whose
differences are the exact optical flow; and of each group `stage_um`, `focus_error_um`, `lost`.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import MICROMETRES_PER_METRE, FloatArray, stereo_of_motion
from gramoscope.errors import OutputError, require
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import filmed_group
from gramoscope.simulation.scene import Scene

TRUTH_NAME = "truth.npz"


def truth_of(scene: Scene, passage: Passage) -> dict[str, npt.NDArray[np.generic]]:
    """Return the truth about a film, by the names that the module lists.

    Parameters
    ----------
    scene : Scene
    passage : Passage
        What was cut; `film` returns it.
    """
    bench = scene.bench
    pitch_m = bench.sensor.pixel_pitch_m
    arc_m = np.arange(round(bench.passage_length_m / pitch_m) + 1) * pitch_m
    speed_m_s = bench.rotation.speed_at_m_s(arc_m if bench.rotation.pitch_m else 0.0)
    lengths = dict(
        zip(("lateral_um_s", "vertical_um_s"), passage.velocity_m_s(arc_m).astype(np.float32), strict=True)
    ) | dict(zip(("lateral_um", "vertical_um"), passage.displacement_m(arc_m).astype(np.float32), strict=True))
    filmed = [filmed_group(scene, number) for number in range(bench.sequence.groups)]
    lengths |= {
        "arc_um": arc_m,
        "speed_um_s": speed_m_s,
        "starts_um": np.array([group.arc_start_m[0] for group in filmed]),
        "frame_starts_um": np.array([group.arc_start_m for group in filmed]),
        "stage_um": np.array([group.stage_m for group in filmed]),
        "focus_error_um": np.array([group.focus_error_m for group in filmed]),
    }
    scaled = {name: values * MICROMETRES_PER_METRE for name, values in lengths.items()}
    return {**scaled, "lost": np.array([group.lost for group in filmed])}


def save_truth(folder: str | os.PathLike[str], scene: Scene, passage: Passage) -> Path:
    """Write `truth.npz` into the folder of a capture, whole or not at all.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    path = Path(folder) / TRUTH_NAME
    partial = path.with_name(TRUTH_NAME + ".partial")
    try:
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **truth_of(scene, passage))
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(
            f"{path} cannot be written: {error.strerror or error}", "a folder with room", "make room and film again"
        ) from error
    return path


def truth_audio(scene: Scene, passage: Passage, *, rate_hz: float) -> FloatArray:
    """Return the velocity of the groove in the direction of the cut: what a perfect player would hear.

    Parameters
    ----------
    rate_hz : float
        Samples a second; at least the rate of the sound that was cut, or its treble folds back.

    Returns
    -------
    float64 array, shape (sample,), or (sample, 2) with left first for a stereo cut
        Metres a second; sample 0 is s = 0, and the last lies within the film.
    """
    require(rate_hz > 0, f"a rate of {rate_hz} Hz", "a positive rate")
    rotation = scene.bench.rotation
    seconds = float(rotation.time_of_arc_s(scene.bench.passage_length_m))
    time_s = np.arange(int(seconds * rate_hz) + 1) / rate_hz
    lateral, vertical = passage.velocity_m_s(rotation.arc_of_time_m(time_s))
    if scene.bench.disc.cut == "stereo":
        return np.stack(stereo_of_motion(lateral, vertical), axis=1)
    return np.asarray(lateral if scene.bench.disc.cut == "lateral" else vertical)
