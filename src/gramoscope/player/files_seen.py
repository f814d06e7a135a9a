"""Files as they were when they were read, to find out later whether they still are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from gramoscope.apparatus.capture import Capture
from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.camera.contents import Contents
from gramoscope.player.provenance import hash_group


@dataclass(frozen=True)
class FileSeen:
    """A file of a group as it was when it was read.

    Attributes
    ----------
    name : str
        From the capture's folder, with slashes.
    sha256 : str
        Empty where it could not be read.
    size_bytes, modified_ns : int
        −1 where there was none.
    """

    name: str
    sha256: str
    size_bytes: int
    modified_ns: int


Look = dict[str, tuple[int, int]]
"""Size and time of writing of files, by name."""


def look_at(capture: Capture, number: int) -> Look:
    """Return size and time of writing of the files of a group."""
    return {path.relative_to(capture.folder).as_posix(): _stat(path) for path in capture.files_of_group(number)}


def seen(capture: Capture, number: int, before: Look, read: Contents) -> tuple[tuple[FileSeen, ...], bool]:
    """Return the files of a group with their sums, and whether they stayed as they were when somebody looked before.

    What was read of them may have been summed already; the others are now.
    """
    sums = hash_group(capture, number, read)
    after = look_at(capture, number)
    return tuple(FileSeen(name, sums[name], *before[name]) for name in sums), after == before


def changed(capture: Capture, files: Iterable[FileSeen], *, verify: bool = False) -> Iterator[FileSeen]:
    """Yield those files that are no longer what was read.

    Parameters
    ----------
    capture : Capture
    files : iterable of FileSeen
    verify : bool
        Add up every file; otherwise only those whose size or time of writing is another.
    """
    for file in files:
        path = capture.folder / file.name
        moved = _stat(path) != (file.size_bytes, file.modified_ns)
        if (moved or verify) and sha256_of_file(path) != file.sha256:
            yield file


def _stat(path: Path) -> tuple[int, int]:
    try:
        status = path.stat()
    except OSError:
        return -1, -1
    return status.st_size, status.st_mtime_ns
