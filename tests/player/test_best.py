"""The best reading, from files to files: the same bits whoever reads and however the film is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.player.recipe import DEFAULT_RECIPE


@pytest.fixture(scope="module")
def best(capture: Path, played: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Eight groups, the fewest from which anything can be learned, played with one worker."""
    return played(capture, tmp_path_factory.mktemp("best"), recipe="best", workers=1)


def test_the_best_is_what_one_gets_unasked() -> None:
    assert DEFAULT_RECIPE == "best"


def test_a_short_film_sounds_as_the_groove_moves(film: Any, best: Any, transfer: Any) -> None:
    truth, heard = film.sound_m_s(96_000), best["flat.wav"] * 0.5
    inside = slice(48, -48)
    error = (heard - truth[: heard.size])[inside]
    papers = (transfer["flat.wav"] * 0.5 - truth[: heard.size])[inside]
    assert np.corrcoef(truth[: heard.size][inside], heard[inside])[0, 1] > 0.99
    assert np.std(error) < 0.5 * np.std(papers)


@pytest.mark.parametrize(
    ("layout", "sensor", "workers"),
    [("zarr", {"columns": "backward"}, 3), ("tiff", {"colour": "rgb", "rows": "outward"}, 2)],
    ids=["backward, three workers", "colours, outward, two workers"],
)
def test_the_bits_depend_neither_on_the_workers_nor_on_how_the_film_is_kept(
    film: Any, best: Any, played: Callable[..., Any], tmp_path: Path, layout: str, sensor: Any, workers: int
) -> None:
    folder = film.write(tmp_path / "capture", layout=layout, **sensor)
    other = played(folder, tmp_path / "out", recipe="best", workers=workers)
    for name in ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav"):
        assert other.bits(name) == best.bits(name), name
    for key in ("share", "noise_estimate", "flagged_samples", "calibration"):
        assert other.report[key] == best.report[key], key


def test_both_walls_together_are_the_sound_and_apart_the_vertical_motion(best: Any) -> None:
    outer, inner = best["walls.wav"].T
    assert np.abs((outer + inner) / np.sqrt(2) - best["flat.wav"]).max() < 3 * 2**-23
    assert np.abs((outer - inner) / np.sqrt(2) - best["vertical.wav"]).max() < 3 * 2**-23
    assert np.corrcoef(outer, inner)[0, 1] > 0.9, "a lateral cut"
    assert 0 < best["vertical.wav"].std() < 0.2 * best["flat.wav"].std()


def test_the_report_says_what_the_passage_taught(film: Any, best: Any) -> None:
    report = best.report
    assert report["walls_read"] == ["inner", "outer"]
    assert report["remarks"] == []
    told = report["calibration"]
    assert told["groups"] == 8
    planes = told["stripe_distances"]
    assert planes["measured"]["between_planes_um"] == pytest.approx(planes["manifest"]["between_planes_um"], abs=1.0)
    assert sum(stripe["columns"] > 6000 for stripe in told["stripes"]) == 3
    assert report["recipe"]["pickup"]["cartridge"] == "texture-likelihood"
    assert report["recipe"]["tonearm"]["smoother"]["method"] == "places"
