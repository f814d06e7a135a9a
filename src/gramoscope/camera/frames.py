"""Frames as they lie on disk, and how one becomes the grey picture that the player sees.

A capture keeps its frames in one of four layouts (`frames_tiff`, `frames_image`, `frames_zarr`, `frames_video`). Each reads
the frames of one group as they were stored, mirrored and coloured as the camera saw them; a frame that cannot be read comes
as a `Lost` that says why. `develop` then makes the canonical picture: one grey value a pixel, s along the columns, l along
the rows. A colour pixel becomes the rounded mean of its channels, so that grey stored as colour gives back exactly the grey.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from gramoscope.camera.contents import Contents
from gramoscope.camera.grey import fit_to_bits, grey_of_colour
from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import mirror
from gramoscope.signal_path import ImageArray

Layout = Literal["tiff", "images", "zarr", "video"]
Frame = npt.NDArray[Any]


@dataclass(frozen=True)
class Lost:
    """A frame that cannot be read.

    Parameters
    ----------
    why : str
        In words.
    rest : bool
        Whether the same holds for all frames of the group that follow.
    """

    why: str
    rest: bool = False


class FrameSource(Protocol):
    """The stored frames of a capture, in one of the layouts."""

    @property
    def layout(self) -> Layout:
        """Which layout it is."""

    def read_group(self, number: int, contents: Contents) -> Iterator[Frame | Lost]:
        """Yield the frames of a group as stored; too few when the file ends early. Never raises for a broken file.

        Files that are read whole are read from their contents, which may be wanted for something else too.
        """

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return the files that hold this group and no other; the missing ones too."""

    def common_files(self) -> tuple[Path, ...]:
        """Return the files that belong to the whole capture."""

    def any_frame(self) -> bool:
        """Tell cheaply whether there is anything to read at all."""


class Unusable(str):
    """What makes a frame of no use."""

    __slots__ = ()


def develop(frame: Frame, *, sensor: Sensor, out: ImageArray) -> str | None:
    """Make a stored frame a canonical grey picture.

    Parameters
    ----------
    frame : array, shape (row, column) or (row, column, channel)
        As stored.
    sensor : Sensor
    out : uint8 or uint16 array, shape (row, column)
        Receives the picture; left as it is when the frame is unusable.

    Returns
    -------
    str or None
        What is wrong, in words. `Unusable` when nothing was written.
    """
    if frame.dtype not in (np.uint8, np.uint16):
        return Unusable(f"pixels of type {frame.dtype}, needed whole numbers of 8 or 16 bits")
    if frame.ndim not in (2, 3):
        return Unusable(f"a picture of {frame.ndim} dimensions")
    if frame.shape[:2] != out.shape:
        return Unusable(wrong_size(frame.shape[1], frame.shape[0], sensor=sensor))
    grey = grey_of_colour(frame) if frame.ndim == 3 else frame
    fitted, remark = fit_to_bits(grey, bits=sensor.bits)
    out[...] = mirror(fitted, columns=sensor.columns, rows=sensor.rows)
    return remark


def as_they_lie(frames: Sequence[Frame | Lost], *, sensor: Sensor) -> ImageArray | None:
    """Return the canonical grey pictures of a group where they lie, if that is what was stored; nothing is copied.

    Parameters
    ----------
    frames : sequence of arrays or Lost
        As stored.
    sensor : Sensor

    Returns
    -------
    uint8 or uint16 array, shape (frame, row, column), or None
        None if a frame is lost or has to be made (`develop`), or if they do not lie at even distances in one array.
    """
    whole = [frame for frame in frames if not isinstance(frame, Lost)]
    shape, item = (sensor.height_px, sensor.width_px), np.dtype(sensor.dtype).itemsize
    mirrored = sensor.columns != "forward" or sensor.rows != "inward"
    if len(whole) < max(len(frames), 1) or sensor.bits != 8 * item or mirrored:
        return None
    if any(one.dtype != sensor.dtype or one.shape != shape or not one.flags.carray for one in whole):
        return None
    together = len(whole) == 1 or (whole[0].base is not None and all(one.base is whole[0].base for one in whole))
    begin = [int(one.__array_interface__["data"][0]) for one in whole]
    apart = begin[1] - begin[0] if len(begin) > 1 else whole[0].nbytes
    even = all(after - before == apart for before, after in pairwise(begin))
    if not together or not even or apart < whole[0].nbytes or apart % item:
        return None
    return np.lib.stride_tricks.as_strided(whole[0], (len(whole), *shape), (apart, *whole[0].strides))


def wrong_size(width_px: int, height_px: int, *, sensor: Sensor) -> str:
    """Return what is wrong with a frame of another size than the camera's."""
    return f"{width_px} × {height_px} pixels, needed {sensor.width_px} × {sensor.height_px}"


def words_of(error: BaseException) -> str:
    """Return what a library said, on one short line."""
    text = " ".join(str(error).split())[:160]
    return text or type(error).__name__
