"""Files that appear whole or not at all.

Whatever is written first goes to a temporary sibling (same folder, hidden name, ending in `.part`), and takes its place
under its own name in one step when it is complete. An error, a full disk or Ctrl-C on the way leaves the old file, if
there was one, and nothing else.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gramoscope.errors import OutputError
from gramoscope.interruption import ctrl_c_waits

_NEEDED = "a folder that exists, that you may write in, with space for the results"
_REMEDIES: dict[int, str] = {
    errno.ENOENT: "create the folder first, or choose another",
    errno.ENOTDIR: "choose a folder: a file has that name",
    errno.EISDIR: "choose another name: a folder has that one",
    errno.EACCES: "choose a folder that you may write in, or change its permissions",
    errno.EPERM: "choose a folder that you may write in, or change its permissions",
    errno.EROFS: "choose a folder on a disk that is not read-only",
    errno.ENAMETOOLONG: "choose a shorter name",
}


def output_error(path: Path, reason: str, *, number: int | None = None) -> OutputError:
    """Return the error for a file that cannot be written.

    Parameters
    ----------
    path : Path
        The file under its final name.
    reason : str
        What the system said.
    number : int, optional
        The system's error number; unknown ones are taken for a lack of space.

    Returns
    -------
    OutputError
        With a remedy that fits the number.
    """
    remedy = _REMEDIES.get(number or 0) or f"free some space or choose another disk: {_free_space(path)}"
    return OutputError(f"{path} cannot be written: {reason}", _NEEDED, remedy)


def _free_space(path: Path) -> str:
    try:
        free_bytes = shutil.disk_usage(path.parent).free
    except OSError:
        return "how much is free here is unknown"
    return f"{free_bytes / 1e6:.0f} MB are free here"


def temporary_sibling(path: Path) -> Path:
    """Return the name under which a file is written until it is whole."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def create_temporary(path: Path) -> Path:
    """Create the empty temporary sibling of a file, so that a hopeless place is found out at once.

    Raises
    ------
    OutputError
        If the folder is missing, read-only, forbidden or full, or if `path` is a folder.
    """
    temporary = temporary_sibling(path)
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        temporary.touch()
    except OSError as error:
        raise output_error(path, error.strerror or str(error), number=error.errno) from error
    return temporary


def put_in_place(temporary: Path, path: Path) -> None:
    """Give a finished temporary file its own name in one step, replacing what was there.

    Raises
    ------
    OutputError
        If the system refuses; the temporary file is removed.
    """
    try:
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise output_error(path, error.strerror or str(error), number=error.errno) from error


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary name to write to; it becomes `path` if the block succeeds, and vanishes if it does not.

    Parameters
    ----------
    path : Path

    Yields
    ------
    Path
        An empty file in the same folder.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    try:
        with ctrl_c_waits():
            temporary = create_temporary(path)
    except KeyboardInterrupt:
        temporary_sibling(path).unlink(missing_ok=True)
        raise
    try:
        yield temporary
        put_in_place(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise output_error(path, error.strerror or str(error), number=error.errno) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
