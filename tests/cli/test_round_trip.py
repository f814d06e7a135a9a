"""A sound filmed, played and compared: the same film whoever renders it, and the same sound again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

AUDIO = Path(__file__).parents[2].parent / "shared" / "data" / "audio"


def _sums(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "truth.npz")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture
def filmed(gramoscope: Callable[..., Any], tone: Path, bench: Path, tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Film a millisecond; return what became of it."""

    def film(name: str, *options: Any) -> dict[str, str]:
        common = ("--bench", bench, "--start", 0.0313, "--seconds", 0.0015, "--quiet", "--imperfections", "modest")
        assert gramoscope("film", tone, tmp_path / name, *common, *options).code == 0
        return _sums(tmp_path / name)

    return film


def test_the_same_seed_gives_the_same_film_whoever_renders_it(filmed: Callable[..., dict[str, str]]) -> None:
    first = filmed("a", "--seed", 3, "--workers", 1)
    assert len(first) == 2 + 3
    assert filmed("b", "--seed", 3, "--workers", 3) == first


def test_another_seed_gives_another_film(filmed: Callable[..., dict[str, str]]) -> None:
    one, other = filmed("a", "--seed", 3), filmed("b", "--seed", 4)
    assert one.keys() == other.keys()
    assert all(one[name] != other[name] for name in one if name.endswith(".tif"))


def test_what_is_asked_for_is_what_is_filmed(
    gramoscope: Callable[..., Any], tone: Path, bench: Path, tmp_path: Path
) -> None:
    camera = ("--bits", 12, "--colour", "rgb", "--columns", "backward", "--rows", "outward", "--frames-per-group", 3)
    disc = ("--cut", "vertical", "--characteristic", "nab", "--seconds", 0.0012, "--start", 0.03, "--layout", "zarr")
    assert gramoscope("film", tone, tmp_path / "c", "--bench", bench, *camera, *disc, "--quiet").code == 0
    found = json.loads(gramoscope("info", tmp_path / "c", "--json").out)
    bench_found = found["bench"]
    assert {key: bench_found["sensor"][key] for key in ("bits", "colour", "columns", "rows")} == {
        "bits": 12,
        "colour": "rgb",
        "columns": "backward",
        "rows": "outward",
    }
    assert (bench_found["disc"]["cut"], bench_found["disc"]["characteristic"]) == ("vertical", "nab")
    assert (bench_found["sequence"]["frames_per_group"], found["layout"]) == (3, "zarr")


@pytest.mark.parametrize(
    ("name", "start_s", "seconds"), [("speech-female.wav", 1.32, 0.02), ("orchestra.wav", 0.06, 0.02)]
)
def test_speech_and_music_come_back(
    gramoscope: Callable[..., Any], quickly: tuple[str, ...], tmp_path: Path, name: str, start_s: float, seconds: float
) -> None:
    sound = AUDIO / name
    if not sound.is_file():
        pytest.skip(f"{name} is not here")
    capture, out = tmp_path / "capture", tmp_path / "out"
    span = ("--start", start_s, "--seconds", seconds)
    assert gramoscope("film", sound, capture, *span, "--frames-per-group", 4, "--quiet").code == 0
    assert gramoscope("play", capture, "--out", out, "--quiet", *quickly).code == 0
    against_truth = json.loads(gramoscope("compare", capture / "truth.npz", out / "flat.wav", "--json").out)
    against_sound = json.loads(gramoscope("compare", sound, out / "flat.wav", "--start", start_s, "--json").out)
    for found in (against_truth, against_sound):
        assert found["waveform_r"] >= 0.80
        assert found["polarity"] == 1
        assert abs(found["delay_s"]) < 20e-6
    # full scale of the file is 0.5 m/s, that of the truth 1 m/s
    assert against_truth["gain_db"] == pytest.approx(0, abs=1)
