"""`gramoscope characteristics`: the list, the look-up, the picture; and free entry through film and play."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import soundfile
from matplotlib.image import imread

from gramoscope.apparatus.capture import open_capture
from gramoscope.disc.characteristics import CHARACTERISTICS


def test_all_are_listed_with_corners_and_uses(gramoscope: Callable[..., Any]) -> None:
    answer = gramoscope("characteristics")
    assert answer.code == 0
    lines = answer.out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == [curve.name for curve in CHARACTERISTICS]
    (riaa,) = (line for line in lines if line.startswith("riaa "))
    for words in ("50.05 Hz", "500.5 Hz", "2122 Hz", "−13.7 dB", "since 1955"):
        assert words in riaa


def test_one_is_explained_by_its_notation(gramoscope: Callable[..., Any]) -> None:
    (curve,) = json.loads(gramoscope("characteristics", "300s70-12.7", "--json").out)["curves"]
    assert (curve["title"], curve["shelf_hz"], curve["turnover_hz"]) == ("300S70-12.7", 70, 300)
    assert curve["rolloff_db"] == pytest.approx(12.7)


def test_label_and_year_are_looked_up_with_source_and_doubt(gramoscope: Callable[..., Any]) -> None:
    answer = gramoscope("characteristics", "--label", "Decca", "--year", 1948)
    assert answer.out.splitlines()[1].startswith("decca-ffrr")
    for words in ("Source: ", "Copeland", "2 … 3 dB", "in other years", "--characteristic decca-ffrr"):
        assert words in answer.out
    found = json.loads(gramoscope("characteristics", "--label", "Decca", "--year", 1948, "--json").out)["found"]
    assert (found[0]["name"], found[0]["support"], found[0]["within_db"]) == ("decca-ffrr", "label_and_year", [2, 3])
    assert "Galo" in found[0]["source"]


def test_an_unknown_label_is_told(gramoscope: Callable[..., Any]) -> None:
    answer = gramoscope("characteristics", "--label", "decka")
    assert "did you mean Decca?" in answer.out
    assert "--year" in answer.out
    assert "it names CBS, Capitol" in gramoscope("characteristics", "--label", "Pathe", "--year", 1910).out


def test_the_curves_are_drawn(gramoscope: Callable[..., Any], tmp_path: Path) -> None:
    answer = gramoscope("characteristics", "--label", "Decca", "--year", 1948, "--figure", tmp_path / "f.png")
    assert answer.code == 0
    assert str(tmp_path / "f.png") in answer.out
    assert imread(tmp_path / "f.png").shape[0] > 400


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("riaa", "--year", 1950), "a name beside --label or --year"),
        (("--year", 48), "four digits"),
        (("500/16",), "500N-16"),
        (("--label", "Pathe", "--figure", "f.png"), "no curve to draw"),
    ],
)
def test_impossible_questions_are_refused(
    gramoscope: Callable[..., Any], arguments: tuple[Any, ...], said: str
) -> None:
    answer = gramoscope("characteristics", *arguments)
    assert answer.code == 2
    assert said in answer.err


def test_a_free_entry_is_cut_kept_and_undone(
    gramoscope: Callable[..., Any], tone: Path, bench: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    folder, out = tmp_path / "c", tmp_path / "o"
    cut = ("--bench", bench, "--start", 0.0313, "--seconds", 0.0015, "--characteristic", "300R-12.7")
    assert gramoscope("film", tone, folder, *cut, "--quiet").code == 0
    assert open_capture(folder).bench.disc.characteristic == "300R-12.7"
    assert gramoscope("play", folder, "--out", out, "--quiet", *quickly).code == 0
    report = json.loads((out / "report.json").read_text("utf-8"))
    assert report["files"]["equalised.wav"]["characteristic"] == "300r-12.7"
    with soundfile.SoundFile(out / "equalised.wav") as file:
        assert "300R-12.7 (shelf 50.05 Hz, turnover 300 Hz, roll-off 2382 Hz" in file.comment
