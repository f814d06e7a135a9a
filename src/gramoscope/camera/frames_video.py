"""All frames in one video, in running order.

Videos are read from front to back; playing in order never decodes a frame twice. Several workers ask in nearly the right
order, so the frames that were passed on the way to a later group are kept for a while. For anything farther away the
video's own time stamps are listed once (without decoding), and the reading starts anew at the key frame before: the
picture is the right one to the frame, whatever the codec.
"""

from __future__ import annotations

import bisect
import importlib
import itertools
import threading
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Frame, Layout, Lost, words_of
from gramoscope.camera.sensor import Sensor
from gramoscope.errors import CaptureError, NoFramesError

_KEPT_GROUPS = 4
_FRAMES_A_SECOND = 25
_KEYS_TRIED = 3


def load_av(path: Path) -> ModuleType:
    """Return PyAV, or raise `CaptureError` with the remedy."""
    try:
        return importlib.import_module("av")
    except ImportError:
        raise CaptureError(
            f"{path.name} is a video, and PyAV is not installed",
            "PyAV, which reads and writes videos",
            "pip install gramoscope[video]",
        ) from None


class VideoFrames:
    """The frames of a capture in one video.

    Parameters
    ----------
    path : Path
    frames_per_group : int

    Raises
    ------
    CaptureError
        If PyAV is not installed.
    NoFramesError
        If the file is no video.
    """

    layout: Layout = "video"

    def __init__(self, path: Path, *, frames_per_group: int) -> None:
        self.path = path
        self.frames_per_group = frames_per_group
        self._lock = threading.Lock()
        self._tape = _Tape(path)
        self._kept: OrderedDict[int, Frame | Lost] = OrderedDict()

    def read_group(self, number: int, contents: Contents) -> Iterator[Frame | Lost]:
        """Yield the frames of one group."""
        first = number * self.frames_per_group
        with self._lock:
            frames = [self._read(index) for index in range(first, first + self.frames_per_group)]
        yield from (frame for frame in frames if frame is not None)

    def _read(self, index: int) -> Frame | Lost | None:
        if index in self._kept:
            return self._kept.pop(index)
        if self._tape.end is not None and index >= self._tape.end:
            return None
        reach = _KEPT_GROUPS * self.frames_per_group
        if not self._tape.position <= index <= self._tape.position + reach:
            self._tape.wind_to(index)
        while self._tape.position < index:
            passed = self._tape.position
            frame = self._tape.next_frame()
            if frame is None:
                return None
            self._kept[passed] = frame
            if len(self._kept) > reach:
                self._kept.popitem(last=False)
        return self._tape.next_frame()

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return nothing: the video belongs to the whole capture."""
        return ()

    def common_files(self) -> tuple[Path, ...]:
        """Return the video."""
        return (self.path,)

    def any_frame(self) -> bool:
        """Tell whether the file exists."""
        return self.path.is_file()


class _Tape:
    """A video with a reading head: `position` is the number of the frame that comes next, `end` of the first that does not
    exist, once that is known.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.position = 0
        self.end: int | None = None
        self._av = load_av(path)
        self._stamps: _Stamps | None = None
        self._container = self._open()
        self._frames = self._play(self._pictures())

    def _open(self) -> Any:
        try:
            container = self._av.open(str(self.path))
            stream = container.streams.video[0]
            stream.thread_type = "SLICE"  # frame threads would report a damaged frame too late
        except Exception as error:  # FFmpeg knows a hundred ways in which a file can be no video
            raise NoFramesError(
                f"{self.path} cannot be read as a video: {words_of(error)}",
                "a video",
                "check that the copy is complete",
            ) from None
        return container

    def next_frame(self) -> Frame | Lost | None:
        """Return the next frame, or None at the end."""
        frame = next(self._frames, None)
        if frame is None:
            self.end = self.position
        else:
            self.position += 1
        return frame

    def wind_to(self, index: int) -> None:
        """Move the head to a frame or some way before it; to the very start where the time stamps are of no use."""
        if self._stamps is None:
            self._rewind()
            self._stamps = _Stamps.of(self._container)
        keys = self._stamps.keys_before(index)
        if not any(self._start_at_key(key, index) for key in keys):
            self._rewind()

    def _start_at_key(self, key: int, index: int) -> bool:
        """Seek to a key frame; tell whether the first key frame that comes is one at or before `index`."""
        self._rewind()
        self._container.seek(key, stream=self._container.streams.video[0], backward=True)
        pictures = self._pictures()
        # pictures that come before their key frame lean on others that were never read
        first = next((picture for picture in pictures if getattr(picture, "key_frame", False)), None)
        position = None if first is None or self._stamps is None else self._stamps.index_of(first.pts)
        if position is None or position > index:
            return False
        self.position = position
        self._frames = self._play(itertools.chain([first], pictures))
        return True

    def _rewind(self) -> None:
        self._container.close()
        self._container = self._open()
        self._frames = self._play(self._pictures())
        self.position = 0

    def _play(self, pictures: Iterator[Any]) -> Iterator[Frame | Lost]:
        lost = Lost(f"{self.path.name}: a frame is damaged")
        damaged, before = 0, None
        for picture in pictures:
            if isinstance(picture, Lost) or picture.is_corrupt:
                damaged += 1
                continue
            if damaged:
                yield from itertools.repeat(lost, max(damaged, self._between(before, picture.pts)))
            damaged, before = 0, picture.pts
            yield pixels_of(picture)
        yield from itertools.repeat(lost, damaged)

    def _between(self, before: int | None, after: int | None) -> int:
        """Return how many frames lie between two time stamps; damage can swallow more of them than it reports."""
        stream = self._container.streams.video[0]
        if before is None or after is None or not stream.average_rate:
            return 0
        steps: int = round((after - before) * stream.time_base * stream.average_rate)
        return steps - 1

    def _pictures(self) -> Iterator[Any]:
        packets = self._container.demux(self._container.streams.video[0])
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    return
                yield from packet.decode()
            except self._av.error.EOFError:
                return
            except self._av.error.FFmpegError as error:
                yield Lost(words_of(error))


