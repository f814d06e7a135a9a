"""A transfer as it lies in its folder: what its report says, its files, and the sums that they must have."""

from __future__ import annotations

import hashlib
import json
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from gramoscope.errors import TransferError
from gramoscope.player.outputs import REPORT
from gramoscope.player.reading_store import STORE
from gramoscope.player.report import REPORT_FORMAT
from gramoscope.player.track_file import sum_beside

_TRANSFER = "a folder that `gramoscope play` wrote"
_PLAY = "play the capture first: gramoscope play CAPTURE --out DIR"
_NEEDED = (
    *("made", "catalogue", "capture", "seconds", "rate_hz", "speed", "share", "flagged_samples", "noise_estimate"),
    *("files", "repair", "bench", "versions"),
)
_AGAIN = "play the capture again, or fetch the files from another copy"


@dataclass(frozen=True)
class TransferFile:
    """A file of a transfer.

    Attributes
    ----------
    path : Path
        Where it lies.
    name : str
        From the folder, with `/`.
    size_bytes : int
    sha256 : str
        The sum that it must have; empty where nobody says.
    identity : tuple of int
        Changes when the file is written or replaced.
    """

    path: Path
    name: str
    size_bytes: int
    sha256: str
    identity: tuple[int, ...]

    def is_still_the_same(self) -> bool:
        """Tell whether the file is the one that was found at first, unwritten since."""
        try:
            return _identity(self.path) == self.identity
        except OSError:
            return False


@dataclass(frozen=True)
class Transfer:
    """A whole transfer.

    Attributes
    ----------
    folder : Path
    report : mapping
        What `report.json` says.
    files : tuple of TransferFile
        Everything in the folder, whoever put it there, by name.
    """

    folder: Path
    report: Mapping[str, Any]
    files: tuple[TransferFile, ...]

    @property
    def size_bytes(self) -> int:
        """Of all files."""
        return sum(file.size_bytes for file in self.files)


def open_transfer(folder: Path) -> Transfer:
    """Return the transfer that lies in a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Transfer
        Sounds are not read yet: their sums are found out when they are copied.

    Raises
    ------
    TransferError
        If there is no report, a file of the report is missing, the sums beside the sounds are others than those in the
        report, a transfer is under way, or a name could not be kept in a bag.
    """
    if not folder.is_dir():
        raise TransferError(f"there is no folder {folder}", _TRANSFER, _PLAY)
    text, report = _report(folder)
    paths = dict(sorted(_everything(folder)))
    _require_names(folder, paths)
    sums = {**_sums(folder, report, paths), REPORT: hashlib.sha256(text).hexdigest()}
    found = tuple(
        TransferFile(path, name, path.stat().st_size, sums.get(name, ""), _identity(path))
        for name, path in paths.items()
    )
    return Transfer(folder, report, found)


def _identity(path: Path) -> tuple[int, ...]:
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _report(folder: Path) -> tuple[bytes, Mapping[str, Any]]:
    try:
        text = (folder / REPORT).read_bytes()
    except FileNotFoundError as error:
        raise TransferError(f"there is no {REPORT} in {folder}", _TRANSFER, _PLAY) from error
    try:
        report = json.loads(text)
    except ValueError as error:
        raise TransferError(f"{folder / REPORT} is not JSON: {error}", _TRANSFER, _AGAIN) from error
    found = report.get("format") if isinstance(report, dict) else None
    if found != REPORT_FORMAT:
        raise TransferError(
            f"{folder / REPORT} has the format {found!r}", f"the report of a transfer, {REPORT_FORMAT!r}", _PLAY
        )
    missing = [key for key in _NEEDED if key not in report]
    if missing:
        raise TransferError(
            f"{folder / REPORT} does not tell: {', '.join(missing)}", "a report of this version", _AGAIN
        )
    return text, report


def _sums(folder: Path, report: Mapping[str, Any], paths: Mapping[str, Path]) -> dict[str, str]:
    """Return file → sum of the report, when the files are there and the sums beside them say the same."""
    sums = {}
    for name, file in report["files"].items():
        flac = file.get("flac")
        for each, digest in [(name, file["sha256"]), *([(flac["name"], flac["sha256"])] if flac else [])]:
            _require_file(each, folder, paths)
            _require_sum_beside(paths[each], digest)
            sums[each] = digest
    for name in cue_files_of(report):
        _require_file(name, folder, paths)
    return sums


def cue_files_of(report: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the lists of what a repair touched; none where nothing was to be repaired."""
    cues = report["repair"]["cues"] if report["repair"] else {}
    return tuple(cues[which] for which in ("name", "labels") if which in cues)


def _require_file(name: str, folder: Path, paths: Mapping[str, Path]) -> None:
    if name not in paths:
        raise TransferError(f"there is no {name} in {folder}", f"every file that {REPORT} names", _AGAIN)


def _require_sum_beside(path: Path, digest: str) -> None:
    beside = sum_beside(path)
    try:
        said = beside.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise TransferError(f"{beside} cannot be read: {error}", "the sum beside each sound", _AGAIN) from error
    if said.split() != [digest, path.name]:
        raise TransferError(f"{beside} says {said.strip()[:100]!r}", f"{digest}, as in {REPORT}", _AGAIN)


def _everything(folder: Path) -> Iterator[tuple[str, Path]]:
    """All files, by their names from the folder."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if name.split("/")[0] == STORE:
            continue  # what was kept for another transfer is no part of this one
        if path.is_symlink() or not (path.is_dir() or path.is_file()):
            raise TransferError(
                f"{path} is no plain file",
                "plain files and folders",
                "put what it stands for in its place, or delete it",
            )
        if path.is_file():
            if path.name.startswith(".") and path.name.endswith(".part"):
                raise TransferError(
                    f"{path} is a file under way", "a finished transfer", "wait until it is done, or delete the file"
                )
            yield name, path


def _require_names(folder: Path, names: Iterable[str]) -> None:
    """Refuse names that a bag cannot hold, or that other systems take for one."""
    seen: dict[str, str] = {}
    for name in names:
        parts = PurePosixPath(name).parts
        blank = any(part != part.strip() for part in parts)
        if blank or "%" in name or not name.isprintable():
            raise TransferError(
                f"there is a file called {name!r} in {folder}",
                "names without per cent signs, line breaks, control characters and blanks at either end",
                "give it another name",
            )
        twin = seen.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
        if twin != name:
            raise TransferError(
                f"{twin!r} and {name!r} in {folder} are one name to other systems", "different names", "rename one"
            )
