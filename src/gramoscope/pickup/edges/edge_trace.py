"""From the edges of a groove in a picture to its walls on the record, as the tonearm takes them."""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.signal_path import GrooveEdges, StillPicture, WallTrace


def wall_trace(edges: GrooveEdges, picture: StillPicture) -> WallTrace:
    """Return where both walls of a groove run, by its edges.

    The place of a wall is that of its edge at the land. A groove that moves by a towards +l takes both edges along; one that
    rises by h gets narrower by 2 h cot φ (`disc.groove`), so that mean and difference of the walls are what
    `tonearm.directions` makes of any two walls.

    Parameters
    ----------
    edges : GrooveEdges
        Of this picture.
    picture : StillPicture

    Returns
    -------
    WallTrace
        A sample a column, numbered like the picture. `offset_m` is `lateral_start_m` plus the row times the pixel pitch;
        NaN where the edge has none. The slope is that between the places half of `correlation_samples` columns before and
        after, whose errors are nearly independent; nearer to each other at the very ends.
    """
    pitch_m = picture.pixel_pitch_m
    offset_m = picture.lateral_start_m + edges.row_px * pitch_m
    slope, slope_sigma = _slopes(edges.row_px, edges.row_sigma_px, edges.correlation_samples)
    return WallTrace(
        number=picture.number,
        arc_start_m=picture.arc_start_m,
        arc_step_m=pitch_m,
        offset_m=offset_m,
        offset_sigma_m=edges.row_sigma_px * pitch_m,
        slope=slope,
        slope_sigma=slope_sigma,
        correlation_samples=edges.correlation_samples,
        flags=edges.flags.copy(),
        problems=picture.problems,
    )


def _slopes(row_px: FloatArray, sigma_px: FloatArray, shared: float) -> tuple[FloatArray, FloatArray]:
    """Rows a column between the places about each column, and their standard errors."""
    columns = row_px.shape[1]
    reach = max(1, round(shared / 2))
    column = np.arange(columns)
    before, after = np.maximum(column - reach, 0), np.minimum(column + reach, columns - 1)
    span = np.maximum(after - before, 1)
    slope = (row_px[:, after] - row_px[:, before]) / span
    return slope, np.hypot(sigma_px[:, after], sigma_px[:, before]) / span
