"""Writing a capture. It grows in a folder of its own beside its final place and moves there when it is whole, manifest last,
so that an interrupted film leaves nothing that claims to be a capture.
"""

from __future__ import annotations

import csv
import shutil
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.filming import say_done, say_whole
from gramoscope.apparatus.frame_log import HEADER, STAGE, nominal_arc_m
from gramoscope.apparatus.manifest import MANIFEST_NAME, write_manifest
from gramoscope.camera.frames import Frame
from gramoscope.camera.frames_image import write_png
from gramoscope.camera.frames_tiff import write_tiff
from gramoscope.camera.frames_video import VideoWriter
from gramoscope.camera.frames_zarr import create_zarr, write_zarr_frames
from gramoscope.camera.pattern import FramePattern
from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import MICROMETRES_PER_METRE, FloatArray, mirror
from gramoscope.errors import OutputError, require
from gramoscope.interruption import ctrl_c_waits

WrittenLayout = Literal["tiff", "png", "zarr", "video"]

LOG_NAME = "frames.csv"
PATTERNS: dict[WrittenLayout, str] = {
    "tiff": "frames/g{group:06d}.tif",
    "png": "frames/g{group:06d}_f{frame:02d}.png",
    "zarr": "frames.zarr",
    "video": "frames.mkv",
}


class _Shelf(Protocol):
    """Where the frames of one layout go."""

    def put(self, number: int, frames: Frame) -> None: ...

    def close(self, *, whole: bool) -> None: ...


