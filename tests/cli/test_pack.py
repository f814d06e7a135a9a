"""`gramoscope pack` from a real transfer to a bag, and what it says of things that it cannot pack."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bagit
import pytest

from gramoscope.cli.main import main

COMMAND = [sys.executable, "-m", "gramoscope"]
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def played(here: Path, capture: Path, quickly: tuple[str, ...]) -> Path:
    """The capture, played by the command."""
    assert main(["play", str(capture), "--out", str(here / "to-pack"), "--quiet", *quickly]) == 0
    return here / "to-pack"


@pytest.fixture
def transfer(played: Path, tmp_path: Path) -> Path:
    (tmp_path / "side-b").mkdir()
    for file in played.iterdir():
        (tmp_path / "side-b" / file.name).write_bytes(file.read_bytes())
    return tmp_path / "side-b"


def test_pack_makes_a_valid_bag_beside_the_transfer_and_tells(
    gramoscope: Callable[..., Any], transfer: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(transfer)
    answer = gramoscope("pack", ".", "--organisation", "The archive", "--contact", "A. Name", "--identifier", "B/2")
    assert answer.code == 0, answer.err
    bag = transfer.with_name("side-b-bag")
    assert bagit.Bag(str(bag)).validate()
    for words in (str(bag), "11 files", "copied; every sum holds", "The archive", "B/2", "lateral cut, 78 rpm"):
        assert words in answer.out
    assert "Checking the bag" in answer.err
    info = bagit.Bag(str(bag)).info
    assert (info["Contact-Name"], info["External-Identifier"]) == ("A. Name", "B/2")


def test_pack_answers_machines_and_can_be_quiet(gramoscope: Callable[..., Any], transfer: Path, tmp_path: Path) -> None:
    found = json.loads(gramoscope("pack", transfer, "--to", tmp_path / "a", "--json").out)
    assert found["bag"] == str(tmp_path / "a")
    assert found["technical"] == json.loads((tmp_path / "a" / "metadata" / "technical.json").read_text("utf-8"))
    moved = gramoscope("pack", transfer, "--to", tmp_path / "b", "--move", "--quiet")
    assert (moved.code, moved.out, moved.err) == (0, "", "")
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}
    assert bagit.Bag(str(tmp_path / "b")).validate()


def test_a_capture_an_existing_bag_and_a_damaged_sound_are_refused(
    gramoscope: Callable[..., Any], capture: Path, transfer: Path, tmp_path: Path
) -> None:
    def refused(*arguments: Any) -> str:
        answer = gramoscope("pack", *arguments)
        assert (answer.code, answer.out) == (2, "")
        assert answer.err.count("╭") == 1
        assert "━" not in answer.err
        assert "Needed:" in answer.err
        assert "Try:" in answer.err
        return " ".join(answer.err.replace("│", " ").split())

    assert "play the capture first" in refused(capture, "--to", tmp_path / "bag")
    assert "there is something called" in refused(transfer, "--to", transfer)
    (transfer / "flat.wav").write_bytes((transfer / "flat.wav").read_bytes()[:-2] + b"!!")
    assert "flat.wav has the SHA-256" in refused(transfer, "--to", tmp_path / "bag")
    assert {path.name for path in tmp_path.iterdir()} == {"side-b"}


def test_packing_stopped_by_ctrl_c_leaves_nothing(transfer: Path, tmp_path: Path) -> None:
    with (transfer / "film.mov").open("wb") as file:
        file.truncate(1 << 30)  # a large file that takes no room, and a second or more to pack
    command = [*COMMAND, "pack", str(transfer), "--to", str(tmp_path / "bag"), "--move"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        deadline = time.monotonic() + PATIENCE_S
        while not list(tmp_path.glob(".bag.*.part/data/*")) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert {path.name for path in tmp_path.iterdir()} == {"side-b"}
    assert (transfer / "flat.wav").is_file()
