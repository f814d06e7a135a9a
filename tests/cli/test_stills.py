"""Photographs on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.camera.frames_image import write_png
from gramoscope.simulation.still import StillScene, cut_still, disc_picture, still_picture

SCENE = StillScene(turns=2, turn_px=1300, level_m_s=0.005, grain=0.02, noise=1.0, dust_per_m=0.0, seed=2)


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    time_s = np.arange(round(8000 * SCENE.seconds)) / 8000
    passage = cut_still(np.sin(2 * np.pi * 41.7 * time_s), rate_hz=8000.0, scene=SCENE)
    path = tmp_path_factory.mktemp("photograph") / "grooves.png"
    write_png(path, still_picture(SCENE, passage, 100, 1000))
    return path


def test_a_picture_alone_is_played_and_what_is_not_known_is_said(
    gramoscope: Callable[..., Any], picture: Path, tmp_path: Path
) -> None:
    said = gramoscope("play", picture, "--out", tmp_path / "out", "--rate", 24000)
    assert said.code == 0
    assert "3 in 1 picture" in said.out
    assert "the scale is not known" in said.out
    assert "from side to side" in said.out
    for name in ("grooves.csv", "grooves.txt", "edges.npz", "groove.png", "flat.wav", "report.html"):
        assert (tmp_path / "out" / name).is_file()


def test_what_is_known_is_no_assumption(gramoscope: Callable[..., Any], picture: Path, tmp_path: Path) -> None:
    known = (
        "--pixel-pitch-um",
        4,
        "--rpm",
        "33-third",
        "--radius-mm",
        92.5,
        "--groove-along",
        "columns",
        "--groove",
        2,
        "--wall-angle-deg",
        51.5,
    )
    said = gramoscope("play", picture, "--out", tmp_path / "out", "--rate", 24000, *known, "--json")
    report = json.loads(said.out)
    assert report["scale"]["known"]
    assert not report["scale"]["groove_along_found"]
    assert report["speed"]["rpm"] == report["speed"]["capture_rpm"] == pytest.approx(100 / 3)
    assert report["bench"]["rotation"]["radius_m"] == pytest.approx(0.0925)
    assert report["bench"]["disc"]["wall_angle_rad"] == pytest.approx(np.deg2rad(51.5))
    angle = report["calibration"]["wall_angle_deg"]
    assert angle["manifest"] == angle["taken"] == pytest.approx(51.5)
    assert angle["by_test_tones"] is None
    assert angle["reason"]
    assert report["seconds"] == pytest.approx(899 * 4e-6 / (2 * np.pi * 100 / 180 * 0.0925), abs=1e-4)
    assert [row["groove"] for row in report["grooves"]["played"]] == [2]


def test_info_looks_at_a_picture(gramoscope: Callable[..., Any], picture: Path) -> None:
    said = gramoscope("info", picture)
    assert said.code == 0
    assert "not known; assumed: one pixel is 4 µm" in said.out
    assert "along the columns, found in the picture" in said.out
    assert json.loads(gramoscope("info", picture, "--json").out)["sound"] is True


def test_info_finds_what_is_missing(gramoscope: Callable[..., Any], picture: Path, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(picture.read_bytes())
    (tmp_path / "capture.toml").write_text(
        'format = "gramoscope-capture/1"\n[disc]\ncut = "lateral"\n'
        '[sequence]\nkind = "still"\npictures = ["a.png", "b.png"]\nstep_px = 700\n'
    )
    said = gramoscope("info", tmp_path)
    assert said.code == 1
    assert "1 of 2" in said.out
    assert "picture 1: b.png is missing" in said.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--pixel-pitch-um", 0), "a positive length"),
        (("--wall-angle-deg", 90), "above 0, below 90"),
        (("--groove", 9), "1 … 3"),
        (("--turn-px", 5000), "leave turn_px out"),
        (("--recipe", "best"), "for photographs"),
        (("--device", "cuda"), ""),
    ],
)
def test_bad_options_are_said_and_leave_nothing(
    gramoscope: Callable[..., Any], picture: Path, tmp_path: Path, options: tuple[Any, ...], words: str
) -> None:
    said = gramoscope("play", picture, "--out", tmp_path / "out", *options)
    assert said.code == 2
    assert words in " ".join(said.err.replace("│", " ").split())
    assert list(tmp_path.iterdir()) == []


def test_a_folder_says_what_its_pictures_are_in_its_manifest(
    gramoscope: Callable[..., Any], picture: Path, tmp_path: Path
) -> None:
    (tmp_path / "grooves.png").write_bytes(picture.read_bytes())
    (tmp_path / "capture.toml").write_text(
        'format = "gramoscope-capture/1"\n[disc]\ncut = "lateral"\n'
        '[sequence]\nkind = "still"\npictures = ["grooves.png"]\n'
    )
    said = gramoscope("play", tmp_path, "--out", tmp_path / "out", "--pixel-pitch-um", 2)
    assert said.code == 2
    assert "mend capture.toml" in said.err


def test_a_disc_is_straightened(gramoscope: Callable[..., Any], tmp_path: Path) -> None:
    scene = StillScene(
        turns=6, turn_px=round(2 * np.pi * 300), pixel_pitch_m=20e-6, level_m_s=0.003, noise=1.0, dust_per_m=0
    )
    time_s = np.arange(round(8000 * scene.seconds)) / 8000
    passage = cut_still(np.sin(2 * np.pi * 51.0 * time_s), rate_hz=8000.0, scene=scene)
    disc = disc_picture(scene, passage, centre_px=(321.3, 318.9), size_px=(640, 650))
    write_png(tmp_path / "disc.png", disc)
    said = gramoscope(
        "unroll", tmp_path / "disc.png", "--out", tmp_path / "capture", "--dpi", 1270, "--rpm", 78, "--json"
    )
    assert said.code == 0
    found = json.loads(said.out)
    assert found["centre_px"] == pytest.approx([318.9, 321.3], abs=0.15)
    assert found["pitch_px"] == pytest.approx(13, abs=0.5)
    seen = json.loads(gramoscope("info", tmp_path / "capture", "--json").out)
    assert seen["sound"] is True
    assert seen["bench"]["assumed"] == []
    assert seen["bench"]["sensor"]["pixel_pitch_m"] == pytest.approx(20e-6)
    again = gramoscope("unroll", tmp_path / "disc.png", "--out", tmp_path / "capture")
    assert again.code == 2
    assert "exists" in again.err
