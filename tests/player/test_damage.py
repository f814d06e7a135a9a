"""What the film does not show is bridged, flagged and counted; the rest plays as if nothing had happened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tifffile import imwrite

from gramoscope.errors import CaptureError

SPOILT = 4
FULL_SCALE_M_S = 0.5
GROUP_SAMPLES = 469.53e-6 / (2 * np.pi * 78 / 60 * 0.115) * 96_000


def _pictures(film: Any, kind: str) -> np.ndarray:
    images = film.groups[SPOILT]
    if kind == "black":
        return np.zeros_like(images)
    if kind == "saturated":
        return np.full_like(images, 255)
    return np.clip(np.random.default_rng(3).normal(90, 4, images.shape), 0, 255).astype(np.uint8)


def _spoil(folder: Path, film: Any, kind: str) -> None:
    file = folder / "frames" / f"g{SPOILT:06d}.tif"
    if kind == "missing":
        file.unlink()
    elif kind == "no image":
        file.write_bytes(b"this was a picture")
    elif kind == "truncated":
        file.write_bytes(file.read_bytes()[: int(file.stat().st_size * 0.6)])
    else:
        imwrite(file, _pictures(film, kind), photometric="minisblack")


def _elsewhere(sound: np.ndarray) -> np.ndarray:
    """Which samples lie outside the spoilt group and its two neighbours."""
    group = np.arange(sound.size) / GROUP_SAMPLES
    return (group < SPOILT - 0.7) | (group > SPOILT + 1.8)


@pytest.mark.parametrize(
    ("kind", "flags", "frames_lost"),
    [
        ("missing", "frame_lost", 4),
        ("no image", "frame_lost", 4),
        ("black", "dark", 0),
        ("saturated", "saturated", 0),
        ("without stripes", "no_stripe sparse", 0),
    ],
)
def test_a_spoilt_group_is_flagged_counted_and_bridged(
    film: Any,
    copy_of: Path,
    transfer: Any,
    played: Callable[..., Any],
    tmp_path: Path,
    kind: str,
    flags: str,
    frames_lost: int,
) -> None:
    _spoil(copy_of, film, kind)
    spoilt = played(copy_of, tmp_path / "out")
    report = spoilt.report
    assert report["groups"] == {"read": 7, "lost": 1}
    assert report["lost_groups"] == [SPOILT]
    assert report["frames_lost"] == frames_lost, report["problems"]
    assert not any("tries" in problem for problem in report["problems"])
    assert 0.8 / 8 < report["share"]["interpolated"] < 1.6 / 8
    assert report["share"]["measured"] + report["share"]["interpolated"] == pytest.approx(1)
    flagged = sum(report["flagged_samples"][flag] for flag in flags.split())
    assert 0.8 * GROUP_SAMPLES < flagged < 2 * GROUP_SAMPLES
    assert report["flagged_samples"]["interpolated"] >= 0.8 * GROUP_SAMPLES
    whole, heard = transfer["flat.wav"], spoilt["flat.wav"]
    assert whole.size == heard.size
    apart = _elsewhere(whole)
    assert np.std((whole - heard)[apart]) < 0.1 * np.std(whole), "the rest sounds the same"
    assert np.abs(heard).max() < 2 * np.abs(whole).max(), "a bridge, not a bang"


@pytest.mark.parametrize("kind", ["missing", "no image"])
def test_what_could_not_be_read_is_said_in_words(
    film: Any, copy_of: Path, played: Callable[..., Any], tmp_path: Path, kind: str
) -> None:
    _spoil(copy_of, film, kind)
    problems = played(copy_of, tmp_path / "out").report["problems"]
    assert len(problems) == 1
    assert "frames 0 … 3" in problems[0]
    assert f"group {SPOILT}" in problems[0]


def test_a_truncated_file_loses_its_last_frames_and_the_first_are_used(
    film: Any, copy_of: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    _spoil(copy_of, film, "truncated")
    spoilt = played(copy_of, tmp_path / "out")
    assert 1 <= spoilt.report["frames_lost"] <= 3
    assert spoilt.report["groups"] == {"read": 8, "lost": 0}
    assert len(spoilt.report["problems"]) >= 1
    assert all(f"group {SPOILT}" in problem for problem in spoilt.report["problems"])
    apart = _elsewhere(transfer["flat.wav"])
    difference = transfer["flat.wav"] - spoilt["flat.wav"]
    assert np.std(difference[apart]) < 0.05 * np.std(transfer["flat.wav"])


@pytest.mark.parametrize("folder", ["new", "there"])
def test_when_every_group_is_lost_nothing_is_written(
    film: Any, played: Callable[..., Any], tmp_path: Path, folder: str
) -> None:
    black = film.write(tmp_path / "capture", groups=[np.zeros_like(images) for images in film.groups])
    if folder == "there":
        (tmp_path / "there").mkdir()
    with pytest.raises(CaptureError) as caught:
        played(black, tmp_path / folder)
    assert "8 groups" in caught.value.found
    assert caught.value.needed
    assert caught.value.remedy
    assert (tmp_path / "there").exists() == (folder == "there")
    assert not (tmp_path / "new").exists()
    assert folder == "new" or list((tmp_path / "there").iterdir()) == []