class CaptureWriter:
    """Writes a capture, group by group; use it in a `with` statement.

    Parameters
    ----------
    folder : path
        Where the capture will be. Must not exist, be empty, or be a capture and `overwrite`.
    bench : Bench
        Canonical; says how many groups there will be, how deep the pixels are, and how the pictures are mirrored.
    layout : {"tiff", "png", "zarr", "video"}
        A TIFF a group, a PNG a frame, one Zarr array, or one lossless video (FFV1 in Matroska).
    compress : bool
        Whether TIFF (deflate), PNG and Zarr (zstd) spend time on smaller files; a video always does.
    overwrite : bool
        Whether an existing capture may be replaced. Until the new one is whole the old one stays.
    live : bool
        Film in place, so that somebody can follow (`apparatus.filming`): manifest first, log and marker after every group, in
        order. A live film that fails leaves nothing; one that is killed leaves its groups and the marker.

    Raises
    ------
    OutputError
        If the folder is in use, or cannot be written.
    CaptureError
        If a video is wanted and PyAV is not installed.
    """

    def __init__(
        self,
        folder: str | Path,
        bench: Bench,
        *,
        layout: WrittenLayout = "tiff",
        compress: bool = False,
        overwrite: bool = False,
        live: bool = False,
    ) -> None:
        require(layout in PATTERNS, f"layout {layout!r}", " or ".join(PATTERNS))
        require(
            not (live and layout == "video"), "a live video", "tiff, png or zarr", "a video can be read when it is done"
        )
        require(not (live and overwrite), "a live film over an earlier one", "a new folder")
        self.folder = Path(folder).absolute()
        self.bench = bench
        self.layout = layout
        self._overwrite = overwrite
        _require_free(self.folder, overwrite=overwrite)
        self._live = live
        hidden = self.folder.parent / f".{self.folder.name}.{uuid.uuid4().hex[:8]}.partial"
        self._staging = self.folder if live else hidden
        self._rows: dict[int, list[tuple[str, ...]]] = {}
        self._lock = threading.Lock()
        with self._giving_up(), ctrl_c_waits():
            (self._staging / "frames").mkdir(parents=True)
            self._shelf = _shelf(self._staging, bench, layout=layout, compress=compress)
            if live:
                say_whole(self._staging, 0)
                _write_log(self._staging / LOG_NAME, [])
                write_manifest(self._staging / MANIFEST_NAME, bench, frames=PATTERNS[layout], log=LOG_NAME)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._abandon()
            return
        with self._giving_up():
            self._finish()

    def write_group(
        self,
        number: int,
        images: npt.NDArray[Any],
        *,
        arc_start_m: FloatArray | None = None,
        stage_m: FloatArray | None = None,
        time_s: FloatArray | None = None,
    ) -> None:
        """Write the frames of one group.

        Parameters
        ----------
        number : int
            Each group once; in any order and from any thread, except for a video, which needs 0, 1, 2 … A group that is
            never written is a lost one to the reader.
        images : unsigned integer array, shape (frame, row, column), or (frame, row, column, 3) for a colour camera
            Canonical, 0 … white level. A colour camera writes grey pictures with three equal channels.
        arc_start_m : float array, shape (frame,), optional
            Place s of column 0, as the encoder says; the nominal one when left out.
        stage_m : float array, shape (frame,), optional
            Radial position of the microscope, positive inwards; 0 when left out.
        time_s : float array, shape (frame,), optional
            When each frame was taken; left empty in the log when unknown.

        Raises
        ------
        ArgumentError
            If the images do not fit the camera, or a group comes twice.
        OutputError
            If they cannot be written.
        """
        sequence = self.bench.sequence
        require(0 <= number < sequence.groups, f"group {number}", f"0 … {sequence.groups - 1}")
        stored = as_stored(images, sensor=self.bench.sensor, frames=sequence.frames_per_group)
        arc = nominal_arc_m(number, sequence=sequence) if arc_start_m is None else arc_start_m
        rows = _log_rows(number, arc, stage_m=stage_m, time_s=time_s)
        with self._lock:
            require(number not in self._rows, f"group {number} comes twice", "each group once")
            in_order = self.layout != "video" or number == len(self._rows)
            require(in_order, f"group {number} comes after {len(self._rows)} others", "a video's groups in order")
            later = self._live and number < max(self._rows, default=0)
            require(not later, f"group {number} comes after a later one", "a live film's groups in order")
            self._rows[number] = rows
            if self.layout == "video":
                self._put(number, stored)
        if self.layout != "video":
            self._put(number, stored)
        if self._live:
            with _output_errors(self.folder):
                _write_log(self._staging / LOG_NAME, rows, more=True)
                say_whole(self._staging, number + 1)

    def _put(self, number: int, stored: Frame) -> None:
        with _output_errors(self.folder):
            self._shelf.put(number, stored)

    def _finish(self) -> None:
        self._shelf.close(whole=True)
        frames = self._staging / "frames"
        if not any(frames.iterdir()):
            frames.rmdir()
        if not self._live:
            _write_log(self._staging / LOG_NAME, [row for _, rows in sorted(self._rows.items()) for row in rows])
        if self._live:
            say_done(self._staging)
            return
        write_manifest(self._staging / MANIFEST_NAME, self.bench, frames=PATTERNS[self.layout], log=LOG_NAME)
        _require_free(self.folder, overwrite=self._overwrite)
        _move_into_place(self._staging, self.folder)

    def _abandon(self) -> None:
        try:
            if hasattr(self, "_shelf"):
                self._shelf.close(whole=False)
        except Exception:  # the error that is under way is the one to tell about
            pass
        finally:
            shutil.rmtree(self._staging, ignore_errors=True)

    @contextmanager
    def _giving_up(self) -> Iterator[None]:
        """Leave nothing behind if anything goes wrong, Ctrl-C included."""
        try:
            with _output_errors(self.folder):
                yield
        except BaseException:
            self._abandon()
            raise


def as_stored(images: npt.NDArray[Any], *, sensor: Sensor, frames: int) -> Frame:
    """Return canonical images as the camera would have stored them: mirrored, in colour if it has colours.

    Parameters
    ----------
    images : unsigned integer array, shape (frame, row, column) or (frame, row, column, 3)
    sensor : Sensor
    frames : int
        How many there need to be.

    Returns
    -------
    uint8 or uint16 array, shape (frame, *sensor.frame_shape)

    Raises
    ------
    ArgumentError
        If they do not fit.
    """
    shape = (frames, sensor.height_px, sensor.width_px)
    fits = images.shape == shape or (sensor.colour == "rgb" and images.shape == (*shape, 3))
    require(fits, f"images of shape {images.shape}", f"{(frames, *sensor.frame_shape)}")
    require(images.dtype.kind == "u", f"images of type {images.dtype}", "unsigned whole numbers")
    top = int(images.max(initial=0))
    require(top <= sensor.white_level, f"a pixel of {top}", f"at most {sensor.white_level}")
    pixels = images.astype(sensor.dtype, copy=False)
    if images.ndim == 4:
        colours = [mirror(pixels[..., k], columns=sensor.columns, rows=sensor.rows) for k in range(3)]
        return np.stack(colours, axis=-1)
    grey = mirror(pixels, columns=sensor.columns, rows=sensor.rows)
    return np.repeat(grey[..., np.newaxis], 3, axis=-1) if sensor.colour == "rgb" else np.ascontiguousarray(grey)


