"""Who reads the pieces: threads here, processes here, or the workers of a cluster (`cluster`); all behind one protocol.

The result does not depend on it: a task says which piece, the answer lies in the store.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from typing import Any, Protocol

from gramoscope.errors import require
from gramoscope.player.pieces import Reader, Task, read_elsewhere

_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
"""How processes start. None is forked from this one, which has threads."""
AHEAD = 2
"""So many pieces for each worker are under way or done before they are used."""


class Answer(Protocol):
    """A piece under way."""

    def result(self) -> Any:
        """Wait until it is read, or raise what went wrong."""
        ...


class LostWorkerError(Exception):
    """The worker that had a piece is no more."""


class Crew(Protocol):
    """Workers that are ready.

    Attributes
    ----------
    window : int
        So many pieces may be under way.
    dashboard : str
        Where people can watch them; empty for nowhere.
    """

    @property
    def window(self) -> int:
        """So many pieces may be under way."""
        ...

    @property
    def dashboard(self) -> str:
        """Where people can watch; empty for nowhere."""
        ...

    def submit(self, task: Task) -> Answer:
        """Begin a task as soon as there is a worker free."""
        ...


class Executor(Protocol):
    """A way to have pieces read."""

    def get_ready(self) -> None:
        """Begin, without waiting for it, what takes a while before there are workers."""
        ...

    def crew(self, reader: Reader) -> AbstractContextManager[Crew]:
        """Give workers while the block runs; when it ends, nothing is being read any more."""
        ...


@dataclass(frozen=True)
class PoolCrew:
    """Threads that work, or that wait for processes that work."""

    pool: ThreadPoolExecutor
    work: Callable[[Task], None]
    window: int
    dashboard: str = ""

    def submit(self, task: Task) -> Answer:
        """Begin a task as soon as there is a worker free."""
        return self.pool.submit(self.work, task)


@dataclass(frozen=True)
class Threads:
    """Threads of this process: kernels let go of the interpreter, and frames need not be copied.

    Parameters
    ----------
    workers : int
    """

    workers: int

    def __post_init__(self) -> None:
        require(self.workers >= 1, f"{self.workers} workers", "at least one")

    def get_ready(self) -> None:
        """Threads are there at once."""

    @contextmanager
    def crew(self, reader: Reader) -> Iterator[Crew]:
        """Give threads."""
        pool = ThreadPoolExecutor(self.workers, thread_name_prefix="pickup")
        try:
            yield PoolCrew(pool, reader, AHEAD * self.workers)
        finally:
            reader.stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)


@dataclass(frozen=True)
class Processes:
    """Processes of this machine, one piece at a time each; one that dies is replaced, and its piece read again.

    Parameters
    ----------
    workers : int
    """

    workers: int

    def __post_init__(self) -> None:
        require(self.workers >= 1, f"{self.workers} workers", "at least one")

    def get_ready(self) -> None:
        """Where the system can fork, start the process that all others come from, which loads all that they need."""
        if _METHOD == "forkserver":
            multiprocessing.get_context(_METHOD).set_forkserver_preload(["gramoscope.player.pieces"])
            forkserver.ensure_running()

    @contextmanager
    def crew(self, reader: Reader) -> Iterator[Crew]:
        """Give processes."""
        hands = [_Hand() for _ in range(self.workers)]
        free = list(hands)

        def work(task: Task) -> None:
            hand = free.pop()
            try:
                hand(task)
            finally:
                free.append(hand)

        pool = ThreadPoolExecutor(self.workers, thread_name_prefix="hands")
        try:
            yield PoolCrew(pool, work, AHEAD * self.workers)
        finally:
            for hand in hands:
                hand.close()
            pool.shutdown(wait=True, cancel_futures=True)


MANY_GROUPS = 1024
"""So many are read sooner by processes, which take a few seconds to start, than by threads, which wait for each other's turn
with the interpreter."""


def usual_executor(workers: int, groups: int) -> Executor:
    """Return who reads so many groups of film soonest on this machine."""
    return Processes(workers) if workers > 1 and groups >= MANY_GROUPS else Threads(workers)


class _Hand:
    """One process, started when it is needed."""

    def __init__(self) -> None:
        self._process: Any = None
        self._pipe: Connection | None = None
        self._closed = False
        self._lock = threading.Lock()

    def __call__(self, task: Task) -> None:
        try:
            pipe = self._ready()
            pipe.send(task)
            wrong = pipe.recv()
        except (EOFError, OSError) as error:
            self._end()
            raise LostWorkerError(f"the process that read piece {task.piece} was lost") from error
        if wrong is not None:
            raise wrong

    def _ready(self) -> Connection:
        with self._lock:
            if self._closed:
                raise EOFError
            if self._pipe is None:
                context: Any = multiprocessing.get_context(_METHOD)
                self._pipe, theirs = context.Pipe()
                self._process = context.Process(target=_hand_works, args=(theirs,), daemon=True, name="pickup")
                self._process.start()
                theirs.close()
            return self._pipe

    def _end(self) -> None:
        with self._lock:
            if self._pipe is not None:
                self._pipe.close()
                self._process.kill()
                self._process.join()
            self._pipe = None

    def close(self) -> None:
        """Whatever it does, it does it no more."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()  # chunks are written whole or not at all
            process.join()


def _hand_works(pipe: Connection) -> None:
    """Read pieces until nobody asks any more."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asks
    with contextlib.suppress(EOFError, OSError):
        while True:
            task = pipe.recv()
            try:
                read_elsewhere(task)
                wrong = None
            except Exception as error:
                wrong = error
            pipe.send(wrong)
