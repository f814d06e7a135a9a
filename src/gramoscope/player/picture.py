"""The picture of a transfer: one frame with the stripes found in it, and the waveform."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gramoscope.apparatus.bench import Stripe
from gramoscope.apparatus.capture import Capture
from gramoscope.conventions import INNER
from gramoscope.listening.figures import groove_figure
from gramoscope.pickup.seed_paper import Reading
from gramoscope.player.monitor import Monitor
from gramoscope.player.recipe import Recipe

TRIED_GROUPS = 8


def groove_picture(capture: Capture, recipe: Recipe, monitor: Monitor, rate_hz: float) -> Figure:
    """Draw a frame from the middle of the passage with what the pickup saw, and the sound of the whole."""
    number, reading = _telling_group(capture, recipe)
    bench = capture.bench
    if reading is None:
        image = np.zeros((bench.sensor.height_px, bench.sensor.width_px), np.uint8)
        stripes = []
    else:
        image = reading.group.images[int(np.flatnonzero(reading.group.valid)[0])]
        stripes = [_drawn(reading, i, image.shape[1]) for i in range(len(reading.stripes))]
    return groove_figure(
        image,
        white_level=bench.sensor.white_level,
        pixel_pitch_m=bench.sensor.pixel_pitch_m,
        stripes=stripes,
        glass_edge_row=bench.glass_edge_row if bench.cover_glass else None,
        waveform=monitor.overview.waveform(rate_hz),
        title=f"{capture.folder.name}: group {number} of {capture.group_count}, read by “{recipe.name}”",
    )


def _telling_group(capture: Capture, recipe: Recipe) -> tuple[int, Reading | None]:
    """The middle group, or the nearest of a few after it of which something is left."""
    pickup, middle = recipe.pickup_for(capture.bench), capture.group_count // 2
    for number in range(middle, min(middle + TRIED_GROUPS, capture.group_count)):
        reading = pickup.inspect(capture.group(number))
        if reading is not None:
            return number, reading
    return middle, None


def _drawn(reading: Reading, number: int, width: int) -> tuple[str, np.ndarray, np.ndarray, np.ndarray]:
    line, columns = reading.centrelines[number], np.arange(width, dtype=np.float64)
    return _name(reading.stripes[number]), columns, line.row[:width], line.measured[:width]


def _name(stripe: Stripe) -> str:
    wall = "inner" if stripe.wall == INNER else "outer"
    place = "through the glass" if stripe.through_glass else "beside the glass"
    return f"{wall} wall, {stripe.depth_below_land_m * 1e6:.0f} µm deep, {place}"
