"""The two practice captures, made by a renderer that shares no code with this project, against their truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gramoscope.listening.compare import compare
from gramoscope.listening.truth import truth_sound

SHARED = Path(__file__).parents[2].parent / "shared"
RATE_HZ = 96_000


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
