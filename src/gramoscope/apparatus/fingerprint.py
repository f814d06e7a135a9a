"""Which files were read: SHA-256 sums for the provenance in the report."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from gramoscope.camera.contents import PIECE_BYTES


def sha256_of_file(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal; an empty text if it cannot be read."""
    try:
        with path.open("rb", buffering=0) as file:
            total, room = hashlib.sha256(), memoryview(bytearray(PIECE_BYTES))
            while count := file.readinto(room):
                total.update(room[:count])
            return total.hexdigest()
    except OSError:
        return ""


def sha256_of_files(paths: Iterable[Path], *, folder: Path) -> str:
    """Return one SHA-256 for many files, in the order of their names.

    Parameters
    ----------
    paths : iterable of Path
    folder : Path
        Names are counted from here.

    Returns
    -------
    str
        The sum over each file's name and its own sum, so that neither can be swapped unseen.
    """
    total = hashlib.sha256()
    for name, path in sorted((path.relative_to(folder).as_posix(), path) for path in paths):
        total.update(f"{name}\0{sha256_of_file(path)}\n".encode())
    return total.hexdigest()
