"""A bag by BagIt 1.0 (RFC 8493): a payload, a manifest of its sums, and tags that say what it is.

The library `bagit` bags a folder in its own place, as version 0.97, and reads everything a second time for that; here a bag
is copied, summed and checked against the sums of the transfer in one go, and the library is the judge of what came out.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gramoscope.errors import GramoscopeError, OutputError, TransferError
from gramoscope.listening.whole_file import output_error
from gramoscope.player.transfer import TransferFile

ALGORITHMS = ("sha256", "sha512")
BLOCK_BYTES = 1 << 20


@dataclass
class BagFolder:
    """A bag that is being filled.

    Parameters
    ----------
    folder : Path
        Exists, and is empty.
    """

    folder: Path
    size_bytes: int = 0
    _payload: dict[str, tuple[str, ...]] = field(default_factory=dict)
    _tags: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def oxum(self) -> str:
        """Octets and streams of the payload."""
        return f"{self.size_bytes}.{len(self._payload)}"

    def add(self, file: TransferFile, *, link: bool, told: Callable[[int], None]) -> None:
        """Take a file into the payload.

        Parameters
        ----------
        file : TransferFile
        link : bool
            Give the same file a second name here instead of copying it, where the disk can do that.
        told : callable
            Told of every so many bytes that are done.

        Raises
        ------
        TransferError
            If it has another sum than it must have.
        OutputError
            If it cannot be written.
        """
        path = self.folder / "data" / file.name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            linked = link and _linked(file.path, path)
            sums = _summed(file.path, told) if linked else _copied(file.path, path, told)
        except OSError as error:
            raise output_error(path, error.strerror or str(error), number=error.errno) from error
        if file.sha256 not in ("", sums[0]):
            raise TransferError(
                f"{file.path} has the SHA-256 {sums[0]}",
                f"{file.sha256}, as when it was written",
                "the file was changed or is damaged: play the capture again, or fetch it from another copy",
            )
        self.size_bytes += file.size_bytes
        self._payload[f"data/{file.name}"] = sums

    def tag(self, name: str, text: str) -> None:
        """Write a tag file, in UTF-8.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        content, path = text.encode(), self.folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("wb") as file:
                file.write(content)
                os.fsync(file.fileno())
        except OSError as error:
            raise output_error(path, error.strerror or str(error), number=error.errno) from error
        self._tags[name] = tuple(hashlib.new(kind, content).hexdigest() for kind in ALGORITHMS)

    def finish(self, info: Mapping[str, str]) -> None:
        """Write what makes the folder a bag: declaration, information and manifests.

        Parameters
        ----------
        info : mapping
            Label → value for `bag-info.txt`; empty values are left out, line breaks become blanks.
        """
        self.tag("bagit.txt", "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n")
        lines = ((label, " ".join(value.split())) for label, value in info.items())
        self.tag("bag-info.txt", "".join(f"{label}: {value}\n" for label, value in lines if value))
        for number, kind in enumerate(ALGORITHMS):
            self.tag(f"manifest-{kind}.txt", _manifest(self._payload, number))
        tags = dict(self._tags)
        for number, kind in enumerate(ALGORITHMS):
            self.tag(f"tagmanifest-{kind}.txt", _manifest(tags, number))


def _manifest(sums: Mapping[str, tuple[str, ...]], number: int) -> str:
    return "".join(f"{digests[number]}  {name}\n" for name, digests in sorted(sums.items()))


def _linked(source: Path, path: Path) -> bool:
    try:
        os.link(source, path)
    except OSError:
        return False
    return True


def _summed(source: Path, told: Callable[[int], None]) -> tuple[str, ...]:
    sums = [hashlib.new(kind) for kind in ALGORITHMS]
    for block in _blocks(source):
        for each in sums:
            each.update(block)
        told(len(block))
    return tuple(each.hexdigest() for each in sums)


def _copied(source: Path, path: Path, told: Callable[[int], None]) -> tuple[str, ...]:
    sums = [hashlib.new(kind) for kind in ALGORITHMS]
    with path.open("xb") as file:
        for block in _blocks(source):
            file.write(block)
            for each in sums:
                each.update(block)
            told(len(block))
        file.flush()
        os.fsync(file.fileno())
    shutil.copystat(source, path)
    return tuple(each.hexdigest() for each in sums)


def _blocks(source: Path) -> Iterator[bytes]:
    try:
        with source.open("rb") as file:
            while block := file.read(BLOCK_BYTES):
                yield block
    except OSError as error:
        raise TransferError(
            f"{source} cannot be read: {error.strerror or error}", "files that can be read", "check its permissions"
        ) from error


def require_judge() -> None:
    """Require the library that judges bags.

    Raises
    ------
    GramoscopeError
        If it is not installed.
    """
    try:
        import bagit  # noqa: F401
    except ImportError as error:
        raise GramoscopeError(
            "the library bagit, which checks bags, is not installed",
            "bagit 1.9 or newer",
            "pip install 'gramoscope[archive]'",
        ) from error


def require_valid(folder: Path) -> None:
    """Require that a folder is a valid bag, by the library `bagit`: everything is read again as it lies on the disk.

    Raises
    ------
    OutputError
        If it is not.
    """
    import bagit

    with _silent("bagit"):
        try:
            bagit.Bag(str(folder)).validate()
        except bagit.BagError as error:
            raise OutputError(
                f"the bag does not hold what was written: {error}",
                "a disk that gives back what it was given",
                "try again, on another disk",
            ) from error


@contextlib.contextmanager
def _silent(name: str) -> Iterator[None]:
    """Keep a library's log from the terminal while the block runs: what matters comes as an exception."""
    log, nothing = logging.getLogger(name), logging.NullHandler()
    log.addHandler(nothing)
    try:
        yield
    finally:
        log.removeHandler(nothing)


def removed(files: Iterable[TransferFile], folder: Path) -> list[str]:
    """Remove files, and then the folders that have become empty; return the names of those that had been changed, and stay."""
    stay: list[str] = []
    folders = {folder}
    for file in files:
        folders |= {parent for parent in file.path.parents if folder in parent.parents}
        if file.is_still_the_same():
            file.path.unlink(missing_ok=True)
        else:
            stay.append(file.name)
    for each in sorted(folders, key=lambda path: len(path.parts), reverse=True):
        with contextlib.suppress(OSError):  # something else lies in it
            each.rmdir()
    return stay
