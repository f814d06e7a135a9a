"""A capture on disk: a folder with `capture.toml` and frames, read one stretch at a time.

What the world did to the frames (one is missing, truncated, of the wrong size) never raises: the frame is black, not
`valid`, and the group says in words what happened. Several threads may read different groups at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.filming import MARKER
from gramoscope.apparatus.fingerprint import sha256_of_file, sha256_of_files
from gramoscope.apparatus.frame_log import FrameLog, believed_places, nominal_arc_m, read_log, stands_alone
from gramoscope.apparatus.manifest import MANIFEST_NAME, Manifest, read_manifest
from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Frame, FrameSource, Layout, Lost, Unusable, as_they_lie, develop
from gramoscope.camera.frames_image import ImageFrames
from gramoscope.camera.frames_tiff import TiffFrames
from gramoscope.camera.frames_video import VideoFrames
from gramoscope.camera.frames_zarr import open_zarr
from gramoscope.camera.pattern import FramePattern, is_inside
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.errors import ManifestError, NoFramesError, require
from gramoscope.signal_path import FrameGroup, ImageArray


@dataclass(frozen=True, eq=False)
class Capture:
    """A capture that was opened with `open_capture`.

    Attributes
    ----------
    folder : Path
    manifest : Manifest
    source : FrameSource
        The stored frames.
    log : FrameLog or None
    """

    folder: Path
    manifest: Manifest
    source: FrameSource
    log: FrameLog | None = None

    @property
    def name(self) -> str:
        """Of the folder."""
        return self.folder.resolve().name

    @property
    def path(self) -> Path:
        """What was opened: the folder."""
        return self.folder

    @property
    def bench(self) -> Bench:
        """The apparatus, canonical."""
        return self.manifest.bench

    @property
    def layout(self) -> Layout:
        """How the frames are kept: "tiff", "images", "zarr" or "video"."""
        return self.source.layout

    @property
    def group_count(self) -> int:
        """How many groups `capture.toml` promises."""
        return self.bench.sequence.groups

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong with the capture as a whole, in words; a group's own problems are in the group."""
        filming = (f"{MARKER} says that it is still being filmed",) if (self.folder / MARKER).is_file() else ()
        return (*(self.log.problems if self.log is not None else ()), *filming)

    def group(self, number: int, contents: Contents | None = None) -> FrameGroup:
        """Read one stretch.

        Parameters
        ----------
        number : int
            0 … `group_count` − 1.
        contents : Contents, optional
            From which files are read, where somebody else wants them too.

        Returns
        -------
        FrameGroup
            Canonical and grey. Frames that could not be read are black and not valid.

        Raises
        ------
        ArgumentError
            If there is no such group.
        """
        stored = self.source.read_group(number, contents or Contents())
        return self._group(number, lambda remarks: self._read(stored, remarks))

    def unread_group(self, number: int, why: str) -> FrameGroup:
        """Return a stretch none of whose frames could be read, for a reason that is not in the capture.

        Parameters
        ----------
        number : int
        why : str
            For the group's problems.
        """

        def nothing(remarks: _Remarks) -> tuple[ImageArray, BoolArray]:
            remarks.add(why)
            return self._developed([], remarks)

        return self._group(number, nothing)

    def _group(self, number: int, read: Callable[[_Remarks], tuple[ImageArray, BoolArray]]) -> FrameGroup:
        require(0 <= number < self.group_count, f"group {number}", f"0 … {self.group_count - 1}")
        sensor, remarks = self.bench.sensor, _Remarks()
        images, valid = read(remarks)
        arc_start_m, stage_m = self._places(number, remarks)
        return FrameGroup(
            number=number,
            images=images,
            arc_start_m=arc_start_m,
            stage_m=stage_m,
            pixel_pitch_m=sensor.pixel_pitch_m,
            white_level=sensor.white_level,
            valid=valid,
            problems=remarks.in_words(),
        )

    def _read(self, stored: Iterator[Frame | Lost], remarks: _Remarks) -> tuple[ImageArray, BoolArray]:
        """Return the frames of a group, and which of them are valid."""
        expected = self.bench.sequence.frames_per_group
        frames = list(islice(stored, expected))
        broken = bool(frames) and isinstance(frames[-1], Lost) and frames[-1].rest
        images = as_they_lie(frames, sensor=self.bench.sensor) if len(frames) == expected else None
        found = (images, np.ones(expected, np.bool_)) if images is not None else self._developed(frames, remarks)
        if len(frames) < expected and not broken:
            remarks.add(f"the file ends after {len(frames)} of {expected} frames", *range(len(frames), expected))
        elif not broken and not isinstance(next(stored, Lost("")), Lost):
            remarks.add(f"there are more than {expected} frames: the rest is not used")
        return found

    def _developed(self, frames: Sequence[Frame | Lost], remarks: _Remarks) -> tuple[ImageArray, BoolArray]:
        """Make pictures of the frames that were stored; those that are lost or useless are black."""
        sequence, sensor = self.bench.sequence, self.bench.sensor
        images: ImageArray = np.empty((sequence.frames_per_group, sensor.height_px, sensor.width_px), sensor.dtype)
        valid = np.zeros(sequence.frames_per_group, np.bool_)
        for number, frame in enumerate(frames):
            if isinstance(frame, Lost):
                remarks.add(frame.why, *range(number, len(images) if frame.rest else number + 1))
                continue
            remark = develop(frame, sensor=sensor, out=images[number])
            valid[number] = not isinstance(remark, Unusable)
            if remark is not None:
                remarks.add(remark, number)
        images[~valid] = 0
        return images, valid

    def _places(self, number: int, remarks: _Remarks) -> tuple[FloatArray, FloatArray]:
        nominal = nominal_arc_m(number, sequence=self.bench.sequence)
        if self.log is None:
            return nominal, np.zeros_like(nominal)
        width_m = self.bench.sensor.width_px * self.bench.sensor.pixel_pitch_m
        arc_m, slipped = believed_places(self.log.arc_m[number], nominal, width_m=width_m)
        alone = stands_alone(number, self.log, sequence=self.bench.sequence, width_m=width_m)
        if alone is not None:
            remarks.add("the place in the log is near to that of no group before or after it: not believed")
            arc_m = nominal + alone
        stage_m = self.log.stage_m[number]
        if alone is None and slipped.any():
            remarks.add(
                "the place in the log lies far from where the other frames are: not believed",
                *np.flatnonzero(slipped).tolist(),
            )
        unknown = np.isnan(arc_m)
        if unknown.any():
            remarks.add("no place in the log: the nominal one is used", *np.flatnonzero(unknown).tolist())
        return np.where(unknown, nominal, arc_m), np.nan_to_num(stage_m, nan=0.0)

    def groups(self, start: int = 0, stop: int | None = None) -> Iterator[FrameGroup]:
        """Read stretches in order, one at a time.

        Parameters
        ----------
        start, stop : int
            From `start` up to but not including `stop`; to the end when it is None.

        Yields
        ------
        FrameGroup
        """
        for number in range(start, self.group_count if stop is None else min(stop, self.group_count)):
            yield self.group(number)

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return the files that hold one group and no other (none for a video)."""
        return self.source.files_of_group(number)

    def common_files(self) -> tuple[Path, ...]:
        """Return the files that belong to the whole capture: manifest, log, video, description of a Zarr array."""
        log = (self.folder / self.manifest.log,) if self.manifest.log is not None else ()
        return (self.folder / MANIFEST_NAME, *log, *self.source.common_files())

    def fingerprint(self, progress: Callable[[int, int], None] | None = None) -> dict[str, str]:
        """Return the SHA-256 of all that was filmed, for the provenance of a result.

        Parameters
        ----------
        progress : callable, optional
            Called with the number of groups done and the number of all.

        Returns
        -------
        dict
            Path inside the capture → sum in hexadecimal, empty for a file that cannot be read. A Zarr array has one sum
            under its own name (`sha256_of_files`).
        """
        sums = {path.relative_to(self.folder).as_posix(): sha256_of_file(path) for path in self._single_files()}
        if self.layout == "zarr":
            root = self.folder / self.manifest.frames
            sums[self.manifest.frames] = sha256_of_files((p for p in root.rglob("*") if p.is_file()), folder=root)
            return sums
        for number in range(self.group_count):
            for path in self.files_of_group(number):
                sums[path.relative_to(self.folder).as_posix()] = sha256_of_file(path)
            if progress is not None:
                progress(number + 1, self.group_count)
        return sums

    def _single_files(self) -> tuple[Path, ...]:
        inside = set(self.source.common_files()) if self.layout == "zarr" else set()
        return tuple(path for path in self.common_files() if path not in inside)


class _Remarks:
    """Collects what was found wrong with which frames, and says it in as few words as will do."""

    def __init__(self) -> None:
        self._frames: dict[str, list[int]] = {}

    def add(self, remark: str, *frames: int) -> None:
        self._frames.setdefault(remark, []).extend(frames)

    def in_words(self) -> tuple[str, ...]:
        return tuple(f"{spans(frames)}: {remark}" if frames else remark for remark, frames in self._frames.items())


def spans(numbers: list[int]) -> str:
    """Return which frames are meant, e.g. "frames 0, 3 … 7"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1][1:] = [number]
        else:
            runs.append([number])
    words = ", ".join(" … ".join(str(end) for end in run) for run in runs)
    return f"frame {words}" if len(numbers) == 1 else f"frames {words}"