def _log_rows(
    number: int, arc_m: FloatArray, *, stage_m: FloatArray | None, time_s: FloatArray | None
) -> list[tuple[str, ...]]:
    stage = np.zeros(len(arc_m)) if stage_m is None else stage_m
    times = [""] * len(arc_m) if time_s is None else [f"{float(one):.6f}" for one in time_s]
    return [(str(number), str(k), _micrometres(arc_m[k]), times[k], _micrometres(stage[k])) for k in range(len(arc_m))]


def _micrometres(value_m: float) -> str:
    return f"{float(value_m) * MICROMETRES_PER_METRE:.6f}"


def _write_log(path: Path, rows: list[tuple[str, ...]], *, more: bool = False) -> None:
    with path.open("a" if more else "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not more:
            writer.writerow((*HEADER, STAGE))
        writer.writerows(rows)


def _require_free(folder: Path, *, overwrite: bool) -> None:
    with _output_errors(folder):
        taken = folder.exists() and (not folder.is_dir() or any(folder.iterdir()))
        is_capture = (folder / MANIFEST_NAME).is_file()
    if taken and not is_capture:
        raise OutputError(f"{folder} is in use and is no capture", "a new or empty folder", "choose another name")
    if taken and not overwrite:
        raise OutputError(
            f"there is a capture in {folder} already",
            "a new folder",
            "overwrite it (--overwrite), or choose another name",
        )


def _move_into_place(staging: Path, folder: Path) -> None:
    old = staging.with_suffix(".old")
    if folder.exists():
        folder.rename(old)
    try:
        staging.rename(folder)
    except BaseException:
        if old.exists():
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _output_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"the capture {folder} cannot be written: {error.strerror or error}",
            "a folder that may be written, on a disk with room",
            "make room, or choose another place",
        ) from error


def _shelf(folder: Path, bench: Bench, *, layout: WrittenLayout, compress: bool) -> _Shelf:
    pattern = FramePattern(PATTERNS[layout])
    if layout == "video":
        return _VideoShelf(VideoWriter(pattern.path(folder), sensor=bench.sensor))
    if layout == "zarr":
        sequence = bench.sequence
        array = create_zarr(
            pattern.path(folder),
            groups=sequence.groups,
            frames_per_group=sequence.frames_per_group,
            sensor=bench.sensor,
            compress=compress,
        )
        return _ZarrShelf(array)
    if layout == "png":
        return _FileShelf(lambda number, frames: _write_pngs(folder, pattern, number, frames, compress=compress))
    return _FileShelf(lambda number, frames: write_tiff(pattern.path(folder, group=number), frames, compress=compress))


def _write_pngs(folder: Path, pattern: FramePattern, number: int, frames: Frame, *, compress: bool) -> None:
    for k, frame in enumerate(frames):
        write_png(pattern.path(folder, group=number, frame=k), frame, compress=compress)


class _FileShelf:
    def __init__(self, write: Callable[[int, Frame], None]) -> None:
        self._write = write

    def put(self, number: int, frames: Frame) -> None:
        self._write(number, frames)

    def close(self, *, whole: bool) -> None:
        """Nothing is open between groups."""


class _ZarrShelf:
    def __init__(self, array: Any) -> None:
        self._array = array

    def put(self, number: int, frames: Frame) -> None:
        write_zarr_frames(self._array, number * len(frames), frames)

    def close(self, *, whole: bool) -> None:
        """Nothing is open between groups."""


class _VideoShelf:
    def __init__(self, writer: VideoWriter) -> None:
        self._writer = writer

    def put(self, number: int, frames: Frame) -> None:
        self._writer.write(frames)

    def close(self, *, whole: bool) -> None:
        self._writer.close() if whole else self._writer.abandon()
