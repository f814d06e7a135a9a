"""Work in several threads, answers in order."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from gramoscope.errors import ArgumentError
from gramoscope.player.workers import in_order, spreading


def _pickup_threads() -> int:
    return sum(thread.name.startswith("pickup") for thread in threading.enumerate())


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_answers_come_in_the_order_of_the_tasks_though_they_are_ready_in_another(workers: int) -> None:
    waits_s = np.random.default_rng(4).uniform(0, 0.004, 23)

    def work(number: int) -> int:
        time.sleep(waits_s[number])
        return number * number

    assert list(in_order(work, range(23), workers=workers)) == [number**2 for number in range(23)]


def test_no_tasks_no_answers() -> None:
    assert list(in_order(lambda number: number, [], workers=2)) == []


@pytest.mark.parametrize(("workers", "ahead"), [(1, 0), (3, 0), (2, 7)])
def test_no_more_tasks_are_taken_than_may_wait(workers: int, ahead: int) -> None:
    taken = 0

    def tasks() -> Iterator[int]:
        nonlocal taken
        for number in range(40):
            taken += 1
            yield number

    for received, _ in enumerate(in_order(lambda number: number, tasks(), workers=workers, ahead=ahead), start=1):
        assert taken - received <= max(workers, ahead), "a stretch more would be in memory"


def test_work_goes_on_while_an_answer_is_looked_at() -> None:
    done = []
    answers = in_order(done.append, range(30), workers=2, ahead=10)
    next(answers)
    for _ in range(200):
        if len(done) >= 10:
            break
        time.sleep(0.005)
    assert 10 <= len(done) <= 11
    assert sum(1 for _ in answers) == 29


def test_several_tasks_are_at_work_at_a_time_but_no_more_than_workers() -> None:
    lock, working, most = threading.Lock(), 0, 0

    def work(number: int) -> int:
        nonlocal working, most
        with lock:
            working += 1
            most = max(most, working)
        time.sleep(0.003)
        with lock:
            working -= 1
        return number

    list(in_order(work, range(20), workers=3))
    assert most in (2, 3)


def test_the_first_exception_is_raised_and_nothing_more_begins() -> None:
    begun = []

    def work(number: int) -> int:
        begun.append(number)
        if number in (4, 5):
            raise ValueError(f"task {number}")
        return number

    answers = in_order(work, range(1000), workers=2, ahead=0)
    assert [next(answers) for _ in range(4)] == [0, 1, 2, 3]
    with pytest.raises(ValueError, match="task 4"):
        next(answers)
    so_far = list(begun)
    time.sleep(0.02)
    assert begun == so_far
    assert max(begun) <= 4 + 2
    assert _pickup_threads() == 0


@pytest.mark.parametrize("kind", [KeyboardInterrupt, OSError])
def test_a_consumer_that_stops_shuts_the_pool_down(kind: type[BaseException]) -> None:
    begun = []

    def work(number: int) -> int:
        begun.append(number)
        time.sleep(0.002)
        return number

    def consume() -> None:
        for number in in_order(work, range(1000), workers=2, ahead=0):
            if number == 3:
                raise kind

    # the traceback holds the generator; it is let go of when the exception is dealt with
    with contextlib.suppress(kind):
        consume()
    assert _pickup_threads() == 0
    assert max(begun) <= 3 + 3


def test_no_worker_is_refused() -> None:
    with pytest.raises(ArgumentError, match="0 workers"):
        list(in_order(lambda number: number, [1], workers=0))


def test_linear_algebra_keeps_to_one_thread_while_ours_are_at_work() -> None:
    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    if not threads():
        pytest.skip("threads of this linear algebra cannot be counted")
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        with spreading(2) as spread:
            assert all(set(seen) == {1} for seen in spread(lambda _: threads(), range(4)))
        assert threads() == before
