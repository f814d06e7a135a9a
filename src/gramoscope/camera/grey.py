"""One grey value a pixel, on the scale of the camera.

A colour pixel becomes the rounded mean of its channels, so that grey stored as three equal channels comes back exactly.
"""

from __future__ import annotations

from typing import cast

import numba
import numpy as np

from gramoscope.signal_path import ImageArray


def grey_of_colour(frame: ImageArray) -> ImageArray:
    """Return the rounded mean of red, green and blue.

    Parameters
    ----------
    frame : uint8 or uint16 array, shape (row, column, channel)
        One channel (grey), two (grey and opacity), three or four (colour and opacity); opacity is not looked at.

    Returns
    -------
    array, shape (row, column), same type
        (r + g + b + 1) // 3.
    """
    if frame.shape[-1] < 3:
        return frame[..., 0]
    grey = cast(ImageArray, np.empty(frame.shape[:2], frame.dtype))
    _mean_of_colours(cast(ImageArray, np.ascontiguousarray(frame)), grey)
    return grey


def grey_of_colour_reference(frame: ImageArray) -> ImageArray:
    """Return what `grey_of_colour` does for three channels, in plain NumPy and several times slower: its reference."""
    total = frame[..., :3].sum(axis=-1, dtype=np.uint32)
    return cast(ImageArray, ((total + np.uint32(1)) // np.uint32(3)).astype(frame.dtype))


@numba.njit(cache=True, nogil=True)
def _mean_of_row(pixels: ImageArray, grey: ImageArray) -> None:
    for column in range(grey.size):
        total = np.uint32(pixels[column, 0]) + np.uint32(pixels[column, 1]) + np.uint32(pixels[column, 2])
        grey[column] = np.uint32(total + np.uint32(1)) // np.uint32(3)


@numba.njit(cache=True, nogil=True)
def _mean_of_colours(frame: ImageArray, grey: ImageArray) -> None:
    for row in range(grey.shape[0]):
        _mean_of_row(frame[row], grey[row])


def fit_to_bits(frame: ImageArray, *, bits: int) -> tuple[ImageArray, str | None]:
    """Return a grey frame on the scale of the camera, and what was odd about it.

    Parameters
    ----------
    frame : uint8 or uint16 array
    bits : int
        Of the camera, 8 … 16.

    Returns
    -------
    array, str or None
        The frame as it is when its numbers fit. A file with fewer bits than the camera, or with larger numbers than the
        camera can give, uses the full scale of its own kind of number and is brought to the camera's.
    """
    white = 2**bits - 1
    stored_bits = 8 * frame.dtype.itemsize
    if stored_bits >= bits and (stored_bits == bits or int(frame.max(initial=0)) <= white):
        return frame, None
    full = 2**stored_bits - 1
    scaled = (frame.astype(np.uint32) * np.uint32(white) + np.uint32(full // 2)) // np.uint32(full)
    reason = f"values of {stored_bits} bits where capture.toml says {bits}: scaled to {bits} bits"
    return cast(ImageArray, scaled.astype(np.uint8 if bits == 8 else np.uint16)), reason
