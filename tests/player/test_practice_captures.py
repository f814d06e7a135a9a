"""The two practice captures, made by a renderer that shares no code with this project, against their truth."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from gramoscope.listening.compare import compare
from gramoscope.listening.truth import truth_sound

SHARED = Path(__file__).parents[2].parent / "shared"
RATE_HZ = 96_000
FULL_SCALE_DB = 6.02
"""Full scale of the file is 0.5 m/s, that of the truth 1 m/s."""


def _against_truth(name: str, transfer: Any, **options: Any) -> Any:
    truth = truth_sound(SHARED / "captures" / name / "truth.npz", rate_hz=RATE_HZ)
    return compare(truth, RATE_HZ, transfer["flat.wav"], RATE_HZ, band_hz=(200.0, 10_000.0), trim_s=2e-3, **options)


def test_the_clean_capture_gives_the_sound_that_was_cut(practice_clean: Any) -> None:
    found = _against_truth("practice-clean", practice_clean)
    assert found.waveform_r >= 0.95
    assert found.polarity == 1
    assert abs(found.delay_s) < 5e-6
    assert found.waveform_r_unaligned >= 0.95


def test_the_clean_capture_has_nothing_lost(practice_clean: Any) -> None:
    report = practice_clean.report
    assert report["groups"]["lost"] == 0
    assert report["share"]["measured"] > 0.9


def test_the_damaged_capture_plays_to_its_end_and_says_what_is_missing(practice_damaged: Any) -> None:
    report = practice_damaged.report
    bench = report["bench"]
    assert sum(report["groups"].values()) == bench["sequence"]["groups"]
    assert report["share"]["interpolated"] > 0
    assert report["flagged_samples"]["interpolated"] > 0
    assert practice_damaged["flat.wav"].size == pytest.approx(report["seconds"] * RATE_HZ)


def test_what_was_measured_of_the_damaged_capture_is_the_sound_that_was_cut(practice_damaged: Any) -> None:
    found = _against_truth("practice-damaged", practice_damaged, mask=~practice_damaged.measured())
    assert found.masked_share == pytest.approx(practice_damaged.report["share"]["interpolated"], abs=0.1)
    assert found.polarity == 1
    assert found.waveform_r >= 0.85
    assert abs(found.delay_s) < 10e-6


@pytest.fixture(scope="module")
def best_of(tmp_path_factory: pytest.TempPathFactory, played: Callable[..., Any]) -> Callable[[str], Any]:
    """A practice capture read by the recipe best, once."""

    @lru_cache
    def transfer(name: str) -> Any:
        folder = SHARED / "captures" / name
        if not folder.is_dir():
            pytest.skip(f"the practice capture {name} is not here")
        return played(folder, tmp_path_factory.mktemp(name), recipe="best")

    return transfer


def test_the_best_reading_of_the_clean_capture_keeps_its_promise(best_of: Callable[[str], Any]) -> None:
    transfer = best_of("practice-clean")
    found = _against_truth("practice-clean", transfer)
    assert found.snr_db >= 24, "the floor; 36 was measured"
    assert found.polarity == 1
    assert abs(found.delay_s) < 2e-6
    assert found.gain_db == pytest.approx(FULL_SCALE_DB, abs=0.2)
    assert transfer.report["groups"]["lost"] == 0
    assert transfer.report["share"]["measured"] > 0.99


def test_the_best_reading_of_the_damaged_capture_keeps_its_promise_outside_what_it_flags(
    best_of: Callable[[str], Any],
) -> None:
    transfer = best_of("practice-damaged")
    found = _against_truth("practice-damaged", transfer, mask=~transfer.measured())
    assert found.snr_db >= 18, "the floor; 24 was measured"
    assert found.polarity == 1
    assert found.masked_share < 0.1
    assert abs(found.delay_s) < 2e-6
