"""One at a time: a folder that somebody works in."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from gramoscope.errors import OutputError

LOCK = ".reading.lock"


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Keep others from the reading of a folder while the block runs; the system opens the lock of a process that died.

    Raises
    ------
    OutputError
        If somebody else works there.
    """
    path = folder / LOCK
    with path.open("a+b") as file:
        if not _locked(file):
            raise OutputError(
                f"another transfer is being made in {folder}",
                "one at a time in a folder",
                "wait until it is done, stop it, or choose another --out",
            )
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                path.unlink()


def _locked(file: IO[bytes]) -> bool:
    if sys.platform == "win32":
        import msvcrt

        windows: Any = msvcrt
        try:
            windows.locking(file.fileno(), windows.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # storage without locks: nobody can be kept out
    return True
