"""All frames in one Zarr v3 array, alone or as the first picture of an OME-Zarr group; frames along t in running order."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import zarr

from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Frame, Layout, Lost, words_of, wrong_size
from gramoscope.camera.quiet import quiet_warnings
from gramoscope.camera.sensor import Sensor
from gramoscope.errors import NoFramesError

Done = TypeVar("Done")

_STORED_AXES = ("t", "c", "z", "y", "x")


@dataclass(frozen=True, eq=False)
class ZarrFrames:
    """The frames of a capture in one Zarr array; open one with `open_zarr`."""

    root: Path
    array: zarr.Array[Any]
    axes: tuple[str, ...]
    frames_per_group: int
    sensor: Sensor
    layout: Layout = "zarr"

    def read_group(self, number: int, contents: Contents) -> Iterator[Frame | Lost]:
        """Yield the frames of one group; a chunk that was never written counts as a missing frame."""
        size = tuple(self.array.shape[self.axes.index(axis)] for axis in "xy")
        if size != (self.sensor.width_px, self.sensor.height_px):
            yield Lost(f"{self.root.name} holds {wrong_size(*size, sensor=self.sensor)}", rest=True)
            return
        first = number * self.frames_per_group
        last = min(first + self.frames_per_group, self.array.shape[self.axes.index("t")])
        for index in range(first, last):
            yield self._read(index)

    def _read(self, index: int) -> Frame | Lost:
        absent = [path.name for path in self._chunks_of(index, index + 1) if not path.is_file()]
        if absent:
            return Lost(f"{self.root.name}: frame {index} was never written")
        picked = [0 if axis == "z" else index if axis == "t" else slice(None) for axis in self.axes]
        try:
            frame = np.asarray(self.array[tuple(picked)])
        except Exception as error:  # codecs raise whatever they like at broken chunks
            return Lost(f"{self.root.name}: frame {index} is damaged ({words_of(error)})")
        left = "".join(axis for axis in self.axes if axis not in "tz")
        return frame.transpose([left.index(axis) for axis in "yxc" if axis in left])

    def _chunks_of(self, first: int, last: int) -> Iterator[Path]:
        grid = self.array.shards or self.array.chunks
        folder = self.root / self.array.path
        ranges = [
            range(first // step, (last - 1) // step + 1) if axis == "t" else range(-(-length // step))
            for axis, length, step in zip(self.axes, self.array.shape, grid, strict=True)
        ]
        for place in itertools.product(*ranges):
            yield folder / self.array.metadata.encode_chunk_key(place)

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return the chunk files that hold the group; neighbours share one where a chunk reaches over both."""
        first = number * self.frames_per_group
        last = min(first + self.frames_per_group, self.array.shape[self.axes.index("t")])
        return tuple(self._chunks_of(first, last)) if first < last else ()

    def common_files(self) -> tuple[Path, ...]:
        """Return the files that describe the array."""
        return tuple(sorted(path for name in ("zarr.json", ".zarray", ".zattrs") for path in self.root.rglob(name)))

    def any_frame(self) -> bool:
        """Tell whether any chunk was written."""
        described = set(self.common_files())
        return any(path.is_file() and path not in described for path in self.root.rglob("*"))


def open_zarr(root: Path, *, frames_per_group: int, sensor: Sensor) -> ZarrFrames:
    """Open the frames of a capture.

    Parameters
    ----------
    root : Path
        The ``.zarr`` folder: an array (t, row, column) or (t, row, column, colour), or an OME-Zarr group whose axes say
        which is which.
    frames_per_group : int
    sensor : Sensor

    Returns
    -------
    ZarrFrames

    Raises
    ------
    NoFramesError
        If there is no such array in it.
    """
    try:
        with quiet_warnings():
            node = zarr.open(root, mode="r")
        array, axes = _array_of_group(node) if isinstance(node, zarr.Group) else (node, None)
        named = axes or _names_of(array)
    except Exception as error:  # zarr raises whatever it likes at a broken folder
        raise _no_frames(root, words_of(error)) from None
    if not _makes_sense(named, array.shape):
        raise _no_frames(root, f"an array of shape {array.shape} with axes {', '.join(named)}")
    return ZarrFrames(root, array, named, frames_per_group, sensor)


def _no_frames(root: Path, found: str) -> NoFramesError:
    return NoFramesError(
        f"{root} cannot be read as frames: {found}",
        "a Zarr array (t, row, column), (t, row, column, 3), or an OME-Zarr with the axes t, c, y, x",
        "write the frames again, or give capture.toml the right path",
    )


def _array_of_group(group: zarr.Group) -> tuple[zarr.Array[Any], tuple[str, ...] | None]:
    attributes: dict[str, Any] = dict(group.attrs)
    scales = attributes.get("ome", attributes).get("multiscales")
    if scales:
        array = group[scales[0]["datasets"][0]["path"]]
        axes = tuple(str(axis["name"]) for axis in scales[0]["axes"])
        return _as_array(array), axes
    return _as_array(next(group.array_values())), None


def _as_array(node: object) -> zarr.Array[Any]:
    if not isinstance(node, zarr.Array):
        raise TypeError(f"a {type(node).__name__} where the array of frames belongs")
    return node


def _names_of(array: zarr.Array[Any]) -> tuple[str, ...]:
    names: Sequence[str | None] = getattr(array.metadata, "dimension_names", None) or ()
    if names and all(name in _STORED_AXES for name in names):
        return tuple(str(name) for name in names)
    return ("t", "y", "x", "c")[: array.ndim]


def _makes_sense(axes: tuple[str, ...], shape: tuple[int, ...]) -> bool:
    sizes = dict(zip(axes, shape, strict=False))
    named = len(axes) == len(shape) == len(sizes) and {"t", "y", "x"} <= set(axes) <= set(_STORED_AXES)
    return named and sizes.get("z", 1) == 1


def create_zarr(
    root: Path, *, groups: int, frames_per_group: int, sensor: Sensor, compress: bool = True
) -> zarr.Array[Any]:
    """Create the array of a new capture: a chunk a frame, one file (shard) a group.

    Parameters
    ----------
    root : Path
        The ``.zarr`` folder.
    groups, frames_per_group : int
    sensor : Sensor
    compress : bool
        With zstd.

    Returns
    -------
    zarr.Array
        Assign frames to it, a whole group at a time.
    """
    picture = sensor.frame_shape
    return _to_its_end(
        lambda: zarr.create_array(
            root,
            shape=(groups * frames_per_group, *picture),
            chunks=(1, *picture),
            shards=(frames_per_group, *picture),
            dtype=np.dtype(sensor.dtype).name,
            compressors="auto" if compress else None,
            dimension_names=("t", "y", "x", "c")[: 1 + len(picture)],
            config={"write_empty_chunks": True},  # a black frame is not a missing one
        )
    )


def write_zarr_frames(array: zarr.Array[Any], first: int, frames: Frame) -> None:
    """Write consecutive frames; when this was interrupted, nothing is being written any more.

    Parameters
    ----------
    array : zarr.Array
        From `create_zarr`.
    first : int
        Index of the first frame, counted over all groups.
    frames : Frame, shape (frame, *sensor.frame_shape)
    """

    def assign() -> None:
        array[first : first + len(frames)] = frames

    _to_its_end(assign)


def _to_its_end(work: Callable[[], Done]) -> Done:
    """Work on a thread and wait for it, Ctrl-C or not: zarr's own threads go on writing when who called them is stopped."""
    with ThreadPoolExecutor(max_workers=1) as thread:
        return thread.submit(work).result()
