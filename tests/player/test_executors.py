"""Who reads does not matter: order, window, tries, and workers that would read otherwise."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from gramoscope.apparatus.capture import open_capture
from gramoscope.errors import ArgumentError, WorkerError
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player import cluster as cluster_module
from gramoscope.player.executors import LostWorkerError, Processes, Threads
from gramoscope.player.kept_reading import Work, kept_reading_of
from gramoscope.player.pieces import Reader, Task, reader_of
from gramoscope.player.plan import plan_of
from gramoscope.player.reading_manifest import key_of
from gramoscope.player.reading_store import open_store
from gramoscope.player.recipe import load_recipe

RECIPE = load_recipe("seed-paper")


@dataclass
class _Late:
    """An answer whose work is done when somebody asks for it."""

    work: Callable[[], None]

    def result(self) -> None:
        self.work()


@dataclass
class _Lazy:
    """An executor that keeps count, and loses workers as it is told."""

    window: int = 3
    dashboard: str = ""
    lose: dict[int, int] = field(default_factory=dict)
    under_way: int = 0
    most: int = 0
    tasks: list[Task] = field(default_factory=list)

    def get_ready(self) -> None:
        """Nothing."""

    @contextmanager
    def crew(self, reader: Reader) -> Iterator[Any]:
        self._reader = reader
        yield self

    def submit(self, task: Task) -> _Late:
        self.tasks.append(task)
        self.under_way += 1
        self.most = max(self.most, self.under_way)
        return _Late(lambda: self._read(task))

    def _read(self, task: Task) -> None:
        self.under_way -= 1
        if self.lose.get(task.piece, 0):
            self.lose[task.piece] -= 1
            raise LostWorkerError(f"the worker of {task.piece} was lost")
        self._reader(task)


def _numbers(capture: Path, out: Path, work: Work) -> tuple[list[int], Any]:
    out.mkdir(exist_ok=True)
    opened = open_capture(capture)
    how: dict[str, Any] = {"device": PROCESSOR, "workers": 2, "work": work}
    with kept_reading_of(opened, RECIPE, out, learn=lambda _: RECIPE.cartridge_for(opened.bench), **how) as reading:
        return [group.trace.number for group in reading.groups()], reading


def test_pieces_come_in_order_and_no_more_than_the_window_are_under_way(capture: Path, tmp_path: Path) -> None:
    lazy = _Lazy()
    numbers, reading = _numbers(capture, tmp_path, Work(lazy))
    assert numbers == list(range(8))
    assert lazy.most == lazy.window + 1
    assert [task.piece for task in lazy.tasks] == list(range(8))
    assert reading.remarks() == []


def test_a_lost_worker_is_no_lost_piece_but_three_are(capture: Path, tmp_path: Path) -> None:
    lazy = _Lazy(lose={2: 2, 5: 3})
    numbers, reading = _numbers(capture, tmp_path, Work(lazy))
    assert numbers == list(range(8))
    assert [task.patient for task in lazy.tasks if task.piece == 5] == [False, False, True]
    (remark,) = reading.remarks()
    assert "group 5 could not be read in 3 tries: the worker of 5 was lost" in remark
    assert "group 2" not in remark


def test_tasks_are_small_and_say_no_more_than_where(capture: Path, tmp_path: Path) -> None:
    import pickle

    lazy = _Lazy()
    _numbers(capture, tmp_path, Work(lazy))
    assert max(len(pickle.dumps(task)) for task in lazy.tasks) < 1000


def test_a_worker_that_would_read_otherwise_refuses(capture: Path, tmp_path: Path) -> None:
    _numbers(capture, tmp_path, Work(keep_reading=True))
    store = open_store(tmp_path / ".reading.zarr")
    assert store is not None
    places = str(capture), str(store.root)
    assert reader_of(*places, key_of(store.manifest)).store.group_count == 8
    with pytest.raises(WorkerError, match="would read otherwise"):
        reader_of(*places, "another")
    with pytest.raises(WorkerError, match="cannot be read on this machine"):
        reader_of(str(capture), str(tmp_path / "nowhere"), "any")


def test_no_workers_are_refused() -> None:
    for kind in (Threads, Processes, lambda n: cluster_module.Cluster(None, n, print)):
        with pytest.raises(ArgumentError, match="0 workers"):
            kind(0)


def test_a_scheduler_that_is_not_there_is_told(capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr(cluster_module, "PATIENCE_S", 0.3)
    executor = cluster_module.Cluster("tcp://127.0.0.1:9", 1, print)
    with pytest.raises(WorkerError, match=r"answers at tcp://127\.0\.0\.1:9"):
        _numbers(capture, tmp_path, Work(executor))


@pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::DeprecationWarning:tornado")
def test_workers_of_dask_on_this_machine_keep_their_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.delenv(cluster_module.TRIM, raising=False)
    asked = (cluster_module.TRIM, "OMP_NUM_THREADS")
    with cluster_module._client(distributed, None, 1) as client:
        (environ,) = client.run(lambda: [os.environ.get(name) for name in asked]).values()
    # the first is Dask's own habit, the second is to stay
    assert environ == [None, "1"]


def test_a_plan_adds_up(capture: Path) -> None:
    plan = plan_of(open_capture(capture), RECIPE, 2)
    assert plan.groups == 8
    assert plan.frames_bytes == 8 * 4 * 448 * 1280
    assert plan.playing_s(4) == pytest.approx(plan.playing_s(1) / 4)
    assert plan.bytes_a_second(2) * plan.playing_s(2) == pytest.approx(plan.frames_bytes)
    bigger = replace(plan, groups=16, frames_bytes=2 * plan.frames_bytes)
    assert bigger.playing_s(2) == pytest.approx(2 * plan.playing_s(2))
    # of the strips, wider than the overlap, the rows about the stripes are kept
    assert 8 * 2 * 64 * 75 * 4 < plan.store_bytes < 8 * 2 * 448 * 300 * 4
