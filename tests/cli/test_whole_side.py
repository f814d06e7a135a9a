"""The command as people use it on a long passage: stopped, gone on, followed, watched, planned."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import soundfile

from gramoscope.cli.terminal import Terminal
from gramoscope.cli.watch import at_work
from gramoscope.player.executors import MANY_GROUPS, Processes, Threads
from gramoscope.player.reading_store import STORE


def _samples(out: Path) -> bytes:
    return bytes(soundfile.read(out / "flat.wav", dtype="int32")[0].tobytes())


def _lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def test_progress_for_machines_is_lines_of_json(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    answer = gramoscope("play", capture, "--out", tmp_path / "out", "--json-progress", "--keep-reading", *quickly)
    assert answer.code == 0, answer.err
    told = _lines(answer.err)
    assert len(told) == len(answer.err.splitlines())
    assert told[-1]["done"] == told[-1]["total"]
    assert told[-1]["left_s"] in (0.0, None)
    assert (tmp_path / "out" / STORE).is_dir()


def test_a_kept_reading_is_not_packed(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    pytest.importorskip("bagit", reason="the extra archive is not installed")
    assert gramoscope("play", capture, "--out", tmp_path / "out", "--keep-reading", "--quiet", *quickly).code == 0
    answer = gramoscope("pack", tmp_path / "out", "--json")
    assert answer.code == 0, answer.err
    (bag,) = [path.parent for path in tmp_path.rglob("bagit.txt")]
    assert STORE not in "".join(path.read_text("utf-8") for path in bag.glob("manifest-*.txt"))


def test_a_film_is_followed_from_another_process(
    gramoscope: Callable[..., Any], bench: Path, tone: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    live = tmp_path / "live"
    film = ("film", tone, live, "--bench", bench, "--start", 0.0313, "--seconds", 0.004, "--live", "--quiet")
    command = [sys.executable, "-m", "gramoscope", *(str(part) for part in film)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as filming:
        answer = gramoscope("play", live, "--out", tmp_path / "out", "--follow", "--json-progress", *quickly)
        _, said = filming.communicate(timeout=60)
    assert (answer.code, filming.returncode) == (0, 0), answer.err + said
    assert any("the sound grows in" in one.get("note", "") for one in _lines(answer.err))
    assert any("cm/s" in one.get("group", "") for one in _lines(answer.err))
    assert gramoscope("play", live, "--out", tmp_path / "plain", "--quiet", *quickly).code == 0
    assert _samples(tmp_path / "out") == _samples(tmp_path / "plain")


def test_a_stopped_command_says_what_is_kept_and_goes_on(
    gramoscope: Callable[..., Any], longer_capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    play = [str(part) for part in ("play", longer_capture, "--out", out, "--json-progress", *quickly)]
    with subprocess.Popen([sys.executable, "-m", "gramoscope", *play], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        first = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert json.loads(first)["done"] == 1
    assert "the same command goes on from there" in said
    assert {path.name for path in out.iterdir()} == {STORE}
    answer = gramoscope(*play[:4], "--json", "--quiet", *quickly)
    assert answer.code == 0
    assert json.loads(answer.out)["groups"]["lost"] == 0


def test_a_plan_is_told(gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...]) -> None:
    answer = gramoscope("info", capture, "--plan", "--workers", 2, *quickly)
    assert "To play it takes" in answer.out
    for word in ("disk", "memory", "time", "storage"):
        assert word in answer.out
    found = json.loads(gramoscope("info", capture, "--plan", "--json", *quickly).out)
    assert found["plan"]["groups"] == found["groups_expected"]


@pytest.mark.parametrize(
    ("executor", "workers", "groups", "expected"),
    [
        ("auto", 2, MANY_GROUPS, Processes),
        ("auto", 2, MANY_GROUPS - 1, Threads),
        ("auto", 1, MANY_GROUPS, Threads),
        ("auto", 2, 0, None),
        ("threads", 2, MANY_GROUPS, None),
        ("processes", 2, 8, Processes),
    ],
)
def test_a_long_film_is_read_by_processes(
    tmp_path: Path, executor: str, workers: int, groups: int, expected: type | None
) -> None:
    terminal = Terminal(quiet=True)
    with at_work(terminal, tmp_path, executor, None, workers, groups=groups, json_progress=False) as (_, work):
        assert type(work.executor) is (expected or type(None))
