"""Ctrl-C ends a command at any moment without a trace; a killed one leaves nothing that looks whole and is not."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import soundfile

from gramoscope.player.reading_store import STORE

PATIENCE_S = 60.0
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system starts commands otherwise")


class Commands:
    """Runs commands in forks of a process that has imported everything: each costs what it does, and no start."""

    def __init__(self, parent: subprocess.Popen[str], folder: Path) -> None:
        self._parent, self._said = parent, folder / "said.txt"

    def signalled(
        self, folder: Path, sign: str, number: int, *arguments: Any, more: int = 1, wait_s: float = 0.0
    ) -> tuple[int, str]:
        """Start a command, send a signal once `more` paths like `sign` are there, return how it ended and what it said."""
        assert self._parent.stdin
        assert self._parent.stdout
        self._said.unlink(missing_ok=True)
        task = {"arguments": [str(argument) for argument in arguments], "said": str(self._said)}
        print(json.dumps(task), file=self._parent.stdin, flush=True)
        process = int(self._parent.stdout.readline())
        deadline = time.monotonic() + PATIENCE_S
        while len(list(folder.glob(sign))) < more and _lives(process) and time.monotonic() < deadline:
            time.sleep(0.002)
        time.sleep(wait_s)
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, number)
        return int(self._parent.stdout.readline()), self._said.read_text(encoding="utf-8")


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    script = [sys.executable, str(Path(__file__).with_name("forked_commands.py"))]
    with subprocess.Popen(script, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:
        yield Commands(parent, tmp_path_factory.mktemp("commands"))
        assert parent.stdin
        parent.stdin.close()


def _names(folder: Path) -> set[str]:
    """What is in a folder, beside what was read and is kept for the next time."""
    return {path.name for path in folder.iterdir() if path.name != STORE}


def _nothing_but_what_was_read(folder: Path) -> bool:
    out = folder / "out"
    return _names(folder) <= {"out"} and (not out.exists() or (_names(out) == set() and (out / STORE).is_dir()))


@pytest.fixture
def long_film(tone: Path) -> tuple[Any, ...]:
    """Arguments for some seconds of work."""
    return (tone, "--start", 0.03, "--seconds", 0.06, "--frames-per-group", 6)


MOMENTS = [("out/.flat.wav.*.part", 0.0), ("out/.flat.wav.*.part", 0.4), ("out/.report.json.*.part", 0.0)]


@pytest.mark.parametrize(("sign", "wait_s"), MOMENTS, ids=["at once", "while reading", "while drawing"])
def test_playing_stopped_by_ctrl_c_leaves_nothing_but_what_was_read(
    commands: Commands, longer_capture: Path, quickly: tuple[str, ...], tmp_path: Path, sign: str, wait_s: float
) -> None:
    play = ("play", longer_capture, "--out", tmp_path / "out", *quickly)
    code, said = commands.signalled(tmp_path, sign, signal.SIGINT, *play, wait_s=wait_s)
    assert code == 130, said
    assert "Traceback" not in said
    assert "Stopped." in said
    assert _nothing_but_what_was_read(tmp_path)


def test_playing_stopped_by_ctrl_c_leaves_an_earlier_transfer_as_it_was(
    commands: Commands,
    gramoscope: Callable[..., Any],
    capture: Path,
    longer_capture: Path,
    quickly: tuple[str, ...],
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    assert gramoscope("play", capture, "--out", out, "--quiet", *quickly).code == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    play = ("play", longer_capture, "--out", out, *quickly)
    code, said = commands.signalled(out, ".report.json.*.part", signal.SIGINT, *play)
    assert code == 130, said
    assert {name: (out / name).read_bytes() for name in _names(out)} == before


@pytest.mark.parametrize(("layout", "more"), [("tiff", 1), ("tiff", 7), ("zarr", 1)])
def test_filming_stopped_by_ctrl_c_leaves_nothing(
    commands: Commands, long_film: tuple[Any, ...], tmp_path: Path, layout: str, more: int
) -> None:
    film = ("film", long_film[0], tmp_path / "c", *long_film[1:], "--layout", layout)
    sign = ".c.*.partial/frames/*" if layout == "tiff" else ".c.*.partial"
    code, said = commands.signalled(tmp_path, sign, signal.SIGINT, *film, more=more)
    assert code == 130, said
    assert "Traceback" not in said
    assert _names(tmp_path) == set()


def _require_valid(file: Path) -> None:
    """Read a file to its end, by its kind."""
    if file.suffix == ".sha256":
        digest, name = file.read_text(encoding="utf-8").split()
        assert hashlib.sha256(file.with_name(name).read_bytes()).hexdigest() == digest
    elif file.suffix == ".json":
        json.loads(file.read_text(encoding="utf-8"))
    elif file.suffix in (".wav", ".flac"):
        samples, _ = soundfile.read(file)
        assert samples.size == soundfile.info(file).frames * soundfile.info(file).channels
    elif file.suffix == ".html":
        assert file.read_bytes().endswith(b"</html>\n"), "a whole page"
    else:
        assert file.read_bytes()[-12:-4] == b"\0\0\0\0IEND", "a whole picture"


KILLED_AT = [
    ("out/.flat.wav.*.part", 0.4),
    ("out/.equalised.wav.sha256.*.part", 0.0),
    ("out/flat.wav", 0.0),
    ("out/walls.wav.sha256", 0.0),
]


@pytest.mark.parametrize(("sign", "wait_s"), KILLED_AT, ids=[f"{sign}+{wait_s}" for sign, wait_s in KILLED_AT])
def test_playing_killed_leaves_nothing_or_valid_files(
    commands: Commands, longer_capture: Path, quickly: tuple[str, ...], tmp_path: Path, sign: str, wait_s: float
) -> None:
    """What has a name of its own is whole; a sound under its hidden name is valid as far as it goes."""
    out = tmp_path / "out"
    play = ("play", longer_capture, "--out", out, "--quiet", *quickly)
    code, said = commands.signalled(tmp_path, sign, signal.SIGKILL, *play, wait_s=wait_s)
    # the last moments may have passed before the signal came
    assert code in (-signal.SIGKILL, 0), said
    for file in out.iterdir():
        if not file.name.startswith("."):
            _require_valid(file)
        elif ".wav." in file.name and ".sha256." not in file.name and file.stat().st_size > 0:
            assert soundfile.info(file).samplerate == 96_000
    if (out / "report.json").exists():
        report = json.loads((out / "report.json").read_text(encoding="utf-8"))
        assert {*report["files"], "report.json", "groove.png"} <= _names(out)


def test_a_killed_transfer_can_be_repeated(
    commands: Commands, gramoscope: Callable[..., Any], longer_capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    code, _ = commands.signalled(
        tmp_path, "out/.flat.wav.*.part", signal.SIGKILL, "play", longer_capture, "--out", out, *quickly
    )
    assert code == -signal.SIGKILL
    assert all(name.startswith(".") for name in _names(out))
    assert gramoscope("play", longer_capture, "--out", out, "--quiet", *quickly).code == 0
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    for name in report["files"]:
        assert soundfile.info(out / name).duration == pytest.approx(report["seconds"])


def test_filming_killed_leaves_no_capture_and_can_be_repeated(
    commands: Commands,
    gramoscope: Callable[..., Any],
    long_film: tuple[Any, ...],
    bench: Path,
    tone: Path,
    tmp_path: Path,
) -> None:
    film = ("film", long_film[0], tmp_path / "c", *long_film[1:])
    code, _ = commands.signalled(tmp_path, ".c.*.partial/frames/*", signal.SIGKILL, *film, more=3)
    assert code == -signal.SIGKILL
    assert all(name.startswith(".") for name in _names(tmp_path))
    again = ("film", tone, tmp_path / "c", "--bench", bench, "--start", 0.03, "--seconds", 0.0012, "--quiet")
    assert gramoscope(*again).code == 0
    assert gramoscope("info", tmp_path / "c", "--quiet").code == 0
