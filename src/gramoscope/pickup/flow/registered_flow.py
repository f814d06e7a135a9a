"""Flow of frames that were laid over each other first: the common motion, and what remains of it at every point.

A differential method sees no further than its derivatives: it takes for granted that the texture moves by a small part of
its own grain from frame to frame. Registration (`pickup.registration`) takes the motion that all points share away, over
as many frames as there are; the flow that remains is small, and each frame adds to its trend. Total flow = common motion +
remaining flow. The player reads grooves this way, and needs the remaining flow only.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Float32Array
from gramoscope.errors import require
from gramoscope.pickup.flow.derivatives import Derivatives, group_derivatives, texture_contrast
from gramoscope.pickup.flow.flow_method import FlowMethod
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.pickup.registration import pair_shift_px, register, textured_rows
from gramoscope.signal_path import ImageArray


def common_step_px(images: ImageArray, *, expected_px: float = 0.0) -> float:
    """Return how far the texture moves to smaller columns from frame to frame: the median over the pairs of frames.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
        Two frames or more, in the order in which the texture moves to smaller columns, as a record's does.
    expected_px : float
        Where the search starts, pixels a frame, 0 or more.

    Returns
    -------
    float
        Pixels a frame; `expected_px` when the search fails for every pair.
    """
    rows = textured_rows(images[0])
    steps = np.array([pair_shift_px(a, b, expected_px=expected_px, rows=rows) for a, b in pairwise(images)])
    found = steps[np.isfinite(steps)]
    return float(np.median(found)) if found.size else expected_px


def registered_flow(
    images: ImageArray,
    *,
    method: FlowMethod,
    smoothing_px: float,
    expected_px: float = 0.0,
    relative_weights: bool = False,
) -> Flow:
    """Return the whole flow of a film at its middle frame: the common motion and what remains.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
        Two frames or more, in the order in which the texture moves to smaller columns, as a record's does.
    method : FlowMethod
    smoothing_px : float
        Gaussian before the spatial derivatives, 0 for none.
    expected_px : float
        Where the search for the common motion starts, pixels a frame, 0 or more.
    relative_weights : bool
        Whether the weights of `method` are in units of the sharpest region's gradient, as in the player; otherwise they are
        in grey levels a pixel, as in the literature.

    Returns
    -------
    Flow
        In the coordinates of the frame with index n // 2; u is negative where texture moves to smaller columns.

    Raises
    ------
    ArgumentError
        If there are fewer than two frames.
    """
    require(len(images) >= 2, f"{len(images)} frames", "two or more")
    step = common_step_px(images, expected_px=expected_px)
    index = np.arange(len(images))
    canvas = register(images, np.asarray(step * index, np.float64), index)
    derivatives = group_derivatives(canvas, smoothing_px=smoothing_px)
    contrast = texture_contrast(derivatives.x)
    if relative_weights and contrast > 0:
        derivatives = derivatives.scaled(1 / contrast)
    remaining = method.flow(_where_seen(derivatives, canvas.frames, least=max(2, (len(images) + 1) // 2)))
    here = step * (len(images) // 2)
    u, v = (_window(field, start=here, width=images.shape[2]) for field in (remaining.u, remaining.v))
    return Flow(u - np.float32(step), v)


def _where_seen(derivatives: Derivatives, frames: npt.NDArray[np.int64], *, least: int) -> Derivatives:
    """Zero in the columns that few frames saw: the trend of two frames is mostly noise, and a zero says nothing."""
    seen = (frames >= least).astype(np.float32)
    return Derivatives(derivatives.x * seen, derivatives.y * seen, derivatives.t * seen)


def _window(field: Float32Array, *, start: float, width: int) -> Float32Array:
    """Columns start … start + width − 1 of a field, linearly interpolated: flow is smooth."""
    whole = min(int(start), field.shape[1] - width)
    left = field[:, whole : whole + width]
    right = field[:, np.minimum(np.arange(whole + 1, whole + width + 1), field.shape[1] - 1)]
    share = np.float32(start - whole)
    return np.asarray((1 - share) * left + share * right, np.float32)