def open_capture(folder: str | Path) -> Capture:
    """Open a capture.

    Parameters
    ----------
    folder : path
        Where its `capture.toml` lies.

    Returns
    -------
    Capture

    Raises
    ------
    CaptureError
        If there is no such folder, or a video cannot be read without PyAV.
    ManifestError
        If its manifest is wrong, or names a path that leaves the folder.
    NoFramesError
        If there is not one frame in it.
    """
    folder = Path(folder)
    manifest = read_manifest(folder / MANIFEST_NAME)
    _require_inside(folder, manifest)
    source = _source(folder, manifest)
    if not source.any_frame():
        raise _no_frames(folder, manifest)
    log = None if manifest.log is None else read_log(folder / manifest.log, sequence=manifest.bench.sequence)
    return Capture(folder, manifest, source, log)


def _require_inside(folder: Path, manifest: Manifest) -> None:
    paths = [FramePattern(manifest.frames).path(folder)]
    if manifest.log is not None:
        paths.append(folder / manifest.log)
    for path in paths:
        if not is_inside(path, folder):
            raise ManifestError(
                f"{path} leads out of the capture's folder, to {path.resolve()}",
                "frames and log inside the folder",
                "copy the files into the capture instead of linking to them",
            )


def _source(folder: Path, manifest: Manifest) -> FrameSource:
    pattern, sensor, sequence = FramePattern(manifest.frames), manifest.bench.sensor, manifest.bench.sequence
    if pattern.layout == "tiff":
        return TiffFrames(folder, pattern, sequence.groups, sequence.frames_per_group, sensor)
    if pattern.layout == "images":
        return ImageFrames(folder, pattern, sequence.groups, sequence.frames_per_group, sensor)
    path = pattern.path(folder)
    if not path.exists():
        raise _no_frames(folder, manifest)
    if pattern.layout == "zarr":
        return open_zarr(path, frames_per_group=sequence.frames_per_group, sensor=sensor)
    return VideoFrames(path, frames_per_group=sequence.frames_per_group)


def _no_frames(folder: Path, manifest: Manifest) -> NoFramesError:
    return NoFramesError(
        f"there is not one frame in {folder}",
        f"files like {manifest.frames}",
        "check the path after frames in capture.toml, and that the copy is complete",
    )
