"""A capture that is still being filmed: a marker beside its manifest says how many groups are whole.

`capture.filming` holds one number: the groups below it are written, or lost for good. The filming program writes it anew (under
another name, then renamed) after every group or every few, its log before it, and removes it when the film is done.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from gramoscope.apparatus.manifest import MANIFEST_NAME
from gramoscope.errors import FilmingError

MARKER = "capture.filming"
LOOKS_EVERY_S = 0.1
PATIENCE_S = 600.0
"""A film to which nothing is added for so long has stopped."""


def say_whole(folder: Path, groups: int) -> None:
    """Say that the groups below a number are whole."""
    new = folder / f"{MARKER}.new"
    new.write_text(f"{groups}\n", encoding="utf-8")
    new.replace(folder / MARKER)


def say_done(folder: Path) -> None:
    """Say that the film is done."""
    (folder / MARKER).unlink(missing_ok=True)


def whole_groups(folder: Path) -> int | None:
    """Return how many groups are whole; None when nobody films."""
    try:
        text = (folder / MARKER).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    try:
        return int(text)
    except ValueError:
        return 0


def wait_for_groups(
    folder: Path, groups: int, *, patience_s: float = PATIENCE_S, looked: Callable[[], None] = lambda: None
) -> bool:
    """Wait until so many groups are whole, or the film is done.

    Parameters
    ----------
    folder : Path
        Of the capture; may not be there yet.
    groups : int
    patience_s : float
        So long without another group.
    looked : callable
        Called before each look; may raise to stop waiting.

    Returns
    -------
    bool
        Whether it is still being filmed.

    Raises
    ------
    FilmingError
        If nothing was added for too long.
    """
    last, since = -1, time.monotonic()
    while True:
        looked()
        whole = whole_groups(folder)
        if whole is None and (folder / MANIFEST_NAME).is_file():
            return False
        if whole is not None and whole >= groups:
            return True
        if whole is not None and whole != last:
            last, since = whole, time.monotonic()
        if time.monotonic() - since > patience_s:
            raise FilmingError(
                f"nothing was added to {folder} for {patience_s:g} s, after {max(last, 0)} groups",
                f"a film that goes on, or ends by removing {MARKER}",
                f"see what the camera does; if the film is over, delete {MARKER} and give the same command again",
            )
        time.sleep(LOOKS_EVERY_S)
