"""The speed that somebody chose decides over time, velocity and length, and is said wherever the sound is described."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.player.speed import Speed, load_speed_curve
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import SpeedCurve

NOMINAL = Rotation(78.0, 0.115, 250e-6)


def _curve(folder: Path, text: str) -> Path:
    path = folder / "curve.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_the_capture_says_stays_unless_somebody_chose() -> None:
    assert Speed.chosen(None, None).rotation_of(NOMINAL) is NOMINAL
    assert Speed.chosen(None, None).done(NOMINAL) == ""
    chosen = Speed.chosen("78-us", None)
    assert chosen.rotation_of(NOMINAL) == replace(NOMINAL, rpm=7200 / 92)
    assert chosen.done(NOMINAL) == "speed 78.2609 rpm in place of 78 as captured"
    assert "92 bars" in chosen.as_dict(NOMINAL)["origin"]


def test_a_curve_is_read_and_stands_alone(tmp_path: Path) -> None:
    path = _curve(tmp_path, "time_s, rpm\n0,78.26\n\n12.5,77\n")
    assert load_speed_curve(path) == SpeedCurve((0.0, 12.5), (78.26, 77.0))
    speed = Speed.chosen(None, path)
    assert speed.rotation_of(NOMINAL).in_words() == "77 to 78.26 rpm by a curve of 2 points"
    assert speed.as_dict(NOMINAL)["curve"] == {"time_s": (0.0, 12.5), "rpm": (78.26, 77.0)}
    with pytest.raises(ArgumentError, match="one of them"):
        Speed.chosen("80", path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "header"),
        ("rpm,time_s\n1,2\n", "header"),
        ("time_s,rpm\n0,78\n1,fast\n", "line 3"),
        ("time_s,rpm\n0\n", "line 2"),
        ("time_s,rpm\n", "without points"),
        ("time_s,rpm\n3,78\n2,78\n", "times that rise"),
    ],
)
def test_a_curve_that_cannot_be_is_refused_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        load_speed_curve(_curve(tmp_path, text))


def test_a_curve_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="cannot be read"):
        load_speed_curve(tmp_path / "nothing.csv")


def test_a_faster_record_is_shorter_louder_and_says_so(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    """At 97.5 rpm in place of 78 everything is 1.25 times as fast: a sample of the one is 1.25 of the other's."""
    faster = played(capture, tmp_path / "out", workers=1, speed=Speed.chosen("97.5", None), rate_hz=120_000.0)
    a, b = transfer["flat.wav"], faster["flat.wav"]
    assert abs(a.size - b.size) <= 1
    n = min(a.size, b.size)
    assert np.corrcoef(a[20 : n - 20], b[20 : n - 20])[0, 1] > 0.995
    assert np.std(b[20 : n - 20]) == pytest.approx(1.25 * np.std(a[20 : n - 20]), rel=0.03)
    assert faster.report["speed"] == {
        "rpm": 97.5,
        "chosen": "97.5",
        "origin": None,
        "capture_rpm": 78.0,
        "curve": None,
    }
    history = faster.report["files"]["flat.wav"]["coding_history"]
    assert "gramophone record; 97.5 rpm; lateral cut" in history[0]
    assert "speed 97.5 rpm in place of 78 as captured;" in history[1]
    assert transfer.report["speed"]["chosen"] is None
