"""The reading of a passage on disk: what the pickup saw, piece by piece, in a Zarr v3 group beside the growing sounds.

    walls     float64  (group, quantity, wall, sample)   offset_m, offset_sigma_m, slope, slope_sigma
    flags     uint16   (group, wall, sample)
    places    float64  (group, place)                    arc_start_m, arc_step_m, correlation_samples, wall angles
    strips    float32  (group, end, row, column)         the texture at both ends, for the splice; only rows that have any
    words     text     (piece,)                          how long each group's rows are, and which, its files, problems, sums
    learned   uint8    (byte,)                           what the passage taught the cartridge

A chunk holds a piece of the passage, so that pieces are written side by side by whoever read them. Rows are as long as they
need to be: the axes are as long as anything could be, and what nobody writes takes no room. The chunk in `words` is written
last, in one step, with sums over the others: a piece without it, or with other sums, was not written.
"""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import zarr

from gramoscope.apparatus.bench import Bench
from gramoscope.camera.quiet import quiet_warnings
from gramoscope.conventions import Float32Array, FloatArray, IntArray
from gramoscope.listening.whole_file import output_error
from gramoscope.player.files_seen import FileSeen
from gramoscope.player.kept_records import DamagedRecordError, bytes_of, record_of
from gramoscope.player.learned import Learned
from gramoscope.player.reading_manifest import key_of
from gramoscope.signal_path import Texture, WallTrace

STORE = ".reading.zarr"
"""Where it lies in the folder of a transfer."""
QUANTITIES = ("offset_m", "offset_sigma_m", "slope", "slope_sigma")
PLACES = ("arc_start_m", "arc_step_m", "correlation_samples", "inner_wall_angle_rad", "outer_wall_angle_rad")
ENDS = ("head", "tail")
LARGEST_PIECE = 64
"""Groups: a minute or so of work, and some ten megabytes."""
PIECES = 16
"""A shorter passage has at least so many pieces, or one for each group, so that all workers have something to do."""
STRIP_ROWS = 64
"""A chunk holds so many rows of a strip; most of the picture is out of focus, and has none."""
_ROOM = {"walls": 4, "flags": 4, "strips": 8}
"""A chunk holds so many samples or columns: the picture's width over this. Longer rows need a second chunk."""


