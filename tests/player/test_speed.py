"""The speed that somebody chose decides over time, velocity and length, and is said wherever the sound is described."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.player.hints import Hints
from gramoscope.player.speed import Speed, load_speed_curve
from gramoscope.signal_path import Audio
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


def test_a_speed_that_drifts_bends_time_as_its_curve_says(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    """The groove is the same: at each moment it is where the curve says, as fast as the record turns there."""
    rpm_at_the_end = 90.0
    curve = SpeedCurve((0.0, transfer.report["seconds"]), (78.0, rpm_at_the_end))
    drifting = played(capture, tmp_path / "out", workers=1, speed=Speed(name="drift.csv", curve=curve))
    steady_time_s = curve.angle_of_time_rad(np.arange(drifting["flat.wav"].size) / 96_000) / (78.0 * 2 * np.pi / 60)
    flat = transfer["flat.wav"]
    expected = np.interp(steady_time_s, np.arange(flat.size) / 96_000, flat)
    expected *= curve.rpm_at(np.arange(expected.size) / 96_000) / 78.0
    inside = slice(40, -40)
    error = drifting["flat.wav"][inside] - expected[inside]
    assert np.std(error) < 0.1 * np.std(expected[inside])
    assert np.std(drifting["flat.wav"][inside] - flat[: expected.size][inside]) > 0.5 * np.std(expected[inside])
    assert drifting.report["seconds"] == pytest.approx(
        float(curve.time_of_angle_s(transfer.report["seconds"] * 78.0 * 2 * np.pi / 60)), abs=2e-5
    )
    assert drifting.report["hints"]["mains_hum"]["reason"] is not None


def test_hints_at_a_drifting_speed_are_factors_and_no_speeds() -> None:
    time_s = np.arange(20 * 4000) / 4000
    hum = 1e-3 * np.sin(2 * np.pi * 49.0 * time_s) + 3e-5 * np.random.default_rng(3).standard_normal(time_s.size)
    nothing = np.zeros(time_s.size)
    said = []
    for rpm in (78.0, None):
        hints = Hints(rpm, 4000.0)
        hints.hear(Audio(0, 4000.0, hum, nothing, nothing.astype(np.uint16)))
        said.append(hints.as_dict()["mains_hum"])
    steady, drifting = said
    assert steady["speeds"][0]["factor"] == pytest.approx(50 / 49, rel=1e-3)
    assert steady["speeds"][0]["rpm"] == pytest.approx(78 * 50 / 49, rel=1e-3)
    assert "rpm" in steady["words"]
    assert "rpm" not in drifting["speeds"][0]
    assert "1.02" in drifting["words"]
    assert "times as fast" in drifting["words"]
    assert "rpm" not in drifting["words"]
