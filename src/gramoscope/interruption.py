"""Ctrl-C at the wrong moment: between a file that was made and the note that it has to go again."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def ctrl_c_waits() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block, where it is raised; for moments, not for work.

    On other threads than the main one, which Ctrl-C never reaches, nothing happens.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, if Ctrl-C came in it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[Any, ...]] = []
    handler = signal.signal(signal.SIGINT, lambda *what: came.append(what))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if came and callable(handler):
        handler(*came[0])


def was_ctrl_c(error: BaseException | None) -> bool:
    """Tell whether Ctrl-C is behind an error: libraries that are stopped while they load hide it behind others."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