@dataclass(frozen=True, eq=False)
class GroupReading:
    """What was read in one group, and from what.

    Attributes
    ----------
    trace : WallTrace
    frames_lost : int
    files : tuple of FileSeen
    """

    trace: WallTrace
    frames_lost: int = 0
    files: tuple[FileSeen, ...] = ()


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the passage as it was read.

    Attributes
    ----------
    groups : tuple of GroupReading
        In order.
    failed : tuple of str
        What went wrong in which group, in words: groups that could not be read for a reason that is not in the film.
    processor : str
        What read it: another kind may round otherwise.
    """

    groups: tuple[GroupReading, ...]
    failed: tuple[str, ...] = ()
    processor: str = ""


def groups_a_piece(group_count: int) -> int:
    """Return how many groups of a passage make a piece."""
    return int(np.clip(group_count // PIECES, 1, LARGEST_PIECE))


@dataclass(frozen=True, eq=False)
class ReadingStore:
    """A store that was made by `create_store` or found by `open_store`.

    Attributes
    ----------
    root : Path
    arrays : mapping
        The Zarr arrays by name.
    manifest : mapping
        What the reading depends on, see `reading_manifest`.
    recipe : mapping
        The table of the recipe.
    group_count, piece_groups : int
        Groups in the passage and in a piece.
    """

    root: Path
    arrays: Mapping[str, Any]
    manifest: Mapping[str, str]
    recipe: Mapping[str, Any]
    group_count: int
    piece_groups: int

    @property
    def pieces(self) -> range:
        """The numbers of all pieces."""
        return range(-(-self.group_count // self.piece_groups))

    def groups_of(self, piece: int) -> range:
        """Return the groups of a piece."""
        return range(piece * self.piece_groups, min((piece + 1) * self.piece_groups, self.group_count))

    def is_written(self, piece: int) -> bool:
        """Tell whether a piece was written, at first sight."""
        return (self.root / "words" / "c" / str(piece)).is_file()

    def forget(self, piece: int) -> None:
        """Take a piece for unwritten."""
        (self.root / "words" / "c" / str(piece)).unlink(missing_ok=True)

    def write(self, number: int, piece: Piece) -> None:
        """Write a piece; what was there makes way first.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        ends = [_ends_of(one.trace) for one in piece.groups]
        arrays = _arrays_of([one.trace for one in piece.groups], ends)
        words = {
            "key": key_of(self.manifest),
            "sums": {name: zlib.crc32(array.data) for name, array in arrays.items()},
            "groups": [_words_of(one, both) for one, both in zip(piece.groups, ends, strict=True)],
            "failed": list(piece.failed),
            "processor": piece.processor,
        }
        first = self.groups_of(number).start
        try:
            self.forget(number)
            for name, array in arrays.items():
                place = (slice(first, first + len(array)), *(slice(0, length) for length in array.shape[1:]))
                if array.size:
                    self.arrays[name][place] = array
            self.arrays["words"][number : number + 1] = np.array([json.dumps(words)], dtype=object)
        except OSError as error:
            raise output_error(self.root, error.strerror or str(error), number=error.errno) from error

    def read(self, number: int) -> Piece | None:
        """Return a piece as it was written; None if it was not, or not whole."""
        if not self.is_written(number):
            return None
        try:
            words = json.loads(str(self.arrays["words"][number]))
            arrays = self._read_arrays(number, words)
        except Exception:  # zarr raises whatever it likes at broken chunks
            return None
        # whoever was left over from an earlier reading may still have written here
        sums = {name: zlib.crc32(array.data) for name, array in arrays.items()}
        if words["key"] != key_of(self.manifest) or words["sums"] != sums:
            return None
        groups = tuple(_reading_of(said, i, arrays) for i, said in enumerate(words["groups"]))
        return Piece(groups, tuple(words["failed"]), words["processor"])

    def files(self, number: int) -> Iterator[FileSeen]:
        """Yield the files of a piece as they were when it was read; none where it was not."""
        if self.is_written(number):
            for one in json.loads(str(self.arrays["words"][number]))["groups"]:
                yield from (FileSeen(*file) for file in one["files"])

    def _read_arrays(self, number: int, words: Mapping[str, Any]) -> dict[str, Any]:
        groups, said = self.groups_of(number), words["groups"]
        place, samples = slice(groups.start, groups.stop), _most(one["samples"] for one in said)
        strips = [Rows.said(end) for one in said for end in one["strips"] if end is not None]
        rows, columns = _most(strip.used.size for strip in strips), _most(strip.columns for strip in strips)
        found = {
            "walls": self.arrays["walls"][place, :, :, :samples],
            "flags": self.arrays["flags"][place, :, :samples],
            "places": self.arrays["places"][place],
            "strips": self.arrays["strips"][place, :, :rows, :columns],
        }
        return {name: np.ascontiguousarray(array) for name, array in found.items()}

    def learned(self) -> Learned | None:
        """Return what the passage taught; None if that was not written, or not whole."""
        try:
            return record_of(np.asarray(zarr.open_array(self.root / "learned", mode="r")[:]).tobytes(), Learned)
        except (DamagedRecordError, OSError, KeyError, ValueError):
            return None

    def keep_learned(self, learned: Learned) -> None:
        """Write what the passage taught; OutputError if the disk is full."""
        data = np.frombuffer(bytes_of(learned), np.uint8)
        try:
            array = zarr.create_array(
                self.root / "learned", shape=data.shape, chunks=data.shape, dtype=data.dtype, overwrite=True
            )
            array[:] = data
        except OSError as error:
            raise output_error(self.root, error.strerror or str(error), number=error.errno) from error


