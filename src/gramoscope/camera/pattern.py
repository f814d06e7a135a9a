"""Where the frames lie: ``frames/g{group:06d}.tif``, ``frames.zarr``, ``frames.mkv``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from string import Formatter

from gramoscope.camera.frames import Layout
from gramoscope.errors import ArgumentError, require

TIFF_SUFFIXES = (".tif", ".tiff", ".btf", ".tf2", ".tf8")
IMAGE_SUFFIXES = (".png", ".bmp", ".jpg", ".jpeg", *TIFF_SUFFIXES)
VIDEO_SUFFIXES = (
    ".avi",
    ".mkv",
    ".mp4",
    ".mov",
    ".m4v",
    ".webm",
    ".mpg",
    ".mpeg",
    ".nut",
    ".ts",
    ".wmv",
    ".flv",
    ".mxf",
)

_FORMAT = re.compile(r"(0?[1-9]\d?)?d?")
_EXAMPLE = 'frames = "frames/g{group:06d}.tif" is a usual one'


@dataclass(frozen=True)
class FramePattern:
    """A path inside the capture's folder in which {group} and {frame} stand for numbers.

    Parameters
    ----------
    text : str

    Raises
    ------
    ArgumentError
        If it uses other fields, leaves the folder, or has an ending that no layout has.
    """

    text: str

    def __post_init__(self) -> None:
        require_inside(self.text)
        for name in _fields(self.text):
            require(
                name in ("group", "frame"), f"the pattern {self.text!r} uses {{{name}}}", "{group} and {frame} only"
            )
        _ = self.layout

    @property
    def fields(self) -> frozenset[str]:
        """Which of group and frame it uses."""
        return frozenset(_fields(self.text))

    @property
    def layout(self) -> Layout:
        """Which layout the pattern speaks of."""
        suffix = PurePosixPath(self.text).suffix.lower()
        if "frame" in self.fields and suffix in IMAGE_SUFFIXES:
            return "images"
        if "frame" not in self.fields and suffix in TIFF_SUFFIXES:
            return "tiff"
        if not self.fields and suffix == ".zarr":
            return "zarr"
        if not self.fields and suffix in VIDEO_SUFFIXES:
            return "video"
        raise ArgumentError(
            f"the frames are {self.text!r}, which is no known layout",
            "a TIFF a group ({group}), a picture a frame ({group} and {frame}), one .zarr, or one video",
            _EXAMPLE,
        )

    def require_distinct(self, *, groups: int) -> None:
        """Raise `ArgumentError` if several groups would lie in one file."""
        require(
            groups == 1 or self.layout in ("zarr", "video") or "group" in self.fields,
            f"the pattern {self.text!r} is the same for all {groups} groups",
            "{group} in it",
            _EXAMPLE,
        )

    def path(self, folder: Path, *, group: int = 0, frame: int = 0) -> Path:
        """Return where a frame lies."""
        return folder / self.text.format(group=group, frame=frame)


def _fields(text: str) -> list[str]:
    try:
        parts = list(Formatter().parse(text))
    except ValueError as error:
        raise ArgumentError(f"the pattern {text!r} cannot be read: {error}", "matching braces", _EXAMPLE) from None
    for _, name, form, conversion in parts:
        whole = conversion is None and _FORMAT.fullmatch(form or "")
        require(
            name is None or bool(whole), f"the pattern {text!r} has a strange format", "{group:06d} or alike", _EXAMPLE
        )
    return [name for _, name, _, _ in parts if name is not None]


def require_inside(text: str) -> None:
    """Raise `ArgumentError` unless `text` is a path that stays inside the folder it starts in."""
    posix, windows = PurePosixPath(text), PureWindowsPath(text)
    leaves = posix.is_absolute() or bool(windows.anchor) or ".." in posix.parts or ".." in windows.parts
    require(
        bool(text.strip()) and "\0" not in text and not leaves,
        f"the path {text!r} leaves the folder of the capture",
        "a path inside that folder",
        "move the file into the capture and name it from there",
    )


def is_inside(path: Path, folder: Path) -> bool:
    """Tell whether a path, with all links followed, lies in a folder."""
    return path.resolve().is_relative_to(folder.resolve())
