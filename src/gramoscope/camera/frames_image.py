"""One picture file a frame: PNG, TIFF, BMP or JPEG."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageFile

from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Frame, Layout, Lost, words_of
from gramoscope.camera.frames_tiff import read_pages
from gramoscope.camera.pattern import TIFF_SUFFIXES, FramePattern, is_inside
from gramoscope.camera.quiet import quiet_warnings
from gramoscope.camera.sensor import Sensor

_AS_THEY_ARE = ("L", "LA", "RGB", "RGBA", "I;16", "I;16B", "I;16L")


@dataclass(frozen=True)
class ImageFrames:
    """The frames of a capture with one picture file a frame."""

    folder: Path
    pattern: FramePattern
    groups: int
    frames_per_group: int
    sensor: Sensor
    layout: Layout = "images"

    def read_group(self, number: int, contents: Contents) -> Iterator[Frame | Lost]:
        """Yield the pictures of one group."""
        for path in self.files_of_group(number):
            yield self._read(path, contents)

    def _read(self, path: Path, contents: Contents) -> Frame | Lost:
        if not is_inside(path, self.folder):
            return Lost(f"{path.name} lies outside the folder of the capture and was not opened")
        if path.suffix.lower() in TIFF_SUFFIXES:
            pages = read_pages(path, contents, folder=self.folder, frames=1, sensor=self.sensor)
            page = next(pages, Lost(f"{path.name} has no page"))
            return Lost(page.why) if isinstance(page, Lost) else page
        return read_picture(path, contents)

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return one file for each frame."""
        return tuple(self.pattern.path(self.folder, group=number, frame=k) for k in range(self.frames_per_group))

    def common_files(self) -> tuple[Path, ...]:
        """Return nothing: every file belongs to a group."""
        return ()

    def any_frame(self) -> bool:
        """Tell whether any frame's file exists."""
        return any(path.is_file() for number in range(self.groups) for path in self.files_of_group(number))


def read_picture(path: Path, contents: Contents) -> Frame | Lost:
    """Read a PNG, BMP or JPEG.

    Parameters
    ----------
    path : Path
    contents : Contents

    Returns
    -------
    uint8 or uint16 array, shape (row, column) or (row, column, channel), or Lost
    """
    try:
        with quiet_warnings():
            picture = Image.open(io.BytesIO(contents.of(path).data))
        with picture:
            return _pixels(picture, path)
    except FileNotFoundError:
        return Lost(f"{path.name} is missing")
    except Exception as error:  # decoders raise whatever they like at a broken file
        return Lost(f"{path.name} cannot be read ({words_of(error)})")


def _pixels(picture: ImageFile.ImageFile, path: Path) -> Frame:
    raw_mode = picture.tile[0].args if picture.format == "PNG" and picture.tile else None
    if raw_mode in ("RGB;16B", "RGBA;16B"):
        return _deep_colour(picture, path, mode=picture.mode)
    if picture.mode == "I":
        return np.asarray(picture).astype(np.uint16)
    plain = picture if picture.mode in _AS_THEY_ARE else picture.convert("L" if picture.mode == "1" else "RGB")
    pixels = np.array(plain)
    return pixels.astype(pixels.dtype.newbyteorder("="), copy=False)


def _deep_colour(picture: ImageFile.ImageFile, path: Path, *, mode: str) -> Frame:
    # Pillow keeps only the high byte of 16-bit colour. Read as if the numbers were little-endian, the same file gives the
    # low bytes.
    high = np.asarray(picture).astype(np.uint16)
    with quiet_warnings():
        again = Image.open(path)
    with again:
        again.tile = [again.tile[0]._replace(args=f"{mode};16L")]
        return np.asarray((high << 8) | np.asarray(again), np.uint16)


def write_png(path: Path, frame: Frame, *, compress: bool = True) -> None:
    """Write one picture as PNG.

    Parameters
    ----------
    path : Path
    frame : uint8 or uint16 array, shape (row, column) or (row, column, 3)
        As stored. Written here, since Pillow cannot write colours of 16 bits.
    compress : bool
        Whether to spend time on a smaller file.

    References
    ----------
    Portable Network Graphics (PNG) Specification, 3rd ed., W3C 2025, sections 5 and 9.
    """
    height, width = frame.shape[:2]
    colour_type = 2 if frame.ndim == 3 else 0
    header = struct.pack(">IIBBBBB", width, height, 8 * frame.dtype.itemsize, colour_type, 0, 0, 0)
    rows = np.ascontiguousarray(frame, frame.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    filtered = np.zeros((height, 1 + rows.shape[1]), np.uint8)  # filter 0 in front of every row: as it is
    filtered[:, 1:] = rows
    data = zlib.compress(filtered.tobytes(), 6 if compress else 1)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b""))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
