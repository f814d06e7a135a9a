"""The frames of a group laid over each other and averaged, column by column, in one pass over the film.

What `registration.register` gives beside its trend, for readings that need no temporal derivative: every byte of the film is
read once, each frame at its own fraction of a pixel (Catmull–Rom), and a column of the mean lies together in memory, as
windows that follow the groove want it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.pickup.registration import cubic_taps, frame_shifts, placement, widen
from gramoscope.signal_path import FrameGroup, ImageArray

BLOCK_ROWS = 16
"""So many rows are averaged before they are written: a cache line of each column."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """The mean of the frames of a group.

    Attributes
    ----------
    columns : float32 array, shape (column, row)
        Grey levels, in the coordinates of the first frame, extended forward by the last shift.
    frames : int64 array, shape (column,)
        How many frames each column rests on.
    shift_px : float64 array, shape (frame,)
        How far the record had turned, of each frame used.
    frame_index : int64 array, shape (frame,)
        Which frames of the group were used.
    """

    columns: Float32Array
    frames: npt.NDArray[np.int64]
    shift_px: FloatArray
    frame_index: npt.NDArray[np.int64]


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add(before, here, after, beyond, taps, total):  # type: ignore[no-untyped-def]
    w0, w1, w2, w3 = taps
    w0, w1, w2, w3 = np.float32(w0), np.float32(w1), np.float32(w2), np.float32(w3)
    for x in range(total.size):
        total[x] += w0 * before[x] + w1 * here[x] + w2 * after[x] + w3 * beyond[x]


@numba.njit(cache=True, nogil=True)
def _write(total, share, first, rows, columns):  # type: ignore[no-untyped-def]
    for x in range(total.shape[1]):
        column = columns[x, first : first + rows]
        for j in range(rows):
            column[j] = total[j, x] * share[x]


@numba.njit(cache=True, nogil=True)
def _overlay(images, shift_px, share, columns):  # type: ignore[no-untyped-def]
    frames, height, width = images.shape
    canvas_width = columns.shape[0]
    wide = np.empty(width, np.float32)
    total = np.empty((BLOCK_ROWS, canvas_width), np.float32)
    for first in range(0, height, BLOCK_ROWS):
        rows = min(BLOCK_ROWS, height - first)
        total[:] = np.float32(0)
        for k in range(frames):
            start, stop, offset, fraction = placement(shift_px[k], width, canvas_width)
            taps = cubic_taps(fraction)
            for j in range(rows):
                widen(images[k, first + j], wide)
                # slices, for an index that may be negative keeps the loop from being vectorised
                row = wide[start + offset - 1 : stop + offset + 2]
                _add(row[:-3], row[1:-2], row[2:-1], row[3:], taps, total[j, start:stop])
        _write(total, share, first, rows, columns)


def overlay(images: ImageArray, shift_px: FloatArray, frame_index: npt.NDArray[np.int64]) -> Overlay:
    """Lay frames over each other along their shifts.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
    shift_px : float64 array, shape (frame,)
        ≥ 0, how far the record has turned since the first frame.
    frame_index : int64 array, shape (frame,)
        Number of each frame in running order.

    Returns
    -------
    Overlay
        Columns that no frame covers (one at each end, lost to interpolation) repeat their neighbour.
    """
    height, width = images.shape[1:]
    canvas_width = width + int(np.floor(shift_px.max(initial=0.0)))
    counts = np.zeros(canvas_width, np.int64)
    for shift in shift_px:
        start, stop, _, _ = placement(float(shift), width, canvas_width)
        counts[start:stop] += 1
    columns = np.empty((canvas_width, height), np.float32)
    _overlay(images, shift_px, (1 / np.maximum(counts, 1)).astype(np.float32), columns)
    covered = np.flatnonzero(counts)
    if covered.size:
        columns[: covered[0]] = columns[covered[0]]
        columns[covered[-1] + 1 :] = columns[covered[-1]]
    return Overlay(columns, counts, shift_px, frame_index)


def overlaid(group: FrameGroup) -> tuple[Overlay, FloatArray]:
    """Return the valid frames of a group laid over each other, and the steps between frames (see `frame_shifts`)."""
    shift_px, step_m = frame_shifts(group)
    index = np.flatnonzero(group.valid)
    images = group.images if index.size == group.images.shape[0] else group.images[index]
    return overlay(images, shift_px, index), step_m