@dataclass(frozen=True)
class _Stamps:
    """The time stamps of all pictures in running order, and of the key frames; none where they are of no use."""

    all: list[int]
    keys: list[int]

    @classmethod
    def of(cls, container: Any) -> _Stamps:
        """List the stamps, without decoding."""
        packets = [packet for packet in container.demux(container.streams.video[0]) if packet.size]
        stamps = [packet.pts for packet in packets]
        if None in stamps or len(set(stamps)) < len(stamps):
            return cls([], [])
        return cls(sorted(stamps), sorted(packet.pts for packet in packets if packet.is_keyframe))

    def keys_before(self, index: int) -> list[int]:
        """Return a few key frames at or before a frame, the nearest first."""
        if index >= len(self.all):
            return []
        return self.keys[: bisect.bisect_right(self.keys, self.all[index])][: -_KEYS_TRIED - 1 : -1]

    def index_of(self, stamp: int | None) -> int | None:
        """Return which frame carries a stamp."""
        place = len(self.all) if stamp is None else bisect.bisect_left(self.all, stamp)
        return place if place < len(self.all) and self.all[place] == stamp else None


def pixels_of(picture: Any) -> Frame:
    """Return the pixels of a decoded picture.

    Parameters
    ----------
    picture : av.VideoFrame

    Returns
    -------
    uint8 or uint16 array, shape (row, column) or (row, column, 3)
        Grey pictures as they are; all others as red, green and blue of 8 or 16 bits.
    """
    if picture.format.name.startswith("gray"):
        return np.asarray(picture.to_ndarray())
    deep = max(component.bits for component in picture.format.components) > 8
    return np.asarray(picture.to_ndarray(format="rgb48le" if deep else "rgb24"))


class VideoWriter:
    """Writes frames as FFV1 in Matroska, which loses nothing.

    Parameters
    ----------
    path : Path
    sensor : Sensor

    Raises
    ------
    CaptureError
        If PyAV is not installed.
    """

    def __init__(self, path: Path, *, sensor: Sensor) -> None:
        self._av = load_av(path)
        colour, deep = sensor.colour == "rgb", sensor.bits > 8
        self._format = ("rgb48le" if deep else "rgb24") if colour else ("gray16le" if deep else "gray")
        self._container = self._av.open(str(path), "w")
        self._stream = self._container.add_stream("ffv1", rate=_FRAMES_A_SECOND)
        self._stream.width, self._stream.height = sensor.width_px, sensor.height_px
        self._stream.pix_fmt = {"rgb24": "bgr0", "rgb48le": "gbrp16le"}.get(self._format, self._format)
        self._stream.options = {"level": "3", "g": "1", "slicecrc": "1"}

    def write(self, frames: Frame) -> None:
        """Append frames, as stored."""
        for frame in frames:
            picture = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format=self._format)
            self._container.mux(self._stream.encode(picture))

    def close(self) -> None:
        """Write what is still on its way and close the file."""
        self._container.mux(self._stream.encode())
        self._container.close()

    def abandon(self) -> None:
        """Close the file as it is."""
        self._container.close()
