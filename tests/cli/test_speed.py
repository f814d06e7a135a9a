"""A speed on the command line: by name, by curve, or refused with what was needed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def test_a_speed_by_name_is_played_and_told(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    answer = gramoscope("play", capture, "--out", tmp_path / "o", "--rpm", "78-us", "--remove-wow", *quickly)
    assert answer.code == 0
    assert "78.261 rpm; the capture says 78" in answer.out
    assert "no wow was removed: the passage covers" in answer.out
    report = json.loads((tmp_path / "o" / "report.json").read_text(encoding="utf-8"))
    assert report["speed"]["chosen"] == "78-us"
    assert report["wow"]["removal"] == {"asked": True, "applied": False, "survey": None}
    history = report["files"]["flat.wav"]["coding_history"]
    assert "78.2609 rpm" in history[0]
    assert "removal asked for" in history[1]


def test_a_speed_curve_is_played_and_told(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    curve = tmp_path / "drift.csv"
    curve.write_text("time_s,rpm\n0,78\n0.002,81\n", encoding="utf-8")
    answer = gramoscope("play", capture, "--out", tmp_path / "o", "--speed-curve", curve, *quickly)
    assert answer.code == 0
    assert "78 to 81 rpm" in answer.out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--rpm", "78-eu"), "78-europe"),
        (("--rpm", "780"), "10 … 200"),
        (("--speed-curve", "nothing.csv"), "cannot be read"),
    ],
)
def test_an_impossible_speed_is_refused_before_anything_is_read(
    gramoscope: Callable[..., Any], capture: Path, tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    answer = gramoscope("play", capture, "--out", tmp_path / "o", *options)
    assert answer.code == 2
    assert said in answer.err
    assert not (tmp_path / "o").exists()
