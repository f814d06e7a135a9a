"""The picture of a transfer: one frame with the stripes found in it, and the waveform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.listening.figures import frame_figure, groove_figure
from gramoscope.pickup.cartridge import Sketch
from gramoscope.player.monitor import Monitor
from gramoscope.player.reading import AnyCapture, Reading
from gramoscope.player.worst_groups import Doubtful

TRIED_GROUPS = 8
WORST_PLACES = 3


@dataclass(frozen=True, eq=False)
class Place:
    """A group that is worth a look, and its picture."""

    group: Doubtful
    figure: Figure


def worst_places(capture: AnyCapture, reading: Reading, monitor: Monitor) -> list[Place]:
    """Draw the worst groups of a transfer of which at least one frame is left, the worst first."""
    sensor, places = capture.bench.sensor, list[Place]()
    for group in monitor.quality.worst.worst_first() if monitor.quality is not None else ():
        # a photograph has many grooves, and is drawn with all of them
        drawn = {place.group.number for place in places}
        wanted = len(places) < WORST_PLACES and group.number not in drawn
        sketch = reading.sketch(group.number) if wanted else None
        if sketch is not None:
            figure = frame_figure(
                sketch.image,
                white_level=sensor.white_level,
                pixel_pitch_m=sensor.pixel_pitch_m,
                stripes=_stripes(sketch),
            )
            places.append(Place(group, figure))
    return places


def groove_picture(
    capture: AnyCapture, reading: Reading, monitor: Monitor, *, rate_hz: float, recipe_name: str
) -> Figure:
    """Draw a frame from the middle of the passage with what the pickup saw, and the sound of the whole."""
    number, sketch = _telling_group(capture, reading)
    bench = capture.bench
    stills = capture.layout == "stills"
    which, lines = ("picture", "edges") if stills else ("group", "stripes")
    if sketch is None:
        sketch = Sketch(np.zeros((bench.sensor.height_px, bench.sensor.width_px), np.uint8), ())
    return groove_figure(
        sketch.image,
        white_level=bench.sensor.white_level,
        pixel_pitch_m=bench.sensor.pixel_pitch_m,
        stripes=_stripes(sketch),
        glass_edge_row=bench.glass_edge_row if isinstance(bench, Bench) and bench.cover_glass else None,
        waveform=monitor.overview.waveform(rate_hz),
        title=f"{capture.name}: {which} {number} of {capture.group_count}, read by “{recipe_name}”",
        heading=f"One {'picture' if stills else 'frame'}, and the {lines} found in it",
    )


def _stripes(sketch: Sketch) -> list[tuple[str, FloatArray, FloatArray, BoolArray]]:
    columns = np.arange(sketch.image.shape[1], dtype=np.float64)
    return [(line.name, columns, line.row, line.measured) for line in sketch.lines]


def _telling_group(capture: AnyCapture, reading: Reading) -> tuple[int, Sketch | None]:
    """The middle group, or the nearest of a few after it of which something is left."""
    middle = capture.group_count // 2
    for number in range(middle, min(middle + TRIED_GROUPS, capture.group_count)):
        sketch = reading.sketch(number)
        if sketch is not None:
            return number, sketch
    return middle, None
