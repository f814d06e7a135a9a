"""Silence for the libraries that read pictures: a broken frame is reported once, by us, in the capture's own words."""

from __future__ import annotations

import contextlib
import logging
import threading
import warnings
from collections.abc import Iterator

_here = threading.local()
_WARNINGS = threading.Lock()


def _is_for_others(record: logging.LogRecord) -> bool:
    return not getattr(_here, "reading", False)


# tifffile logs what it also raises. Only what this thread reads here is held back: the user's own use of tifffile stays
# as loud as it was.
logging.getLogger("tifffile").addFilter(_is_for_others)


@contextlib.contextmanager
def quiet_log() -> Iterator[None]:
    """Hold back what tifffile logs in this thread."""
    _here.reading = True
    try:
        yield
    finally:
        _here.reading = False


@contextlib.contextmanager
def quiet_warnings() -> Iterator[None]:
    """Hold back Python warnings, one thread at a time, since their filters belong to the whole process."""
    with _WARNINGS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
