"""Filming: a sound goes in, a capture comes out, one group in memory for each worker.

Groups are rendered side by side in threads (the kernels let go of the interpreter) and written in order. Every random number
comes from the scene's seed and the number of the group, so that the film does not depend on the number of workers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Literal, Protocol

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.signal_path import ImageArray
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage, filmed_group, render_group
from gramoscope.simulation.scene import Scene

FRAME_INTERVAL_S = 4e-3
"""From frame to frame, as the log tells it: a camera of 250 frames a second."""


class GroupWriter(Protocol):
    """Whatever takes the film; `apparatus.capture_writer.CaptureWriter` does."""

    def write_group(
        self,
        number: int,
        images: ImageArray,
        *,
        arc_start_m: FloatArray | None = None,
        stage_m: FloatArray | None = None,
        time_s: FloatArray | None = None,
    ) -> None:
        """Take the frames of one group, and what the log says about them."""


def film(
    sound: FloatArray,
    rate_hz: float,
    scene: Scene,
    writer: GroupWriter,
    *,
    workers: int = 2,
    lost: Literal["leave out", "black"] = "leave out",
    progress: Callable[[int, int], None] | None = None,
) -> Passage:
    """Cut a sound into the record of a scene and film it, as many groups as the scene's bench says.

    Parameters
    ----------
    sound : float array, shape (sample,) or (sample, 2)
        The wanted velocity of the groove in any unit, recording characteristic already applied.
    rate_hz : float
    scene : Scene
        `Scene.lasting` gives it the length of the sound.
    writer : GroupWriter
    workers : int
        Groups rendered at the same time, 1 or more.
    lost : {"leave out", "black"}
        What becomes of a group that the rig loses: never written, or black (a video cannot leave anything out).
    progress : callable, optional
        Told how many groups are done, and of how many.

    Returns
    -------
    Passage
        What was cut, for `simulation.truth`.

    Raises
    ------
    ArgumentError
        If the sound is of no use (see `disc.cutting.cut_sound`), or there is no worker.
    """
    require(workers >= 1, f"{workers} workers", "at least one")
    passage = cut_passage(sound, rate_hz=rate_hz, scene=scene)
    groups = scene.bench.sequence.groups
    for number, images in _rendered(scene, passage, range(groups), workers=workers):
        _write(writer, scene, number, images, lost=lost)
        if progress is not None:
            progress(number + 1, groups)
    return passage


def _rendered(scene: Scene, passage: Passage, numbers: range, *, workers: int) -> Iterator[tuple[int, ImageArray]]:
    """Yield groups in order, rendering no more than one for each worker ahead."""
    with ThreadPoolExecutor(workers) as pool:
        ahead: deque[tuple[int, Future[ImageArray]]] = deque()
        try:
            for number in numbers:
                ahead.append((number, pool.submit(render_group, scene, passage, number)))
                if len(ahead) > workers:
                    first, images = ahead.popleft()
                    yield first, images.result()
            while ahead:
                first, images = ahead.popleft()
                yield first, images.result()
        finally:
            # after an error or Ctrl-C: nothing more need be begun
            pool.shutdown(cancel_futures=True)


def _write(writer: GroupWriter, scene: Scene, number: int, images: ImageArray, *, lost: str) -> None:
    filmed = filmed_group(scene, number)
    if filmed.lost and lost == "leave out":
        return
    frames = len(images)
    writer.write_group(
        number,
        np.zeros_like(images) if filmed.lost else images,
        arc_start_m=filmed.nominal_start_m,
        stage_m=np.full(frames, filmed.stage_m),
        time_s=(number * frames + np.arange(frames, dtype=np.float64)) * FRAME_INTERVAL_S,
    )
