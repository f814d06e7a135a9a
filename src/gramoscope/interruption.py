"""Ctrl-C at the wrong moment: between a file and the note that it has to go again, or within a library that loses it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
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


@contextmanager
def ctrl_c_noted() -> Iterator[Callable[[], bool]]:
    """Note in the block that Ctrl-C came, for libraries lose it: stopped at the wrong moment, they raise errors of their own.

    On other threads than the main one, which Ctrl-C never reaches, and where nobody listens to it, nothing happens.

    Yields
    ------
    callable
        Tells whether Ctrl-C came since the block began.
    """
    came: list[tuple[Any, ...]] = []
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield lambda: False
        return

    def note(*what: Any) -> None:
        came.append(what)
        handler(*what)

    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, handler)
