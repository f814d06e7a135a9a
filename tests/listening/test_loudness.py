"""Loudness as BS.1770 and the EBU's test signals say it is, whatever the rate and the pieces.

The signals are those of EBU Tech 3341 (table 1) and Tech 3342 (table 1), made here; numbers in the names are theirs.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from gramoscope.errors import ArgumentError
from gramoscope.listening.loudness import Loudness, LoudnessMeter, k_weighting

RATE_HZ = 48_000
LOW_RATE_HZ = 24_000
"""For signals of minutes."""
STAGE_1 = [1.53512485958697, -2.69169618940638, 1.19839281085285, 1.0, -1.69065929318241, 0.73248077421585]
STAGE_2 = [1.0, -2.0, 1.0, 1.0, -1.99004745483398, 0.99007225036621]
"""Tables 1 and 2 of ITU-R BS.1770-4."""


def tone(*parts: tuple[float, float], rate_hz: float = RATE_HZ, frequency_hz: float = 1000.0) -> np.ndarray:
    """A stereo tone: level of its peak (dB of full scale) and seconds of each part; −inf is silence."""
    level = np.concatenate([np.full(round(seconds * rate_hz), 10 ** (db / 20)) for db, seconds in parts])
    time_s = np.arange(level.size) / rate_hz
    return np.repeat((level * np.sin(2 * np.pi * frequency_hz * time_s))[:, np.newaxis], 2, axis=1)


def measured(samples: np.ndarray, rate_hz: float = RATE_HZ) -> Loudness:
    meter = LoudnessMeter(rate_hz, samples.shape[1])
    meter.hear(samples)
    return meter.measured()


def test_the_filters_at_48_khz_are_those_that_the_standard_prints() -> None:
    np.testing.assert_allclose(k_weighting(48_000.0), [STAGE_1, STAGE_2], atol=2e-11)


@pytest.mark.parametrize(("rate_hz", "agree_db"), [(12_000, 0.13), (22_050, 0.032), (44_100, 0.01), (192_000, 0.01)])
def test_the_filters_of_other_rates_weigh_alike(rate_hz: int, agree_db: float) -> None:
    frequency_hz = np.geomspace(15, min(0.45 * rate_hz, 20_000), 40)
    here, there = (
        20 * np.log10(np.abs(signal.sosfreqz(k_weighting(rate), worN=frequency_hz, fs=rate)[1]))
        for rate in (rate_hz, 48_000)
    )
    np.testing.assert_allclose(here, there, atol=agree_db)


INF = float("inf")
CASES = {
    "1": ((-23.0, 20),),
    "2": ((-33.0, 20),),
    "3": ((-36, 10), (-23, 60), (-36, 10)),
    "4": ((-72, 10), (-36, 10), (-23, 60), (-36, 10), (-72, 10)),
    "5": ((-26, 20), (-20, 20.1), (-26, 20)),
}


@pytest.mark.parametrize("case", CASES)
def test_integrated_loudness_of_tech_3341(case: str) -> None:
    """Without gates case 3 reads −24.2 and case 4 −25.2."""
    expected = -33.0 if case == "2" else -23.0
    assert measured(tone(*CASES[case], rate_hz=LOW_RATE_HZ), LOW_RATE_HZ).integrated_lufs == pytest.approx(
        expected, abs=0.1
    )


def test_steady_tones_of_1_and_2_read_alike_in_every_window_and_at_every_rate() -> None:
    for rate_hz in (44_100, 48_000, 96_000):
        found = measured(tone((-33.0, 4), rate_hz=rate_hz), rate_hz)
        for value in (found.integrated_lufs, found.max_momentary_lufs, found.max_short_term_lufs):
            assert value == pytest.approx(-33.0, abs=0.1)


def test_one_channel_at_full_scale_is_minus_3_01() -> None:
    assert measured(tone((0.0, 2), frequency_hz=997.0)[:, :1]).integrated_lufs == pytest.approx(-3.01, abs=0.01)


@pytest.mark.parametrize("number", range(0, 20, 3))
def test_max_short_term_of_case_10_wherever_the_tone_begins(number: int) -> None:
    found = measured(tone((-INF, 0.15 * number), (-23.0, 3), (-INF, 1)))
    assert found.max_short_term_lufs == pytest.approx(-23.0, abs=0.1)


@pytest.mark.parametrize("shift_s", [0.0, 0.02, 0.14, 0.38, 0.0153])
def test_max_momentary_of_case_13_wherever_the_tone_begins(shift_s: float) -> None:
    found = measured(tone((-INF, shift_s), (-23.0, 0.4), (-INF, 1)))
    assert found.max_momentary_lufs == pytest.approx(-23.0, abs=0.1)


def test_short_term_and_momentary_of_cases_9_and_12() -> None:
    assert measured(tone(*[(-20, 1.34), (-30, 1.66)] * 5)).max_short_term_lufs == pytest.approx(-23.0, abs=0.1)
    assert measured(tone(*[(-20, 0.18), (-30, 0.22)] * 25)).max_momentary_lufs == pytest.approx(-23.0, abs=0.1)


@pytest.mark.parametrize(
    ("levels_db", "range_lu"),
    [((-20, -30), 10), ((-20, -15), 5), ((-40, -20), 20), ((-50, -35, -20, -35, -50), 15)],
    ids=["1", "2", "3", "4"],
)
def test_loudness_range_of_tech_3342(levels_db: tuple[int, ...], range_lu: int) -> None:
    """Without the gate case 4 reads 30."""
    samples = tone(*[(level, 20) for level in levels_db], rate_hz=LOW_RATE_HZ)
    assert measured(samples, LOW_RATE_HZ).range_lu == pytest.approx(range_lu, abs=0.1)


def faded(samples: np.ndarray, count: int = 500) -> np.ndarray:
    """A sound that comes and goes softly: a tone that begins at once is more than a tone."""
    ramp = np.minimum(np.arange(len(samples)) / count, 1)
    return samples * (np.minimum(ramp, ramp[::-1]))[:, np.newaxis]


@pytest.mark.parametrize(
    ("part", "phase_deg", "amplitude", "peak_dbtp"),
    [(4, 0, 0.5, -6.0), (4, 45, 0.5, -6.0), (6, 60, 0.5, -6.0), (8, 67.5, 0.5, -6.0), (4, 45, 1.41, 3.0)],
    ids=["15", "16", "17", "18", "19"],
)
def test_true_peak_of_tech_3341(part: int, phase_deg: float, amplitude: float, peak_dbtp: float) -> None:
    """The samples of case 16 reach −9.0 dB only."""
    samples = amplitude * np.sin(2 * np.pi * np.arange(8000) / part + np.deg2rad(phase_deg))
    found = measured(faded(samples[:, np.newaxis])).max_true_peak_dbtp
    assert peak_dbtp - 0.4 <= found <= peak_dbtp + 0.2


@pytest.mark.parametrize("offset", range(4))
def test_true_peak_between_samples_of_cases_20_to_23(offset: int) -> None:
    """A pulse made at four times the rate, of height 1 on one of the four: decimated, its peak lies between samples."""
    fine = np.zeros(4 * 4000)
    fine[8000 + offset] = 1.0
    pulse = signal.upfirdn(signal.firwin(801, 0.16), fine)[400 : 400 + fine.size]
    samples = (pulse / pulse.max())[::4]
    assert measured(samples[:, np.newaxis]).max_true_peak_dbtp == pytest.approx(0.0, abs=0.2)


def test_a_peak_in_the_last_samples_counts_as_well_as_one_between_two_pieces() -> None:
    samples = np.zeros((1000, 2))
    samples[-1, 1] = 0.7
    assert measured(samples).max_true_peak_dbtp == pytest.approx(20 * np.log10(0.7), abs=0.01)
    between = np.zeros((200, 1))
    between[100:102] = 0.5
    whole = measured(between).max_true_peak_dbtp
    meter = LoudnessMeter(RATE_HZ, 1)
    for piece in np.split(between, [101]):
        meter.hear(piece)
    assert meter.measured().max_true_peak_dbtp == pytest.approx(whole, abs=1e-12)
    assert whole > 20 * np.log10(0.5) + 2


def test_nothing_depends_on_the_pieces() -> None:
    samples = (
        np.random.default_rng(3).normal(0, 0.1, (5 * RATE_HZ + 123, 2))
        * np.linspace(0.02, 1, 5 * RATE_HZ + 123)[:, None]
    )
    for cuts in ([1, 5, 1000, 1001, 200_000], range(0, 240_000, 777)):
        meter = LoudnessMeter(RATE_HZ, 2)
        for piece in np.split(samples, list(cuts)):
            meter.hear(piece)
        assert meter.measured() == measured(samples)


def test_what_is_too_short_too_soft_or_too_slow_has_no_loudness() -> None:
    short = measured(tone((-20.0, 0.39)))
    assert np.isnan(short.integrated_lufs)
    assert np.isnan(short.max_momentary_lufs)
    assert short.max_true_peak_dbtp == pytest.approx(-20, abs=0.1)
    middling = measured(tone((-20.0, 2.9)))
    assert np.isfinite(middling.integrated_lufs)
    assert np.isnan([middling.range_lu, middling.max_short_term_lufs]).all()
    silent = measured(np.zeros((4 * RATE_HZ, 1)))
    assert np.isnan(silent.integrated_lufs)
    assert silent.max_momentary_lufs == silent.max_true_peak_dbtp == -INF
    assert np.isnan(measured(tone((-20.0, 2), rate_hz=2000, frequency_hz=100), 2000).integrated_lufs)


def test_memory_does_not_grow() -> None:
    meter = LoudnessMeter(8000, 1)
    held = []
    for _ in range(3):
        meter.hear(np.random.default_rng(1).normal(0, 0.1, (20 * 8000 + 11, 1)))
        held.append(meter._powers.size + meter._rest.size + meter._true_peak._before.size)
    assert max(held) < 600


@pytest.mark.parametrize(("rate_hz", "channels"), [(0, 1), (48_000, 0)])
def test_impossible_sounds_are_argument_errors(rate_hz: int, channels: int) -> None:
    with pytest.raises(ArgumentError):
        LoudnessMeter(rate_hz, channels)
