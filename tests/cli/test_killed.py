"""Whatever dies on the way (the command, its workers, the disk), the same command goes on, and the result is the same bits."""

from __future__ import annotations

import errno
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from zarr.storage import LocalStore

from gramoscope.apparatus.capture import open_capture
from gramoscope.errors import OutputError
from gramoscope.player.catalogue import Catalogue
from gramoscope.player.executors import Executor, Processes
from gramoscope.player.kept_reading import Work
from gramoscope.player.monitor import Monitor
from gramoscope.player.play import Settings, play
from gramoscope.player.reading_store import STORE
from gramoscope.player.recipe import load_recipe

SOUNDS = ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav")
SETTINGS = Settings(workers=2, catalogue=Catalogue(made=datetime(2031, 2, 13, tzinfo=UTC)))
KILLS = 10
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot kill as others do")


def _play(capture: Path, out: Path, **work: Any) -> dict[str, Any]:
    return play(open_capture(capture), load_recipe("seed-paper"), out, SETTINGS, work=Work(**work))


@pytest.fixture(scope="module")
def undisturbed(longer_capture: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The transfer that nobody disturbed."""
    out = tmp_path_factory.mktemp("undisturbed")
    _play(longer_capture, out)
    return out


def _require_same(out: Path, undisturbed: Path) -> None:
    for name in (*SOUNDS, "groove.png"):
        assert (out / name).read_bytes() == (undisturbed / name).read_bytes(), name
    assert {path.name for path in out.iterdir()} == {path.name for path in undisturbed.iterdir()}


def test_a_command_killed_ten_times_makes_the_same_bits(
    longer_capture: Path, undisturbed: Path, tmp_path: Path
) -> None:
    script = Path(__file__).with_name("killed_again_and_again.py")
    command = [sys.executable, str(script), str(longer_capture), str(tmp_path / "out"), str(KILLS), "7"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["status"] == 0, done.stderr
    assert len(said["ends"]) == KILLS
    assert any(0 < groups < 20 for groups in said["ends"]), "nobody was killed in the middle"
    _require_same(tmp_path / "out", undisturbed)


class _Killer:
    """Kills a worker of this process at some groups, one after the other."""

    def __init__(self, groups: tuple[int, ...], workers: Callable[[], list[int]]) -> None:
        self._groups, self._workers, self._moments = list(groups), workers, random.Random(3)
        self.killed = 0

    def __call__(self, monitor: Monitor, _: Any) -> None:
        if self._groups and monitor.groups >= self._groups[0]:
            self._groups.pop(0)
            living = self._workers()
            if living:
                os.kill(self._moments.choice(living), signal.SIGKILL)
                self.killed += 1


def _processes() -> list[int]:
    return [child.pid for child in multiprocessing.active_children() if child.pid and child.name.startswith("pickup")]


def test_processes_that_are_killed_are_replaced_and_the_bits_are_the_same(
    longer_capture: Path, undisturbed: Path, tmp_path: Path
) -> None:
    killer = _Killer((2, 9), _processes)
    report = _play(longer_capture, tmp_path, executor=Processes(2), watched=killer)
    assert killer.killed == 2
    assert report["remarks"] == json.loads((undisturbed / "report.json").read_text("utf-8"))["remarks"]
    _require_same(tmp_path, undisturbed)
    assert _processes() == []


@pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::DeprecationWarning:tornado")
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # sockets of workers that were killed
def test_workers_of_dask_that_are_killed_are_replaced_and_the_bits_are_the_same(
    longer_capture: Path, undisturbed: Path, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    from gramoscope.player.cluster import Cluster

    told: list[str] = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, memory_limit=0) as local:
        killer = _Killer((3,), lambda: [one.process.pid for one in local.workers.values() if one.process])
        executor: Executor = Cluster(local.scheduler_address, 2, told.append)
        report = _play(longer_capture, tmp_path, executor=executor, watched=killer)
    assert killer.killed == 1
    assert report["groups"]["lost"] == 0
    _require_same(tmp_path, undisturbed)


def test_a_disk_that_gets_full_is_told_and_the_same_command_goes_on_when_there_is_room(
    longer_capture: Path, undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, put = 0, LocalStore.set

    async def full(self: LocalStore, key: str, value: Any, *more: Any, **options: Any) -> None:
        nonlocal written
        written += "c/" in key
        if written > 37:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        await put(self, key, value, *more, **options)

    monkeypatch.setattr(LocalStore, "set", full)
    with pytest.raises(OutputError, match="No space left"):
        _play(longer_capture, tmp_path / "out")
    monkeypatch.undo()
    kept = list((tmp_path / "out" / STORE / "words" / "c").iterdir())
    assert 0 < len(kept) < 20
    assert [path.name for path in (tmp_path / "out").iterdir()] == [STORE]
    _play(longer_capture, tmp_path / "out")
    _require_same(tmp_path / "out", undisturbed)


def _own_mounts() -> list[str] | None:
    """A command before a command, which may then mount disks that nobody else sees; None where that is not allowed."""
    for before in (["unshare", "--mount"], ["unshare", "--map-root-user", "--mount"]):
        try:
            tried = subprocess.run([*before, "mount", "-t", "tmpfs", "tmpfs", "/mnt"], capture_output=True, check=False)
        except FileNotFoundError:
            return None
        if tried.returncode == 0:
            return before
    return None


def test_a_small_disk_gets_full_and_the_same_command_goes_on_when_it_is_larger(
    longer_capture: Path, undisturbed: Path, tmp_path: Path
) -> None:
    before = _own_mounts()
    if before is None:
        pytest.skip("this system lets nobody mount a small disk to try it on")
    script, copy = Path(__file__).with_name("on_a_small_disk.py"), tmp_path / "copy"
    command = [*before, sys.executable, str(script), str(longer_capture), str(tmp_path / "disk"), "3", str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert "No space left" in said["error"]
    assert said["left"] == [STORE]
    assert 0 < said["pieces"] < 20
    _require_same(copy, undisturbed)
