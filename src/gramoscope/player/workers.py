"""Work on many stretches at once, answers in order, a bounded number in memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

from gramoscope.errors import require
from gramoscope.pickup.cartridge import Spread

Task = TypeVar("Task")
Answer = TypeVar("Answer")


AHEAD = 48
"""So many answers may wait for one that takes long, or for whoever uses them, who may think for a while now and then."""


def in_order(
    work: Callable[[Task], Answer], tasks: Iterable[Task], *, workers: int, ahead: int = AHEAD
) -> Iterator[Answer]:
    """Yield the answers to tasks in the order of the tasks.

    Parameters
    ----------
    work : callable
        Called from several threads at once; must not depend on the order of calls.
    tasks : iterable
    workers : int
        Threads, each with one task at a time.
    ahead : int
        At most so many tasks are begun or answered and not yet asked for, or as many as there are workers if those are more.

    Yields
    ------
    Answer

    Raises
    ------
    Exception
        The first that `work` raises; what has not begun by then never begins.
    """
    require(workers >= 1, f"{workers} workers", "at least one")
    pool = ThreadPoolExecutor(workers, thread_name_prefix="pickup")
    pending: deque[Future[Answer]] = deque()
    try:
        for task in tasks:
            pending.append(pool.submit(work, task))
            if len(pending) > max(workers, ahead):
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def spreading(workers: int) -> Iterator[Spread]:
    """Give a `map` that works in several threads, answers in order, while the block runs.

    The linear algebra of each keeps to its own thread: two that want all processors wait for each other, and sums whose
    order depends on how many processors there are have other bits elsewhere.

    Parameters
    ----------
    workers : int
        Threads.
    """
    require(workers >= 1, f"{workers} workers", "at least one")
    pool = ThreadPoolExecutor(workers, thread_name_prefix="learning")
    try:
        with threadpool_limits(1, user_api="blas"):
            yield pool.map
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
