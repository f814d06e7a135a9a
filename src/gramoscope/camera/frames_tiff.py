"""One TIFF a group, one page a frame: plain, BigTIFF or OME-TIFF."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from PIL import Image

from gramoscope.camera.contents import Bytes, Contents
from gramoscope.camera.frames import Frame, Layout, Lost, words_of, wrong_size
from gramoscope.camera.pattern import FramePattern, is_inside
from gramoscope.camera.plain_tiff import plain_pages
from gramoscope.camera.quiet import quiet_log, quiet_warnings
from gramoscope.camera.sensor import Sensor

_PLANAR = 2
_WHITE_IS_ZERO = 0


@dataclass(frozen=True)
class TiffFrames:
    """The frames of a capture with one TIFF a group."""

    folder: Path
    pattern: FramePattern
    groups: int
    frames_per_group: int
    sensor: Sensor
    layout: Layout = "tiff"

    def read_group(self, number: int, contents: Contents) -> Iterator[Frame | Lost]:
        """Yield the pages of one group's file."""
        path = self.pattern.path(self.folder, group=number)
        return read_pages(path, contents, folder=self.folder, frames=self.frames_per_group, sensor=self.sensor)

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return the one file of the group."""
        return (self.pattern.path(self.folder, group=number),)

    def common_files(self) -> tuple[Path, ...]:
        """Return nothing: every file belongs to a group."""
        return ()

    def any_frame(self) -> bool:
        """Tell whether the file of any group exists."""
        return any(self.files_of_group(number)[0].is_file() for number in range(self.groups))


def read_pages(path: Path, contents: Contents, *, folder: Path, frames: int, sensor: Sensor) -> Iterator[Frame | Lost]:
    """Yield the pages of a TIFF in order.

    Parameters
    ----------
    path : Path
    contents : Contents
        From which the file is read.
    folder : Path
        Which it must not leave.
    frames : int
        How many are expected.
    sensor : Sensor
        Whose size the pages need to have: others are not even decoded.

    Yields
    ------
    array, shape (row, column) or (row, column, channel), or Lost
    """
    if not is_inside(path, folder):
        yield Lost(f"{path.name} lies outside the folder of the capture and was not opened", rest=True)
        return
    try:
        data = contents.of(path)
        with quiet_log():
            tiff = tifffile.TiffFile(path)
            channels = _channel_pages(tiff, frames=frames)
    except FileNotFoundError:
        yield Lost(f"{path.name} is missing", rest=True)
        return
    except Exception as error:  # decoders raise whatever they like at a broken file
        yield Lost(f"{path.name} cannot be read ({words_of(error)})", rest=True)
        return
    with tiff:
        plain = _plain_pages(tiff, data) if channels == 1 else []
        if plain and plain[0].shape == (sensor.height_px, sensor.width_px):
            yield from (page.astype(page.dtype.newbyteorder("="), copy=False) for page in plain)
            return
        yield from _read_pages(tiff, path=path, channels=channels, sensor=sensor)


def _plain_pages(tiff: tifffile.TiffFile, data: Bytes) -> list[Frame]:
    try:
        with quiet_log():
            return plain_pages(tiff, data)
    except Exception:  # as above; what is broken is told page by page
        return []


def _read_pages(tiff: tifffile.TiffFile, *, path: Path, channels: int, sensor: Sensor) -> Iterator[Frame | Lost]:
    for number in itertools.count():
        try:
            with quiet_log():
                frame = _colours(tiff, number * channels, channels=channels, path=path, sensor=sensor)
        except IndexError:
            return
        except Exception as error:  # as above
            yield Lost(f"{path.name} is damaged ({words_of(error)})")
        else:
            yield frame


def _colours(tiff: tifffile.TiffFile, index: int, *, channels: int, path: Path, sensor: Sensor) -> Frame:
    if channels == 1:
        return _page(tiff, index, path=path, sensor=sensor)
    return np.stack([_page(tiff, index + k, path=path, sensor=sensor) for k in range(channels)], axis=-1)


def _page(tiff: tifffile.TiffFile, index: int, *, path: Path, sensor: Sensor) -> Frame:
    page = tiff.pages[index]
    key: Any = page.keyframe
    if (key.imagewidth, key.imagelength) != (sensor.width_px, sensor.height_px):
        raise ValueError(wrong_size(key.imagewidth, key.imagelength, sensor=sensor))
    try:
        frame: Frame = _as_it_lies(tiff, page) if page.is_final else page.asarray()
    except ValueError as error:
        if "imagecodecs" not in str(error):
            raise
        return _page_by_pillow(path, index)
    if key.photometric == _WHITE_IS_ZERO:
        frame = np.asarray(2**key.bitspersample - 1 - frame, frame.dtype)
    return np.moveaxis(frame, 0, -1) if frame.ndim == 3 and key.planarconfig == _PLANAR else frame


def _as_it_lies(tiff: tifffile.TiffFile, page: Any) -> Frame:
    """Return a page that is stored as an array, read without a detour."""
    frame = np.empty(page.shape, tiff.byteorder + page.dtype.char)
    file: Any = tiff.filehandle  # which reads into any buffer, whatever its annotations say
    file.seek(page.dataoffsets[0])
    if file.readinto(frame) != frame.nbytes:
        raise ValueError("the file ends within a page")
    return frame.astype(page.dtype, copy=False)


def _page_by_pillow(path: Path, index: int) -> Frame:
    # Pillow brings libtiff, and with it the compressions (LZW, JPEG) for which tifffile would want another package
    with quiet_warnings(), Image.open(path) as picture:
        picture.seek(index)
        return np.array(picture)


def _channel_pages(tiff: tifffile.TiffFile, *, frames: int) -> int:
    """Return how many pages make one frame: three where an OME-TIFF or ImageJ file keeps colours on pages of their own.

    Some writers call any three pages colours: they are when there are three times as many as there should be frames.
    """
    if not (tiff.is_ome or tiff.is_imagej):
        return 1
    series = tiff.series[0]
    apart = series.axes.endswith("CYX") and series.shape[-3] == 3
    return 3 if apart and len(series.pages) == 3 * frames else 1


def read_first_page(path: Path) -> Frame | Lost:
    """Return the first picture of a TIFF, whatever its size, or why there is none."""
    try:
        with quiet_log():
            tiff = tifffile.TiffFile(path)
        with tiff:
            key: Any = tiff.pages[0].keyframe
            size = Sensor(width_px=key.imagewidth, height_px=key.imagelength)
            return _colours(tiff, 0, channels=_channel_pages(tiff, frames=1), path=path, sensor=size)
    except FileNotFoundError:
        return Lost(f"{path.name} is missing")
    except Exception as error:  # decoders raise whatever they like at a broken file
        return Lost(f"{path.name} cannot be read ({words_of(error)})")


def write_tiff(path: Path, frames: Frame, *, compress: bool = False) -> None:
    """Write frames as the pages of one TIFF.

    Parameters
    ----------
    path : Path
    frames : uint8 or uint16 array, shape (frame, row, column) or (frame, row, column, 3)
        As stored.
    compress : bool
        With deflate; otherwise plain, which reads ten times faster.
    """
    with tifffile.TiffWriter(path) as tiff:
        for frame in frames:
            # page by page, so that the directory of each stands before its pixels and a truncated file loses its end only
            tiff.write(
                frame,
                photometric="rgb" if frame.ndim == 3 else "minisblack",
                compression="zlib" if compress else None,
                contiguous=False,
                metadata=None,
            )