def create_store(
    root: Path, bench: Bench, *, group_count: int, manifest: Mapping[str, str], recipe: Mapping[str, Any]
) -> ReadingStore:
    """Create an empty store; one that was there makes way.

    Parameters
    ----------
    root : Path
        The ``.zarr`` folder.
    bench : Bench
    group_count : int
    manifest : mapping
    recipe : mapping

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    piece, sensor = groups_a_piece(group_count), bench.sensor
    said: Any = {"manifest": dict(manifest), "recipe": dict(recipe), "group_count": group_count, "piece_groups": piece}
    longest, height = sensor.width_px * bench.sequence.frames_per_group, sensor.height_px
    samples, columns = -(-sensor.width_px // _ROOM["walls"]), -(-sensor.width_px // _ROOM["strips"])
    try:
        discard_store(root)
        with quiet_warnings():
            group = zarr.create_group(root, attributes={"quantities": QUANTITIES, "places": PLACES, "ends": ENDS})
            _create(group, "walls", (group_count, 4, 2, longest), (piece, 4, 2, samples), "f8", fill=np.nan)
            _create(group, "flags", (group_count, 2, longest), (piece, 2, samples), "u2")
            _create(group, "places", (group_count, len(PLACES)), (piece, len(PLACES)), "f8", fill=np.nan)
            _create(group, "strips", (group_count, 2, height, longest), (piece, 2, STRIP_ROWS, columns), "f4")
            group.create_array("words", shape=(-(-group_count // piece),), chunks=(1,), dtype=str, config=_CONFIG)
            group.attrs["reading"] = said  # last: a store without it was not made to its end
        return ReadingStore(root, _arrays(root), manifest, recipe, group_count, piece)
    except OSError as error:
        raise output_error(root, error.strerror or str(error), number=error.errno) from error


_CONFIG: Any = {"write_empty_chunks": True}
_AXES = {
    "walls": ("group", "quantity", "wall", "sample"),
    "flags": ("group", "wall", "sample"),
    "places": ("group", "place"),
    "strips": ("group", "end", "row", "column"),
}


def _create(
    group: zarr.Group, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], dtype: str, fill: float = 0
) -> None:
    # float32 texture hardly gets smaller, and takes time to
    packed: Any = None if name == "strips" else "auto"
    group.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        compressors=packed,
        fill_value=fill,
        dimension_names=_AXES[name],
        config=_CONFIG,
    )


def open_store(root: Path) -> ReadingStore | None:
    """Return the store in a folder; None if there is none, or not a whole one."""
    try:
        with quiet_warnings():
            group = zarr.open_group(root, mode="r+")
            said: Any = group.attrs["reading"]
            arrays = _arrays(root)
        return ReadingStore(root, arrays, said["manifest"], said["recipe"], said["group_count"], said["piece_groups"])
    except Exception:  # zarr raises whatever it likes at a broken folder
        return None


def _arrays(root: Path) -> dict[str, Any]:
    # how to treat chunks of nothing but zeros is not kept on disk: −0 is taken for 0 there unless this is said again
    return {name: zarr.open_array(root / name, mode="r+", config=_CONFIG) for name in (*_AXES, "words")}


def discard_store(root: Path) -> None:
    """Remove a store, its description first, so that what is left of it when that is interrupted is none."""
    (root / "zarr.json").unlink(missing_ok=True)
    shutil.rmtree(root, ignore_errors=True)


@dataclass(frozen=True, eq=False)
class Rows:
    """Which rows of a strip are kept; the others are zero.

    Attributes
    ----------
    used : int64 array, shape (row,)
    height, columns : int
        Of the strip.
    """

    used: IntArray
    height: int
    columns: int

    @classmethod
    def of(cls, end: Texture) -> Self:
        """Return the rows of a strip that have any texture, even if it is −0."""
        return cls(np.flatnonzero(np.bitwise_or.reduce(end.strip.view(np.uint32), axis=1)), *end.strip.shape)

    @classmethod
    def said(cls, words: Mapping[str, Any]) -> Self:
        """Return the rows that words tell of."""
        runs = [np.arange(first, stop) for first, stop in words["rows"]]
        return cls(np.concatenate([np.zeros(0, np.int64), *runs]), *words["size"])

    def in_words(self) -> dict[str, Any]:
        """Return the runs of rows, each by its first and the one after its last, and the size of the strip."""
        runs = np.split(self.used, np.flatnonzero(np.diff(self.used) > 1) + 1) if self.used.size else []
        return {"rows": [[int(run[0]), int(run[-1]) + 1] for run in runs], "size": [self.height, self.columns]}

    def unpacked(self, kept: Float32Array) -> Float32Array:
        """Return the strip, of the rows that were kept."""
        strip = np.zeros((self.height, self.columns), np.float32)
        strip[self.used] = kept[: self.used.size, : self.columns]
        return strip


def _most(lengths: Any) -> int:
    return max(lengths, default=0)


Ends = list[Rows | None]
"""What is kept of the strips at both ends of a stretch."""


def _ends_of(trace: WallTrace) -> Ends:
    return [None if end is None else Rows.of(end) for end in (trace.head, trace.tail)]


def _arrays_of(traces: Sequence[WallTrace], ends: Sequence[Ends]) -> dict[str, Any]:
    samples = _most(trace.offset_m.shape[1] for trace in traces)
    strips = [rows for both in ends for rows in both if rows is not None]
    rows, columns = _most(strip.used.size for strip in strips), _most(strip.columns for strip in strips)
    arrays: dict[str, Any] = {
        "walls": np.full((len(traces), 4, 2, samples), np.nan),
        "flags": np.zeros((len(traces), 2, samples), np.uint16),
        "places": np.array([_places_of(trace) for trace in traces]),
        "strips": np.zeros((len(traces), 2, rows, columns), np.float32),
    }
    for i, trace in enumerate(traces):
        for k, quantity in enumerate(QUANTITIES):
            arrays["walls"][i, k, :, : trace.offset_m.shape[1]] = getattr(trace, quantity)
        arrays["flags"][i, :, : trace.flags.shape[1]] = trace.flags
        for k, (end, kept) in enumerate(zip((trace.head, trace.tail), ends[i], strict=True)):
            if end is not None and kept is not None:
                arrays["strips"][i, k, : kept.used.size, : kept.columns] = end.strip[kept.used]
    # there are many NaNs, with a sign for instance; a chunk of nothing else comes back as the one it is filled with
    for name in ("walls", "places"):
        arrays[name][np.isnan(arrays[name])] = np.nan
    return arrays


def _places_of(trace: WallTrace) -> FloatArray:
    return np.array([trace.arc_start_m, trace.arc_step_m, trace.correlation_samples, *trace.wall_angle_rad])


def _words_of(reading: GroupReading, ends: Ends) -> dict[str, Any]:
    trace = reading.trace
    return {
        "number": trace.number,
        "samples": trace.offset_m.shape[1],
        "frame_step_m": trace.frame_step_m.tolist(),
        "problems": list(trace.problems),
        "strips": [None if kept is None else kept.in_words() for kept in ends],
        "strip_places": [
            None if end is None else [float(end.arc_start_m), float(end.pixel_pitch_m), float(end.stage_m)]
            for end in (trace.head, trace.tail)
        ],
        "frames_lost": reading.frames_lost,
        "files": [[file.name, file.sha256, file.size_bytes, file.modified_ns] for file in reading.files],
    }


def _reading_of(said: Mapping[str, Any], i: int, arrays: Mapping[str, Any]) -> GroupReading:
    samples, places = said["samples"], arrays["places"][i]
    walls = [np.ascontiguousarray(arrays["walls"][i, k, :, :samples]) for k in range(len(QUANTITIES))]
    head, tail = (_strip_of(said, k, arrays["strips"][i]) for k in range(len(ENDS)))
    trace = WallTrace(
        number=said["number"],
        arc_start_m=float(places[0]),
        arc_step_m=float(places[1]),
        offset_m=walls[0],
        offset_sigma_m=walls[1],
        slope=walls[2],
        slope_sigma=walls[3],
        correlation_samples=float(places[2]),
        flags=np.ascontiguousarray(arrays["flags"][i, :, :samples]),
        head=head,
        tail=tail,
        frame_step_m=np.array(said["frame_step_m"], np.float64),
        wall_angle_rad=places[3:5].copy(),
        problems=tuple(said["problems"]),
    )
    return GroupReading(trace, said["frames_lost"], tuple(FileSeen(*file) for file in said["files"]))


def _strip_of(said: Mapping[str, Any], end: int, strips: Any) -> Texture | None:
    kept, place = said["strips"][end], said["strip_places"][end]
    return None if kept is None else Texture(Rows.said(kept).unpacked(strips[end]), *place)
