"""The film of a group as one line of pixels, for kernels that touch little of it.

Frames lie in memory as they lay in their file, where that can be: one after the other, with a directory of some bytes between
them. To move them together would cost as much as to look at all of them.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from gramoscope.signal_path import ImageArray


def film_line(images: ImageArray) -> tuple[ImageArray, int]:
    """Return a film as one line of pixels, and how many of them lie from the beginning of one frame to that of the next.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
        Copied if rows or pixels of a frame lie apart.

    Returns
    -------
    line : array, shape (pixel,), same type
        Pixel [k, row, column] is line[k · step + row · width + column]. What lies between frames is not for reading.
    step : int
    """
    frames, height, width = images.shape
    size, item = height * width, images.dtype.itemsize
    apart = images.strides[0]
    if images.strides[1:] != (width * item, item) or apart < size * item or apart % item:
        images, apart = cast(ImageArray, np.ascontiguousarray(images)), size * item
    step = apart // item
    pixels = (frames - 1) * step + size if frames else 0
    line = np.lib.stride_tricks.as_strided(images, (pixels,), (item,), writeable=False)
    return cast(ImageArray, line), step
