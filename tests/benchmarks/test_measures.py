"""The figures of the accuracy table, from mixtures whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import measures, readings
from gramoscope.signal_path import Audio

RATE_HZ = 96_000.0
TIME_S = np.arange(19_217) / RATE_HZ


def tone(frequency_hz: float, amplitude: float) -> np.ndarray:
    return amplitude * np.sin(2 * np.pi * frequency_hz * TIME_S + 0.4)


def all_of(samples: np.ndarray) -> np.ndarray:
    return np.ones(len(samples), bool)


def test_errors_that_are_as_large_as_claimed_have_the_ratio_one() -> None:
    rng = np.random.default_rng(3)
    truth = tone(430.0, 0.04)
    sigma = np.where(TIME_S < 0.07, 1e-3, 4e-3)
    heard = truth + sigma * rng.standard_normal(len(truth))
    assert measures.sigma_ratio(truth, heard, sigma, used=all_of(truth)) == pytest.approx(1, abs=0.02)
    assert measures.sigma_ratio(truth, heard, 2 * sigma, used=all_of(truth)) == pytest.approx(2, abs=0.04)


def test_a_small_error_of_gain_is_taken_out_and_a_large_one_stays() -> None:
    truth = tone(430.0, 0.04)
    noise = 1e-4 * np.random.default_rng(4).standard_normal(len(truth))
    near = measures.real_error(truth, 1.005 * truth + noise, used=all_of(truth))
    far = measures.real_error(truth, 1.05 * truth + noise, used=all_of(truth))
    assert near.std() == pytest.approx(1e-4, rel=0.03)
    assert far.std() == pytest.approx(0.05 * truth.std(), rel=0.03)


def test_flagged_samples_and_those_without_sigma_do_not_count() -> None:
    truth = tone(430.0, 0.04)
    sigma = np.full(len(truth), 1e-3)
    heard = truth + 1e-3 * np.random.default_rng(5).standard_normal(len(truth))
    heard[1000:3000] += 0.3
    sigma[2000:3000] = np.nan
    used = all_of(truth)
    used[1000:2000] = False
    assert measures.sigma_ratio(truth, heard, sigma, used=used) == pytest.approx(1, abs=0.03)
    assert np.isnan(measures.sigma_ratio(truth, heard, sigma, used=np.zeros(len(truth), bool)))


def test_the_longer_of_truth_and_sound_is_cut() -> None:
    truth = tone(430.0, 0.04)
    noise = 1e-3 * np.random.default_rng(6).standard_normal(len(truth))
    heard, sigma = (truth + noise)[:-700], np.full(len(truth) - 700, 1e-3)
    assert measures.sigma_ratio(truth, heard, sigma, used=all_of(heard)) == pytest.approx(1, abs=0.03)
    assert measures.sigma_ratio(heard, truth, np.full(len(truth), 1e-3), used=all_of(truth)) == pytest.approx(
        1, abs=0.03
    )


def test_a_mixture_has_the_signal_to_noise_that_it_was_mixed_with_in_each_octave() -> None:
    truth = tone(500.0, 1.0) + tone(4000.0, 0.5)
    heard = truth + tone(510.0, 0.1) + tone(4040.0, 0.005)
    found = readings.Ears(truth, heard).compared(readings.Judged("mixture"))
    assert found.octave_snr_db[500.0] == pytest.approx(20, abs=0.5)
    assert found.octave_snr_db[4000.0] == pytest.approx(40, abs=0.5)
    assert found.snr_db == pytest.approx(10 * np.log10(1.25 / 0.010025), abs=0.2)


def test_with_one_channel_driven_all_that_the_other_gives_is_crosstalk() -> None:
    truth = np.stack([tone(700.0, 1.0), np.zeros(len(TIME_S))], axis=1)
    heard = truth + np.stack([np.zeros(len(TIME_S)), 0.01 * truth[:, 0] + tone(2000.0, 0.01)], axis=1)
    found = measures.separation_db(truth, heard, rate_hz=RATE_HZ, band_hz=(100.0, 10_000.0), trim_s=0.01)
    assert found == pytest.approx(10 * np.log10(1 / 2e-4), abs=0.2)
    assert measures.driven_channels(truth[:, ::-1]) == [1]
    swapped = measures.separation_db(
        truth[:, ::-1], heard[:, ::-1], rate_hz=RATE_HZ, band_hz=(100.0, 10_000.0), trim_s=0.01
    )
    assert swapped == pytest.approx(found, abs=1e-9)


def test_with_both_channels_driven_the_worse_leak_is_told() -> None:
    left, right = tone(700.0, 1.0), tone(1900.0, 0.5)
    truth = np.stack([left, right], axis=1)
    heard = np.stack([0.9 * left + 0.03 * right, 1.1 * right - 0.011 * left], axis=1)
    found = measures.separation_db(truth, heard, rate_hz=RATE_HZ, band_hz=(100.0, 10_000.0), trim_s=0.01)
    assert found == pytest.approx(-20 * np.log10(0.03 / 1.1), abs=0.1)


def test_a_row_has_a_cell_for_each_column(tmp_path) -> None:
    truth = tone(500.0, 0.04)
    np.savez(
        tmp_path / "truth.npz",
        arc_um=TIME_S * 1e6,
        lateral_um_s=truth * 1e6,
        vertical_um_s=0 * truth,
        speed_um_s=1e6,
    )
    noise = 1e-3 * np.random.default_rng(8).standard_normal(len(truth))
    flags = np.zeros(len(truth), np.uint16)
    flags[:192] = 1
    sound = Audio(0, RATE_HZ, truth + noise, np.full(len(truth), 1e-3), flags, ())
    heard = readings.Heard(sound, None, "lateral", 12.3)
    cells = dict(zip(readings.COLUMNS, readings.row(readings.Judged("made up"), "none", tmp_path, heard), strict=True))
    assert cells["scene"] == "made up"
    assert cells["bound"] == cells["separation dB"] == "–"
    assert float(cells["interpolated %"]) == 1.0
    assert float(cells["σ ÷ error"]) == pytest.approx(1, abs=0.03)
    assert float(cells["SNR dB"]) == pytest.approx(10 * np.log10(0.0008 / 1e-6 * 4.8), abs=0.8)
