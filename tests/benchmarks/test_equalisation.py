"""The measurement of equalisers: what it says of filters whose error is known, and the page it wrote."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import equalisation
from benchmarks.accuracy.equalisation import BOUNDS_DB, RATES_HZ, ffmpeg, ours, sox, worst_error_db
from benchmarks.accuracy.table import cells_of
from gramoscope.disc.characteristics import CHARACTERISTICS, RIAA

PLAYED, RESPONSE = ours(RIAA, cutting=False)


def test_a_level_that_is_off_is_found_to_its_size() -> None:
    error_db = worst_error_db(lambda samples, rate: 1.02 * PLAYED(samples, rate), RESPONSE, 48_000)
    assert error_db == pytest.approx(20 * np.log10(1.02), abs=0.003)


def test_a_treble_that_is_off_is_found_and_a_delay_is_none() -> None:
    """Two equal taps lose 20 lg cos(πf/rate) at f; 5.75 dB at 20 kHz and 62.5 kHz, where the rest is right."""

    def blunt(samples: np.ndarray, rate_hz: int) -> np.ndarray:
        return np.convolve(PLAYED(samples, rate_hz), [0, 0, 0.5, 0.5])[: samples.size]

    expected_db = -20 * np.log10(np.cos(np.pi * 20_000 / 62_500))
    assert worst_error_db(blunt, RESPONSE, 62_500) == pytest.approx(expected_db, abs=0.003)


def test_cutting_is_measured_against_cutting() -> None:
    cut, response = ours(RIAA, cutting=True)
    assert worst_error_db(cut, response, 96_000) < 0.001
    assert worst_error_db(cut, RESPONSE, 96_000) > 30


@pytest.mark.parametrize(
    ("program", "through", "known_db"), [("sox", sox, 0.45), ("ffmpeg", ffmpeg("riaa"), 17.2)], ids=["sox", "ffmpeg"]
)
def test_other_programs_err_as_is_known(program: str, through: equalisation.Filter, known_db: float) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    assert worst_error_db(through, RESPONSE, 44_100) == pytest.approx(known_db, rel=0.02)


def test_a_program_that_is_not_there_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(equalisation, "RATES_HZ", (44_100,))
    rows = list(equalisation.peer_rows())
    assert {cell for row in rows for cell in row[2:] if row[1] != "ours"} == {"not installed"}
    assert equalisation.version_of("sox") == "sox not installed"


def test_the_page_holds_every_curve_twice_within_what_is_promised() -> None:
    lines = map(cells_of, Path(equalisation.PAGE).read_text("utf-8").splitlines())
    rows = [cells for cells in lines if len(cells) == 1 + len(RATES_HZ) and cells[1][:1].isdecimal()]
    for curve in CHARACTERISTICS:
        measured = [row[1:] for row in rows if row[0] == curve.title]
        assert len(measured) == 2, curve.title
        assert all(float(cell) <= bound for row in measured for cell, bound in zip(row, BOUNDS_DB, strict=True))
