"""The rumble filter against its formula, against another program, and as a part."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import signal

from gramoscope.errors import ArgumentError
from gramoscope.preamp.rumble import RumbleFilter
from gramoscope.quality import Quality

RATE_HZ = 96_000.0


@pytest.mark.parametrize(("corner_hz", "poles"), [(20.0, 3), (35.0, 1), (50.0, 4), (200.0, 8)])
def test_the_response_is_that_of_the_formula(corner_hz: float, poles: int) -> None:
    taps = RumbleFilter(corner_hz, poles).low_pass(RATE_HZ)
    frequency = np.array([0.0, 3.0, 11.0, corner_hz, 47.0, 173.0, 2000.0])
    place = np.arange(taps.size) - taps.size // 2
    low = [np.sum(taps * np.cos(2 * np.pi * f * place / RATE_HZ)) for f in frequency]
    expected = 1 - 1 / (1 + (frequency / corner_hz) ** (2 * poles))
    # the sampled response of one pole a side repeats at the rate: a part in a thousand at 35 Hz
    np.testing.assert_allclose(1 - np.array(low), expected, atol=2e-3 if poles == 1 else 2e-6)
    np.testing.assert_array_equal(taps, taps[::-1])


def test_it_is_a_butterworth_filter_of_scipy_run_both_ways(sounds: Any) -> None:
    rng = np.random.default_rng(1)
    middle = slice(60_000, 100_000)
    samples = np.cumsum(rng.standard_normal(160_000)) * 1e-4
    samples -= np.mean(samples)
    after = sounds.whole(RumbleFilter(50.0, 3).take_off([sounds.audio(samples)])).samples
    peer = signal.sosfiltfilt(signal.butter(3, 50.0, "highpass", fs=RATE_HZ, output="sos"), samples)
    difference = (after - peer)[middle]
    assert np.std(difference) < 2e-4 * np.std(peer[middle])


@pytest.mark.parametrize("places", [(1, 2, 3), (31_000, 32_000), tuple(range(0, 40_000, 7919))])
def test_cutting_the_sound_into_pieces_changes_no_bit(sounds: Any, places: tuple[int, ...]) -> None:
    sound = sounds.audio(sounds.process(40_000), flags=int(Quality.SPARSE))
    filtered = RumbleFilter(60.0)
    whole = sounds.whole(filtered.take_off([sound]))
    sounds.same(sounds.whole(filtered.take_off(sounds.cut(sound, *places))), whole)
    np.testing.assert_array_equal(whole.flags, sound.flags)
    assert "−6 dB at 60 Hz" in whole.history[1]


def test_a_tone_passes_and_a_shift_does_not(sounds: Any) -> None:
    time_s = np.arange(192_000) / RATE_HZ
    tone = 0.03 * np.sin(2 * np.pi * 317 * time_s + 0.4)
    after = sounds.whole(RumbleFilter().take_off([sounds.audio(tone + 0.01)])).samples
    middle = slice(70_000, 120_000)
    np.testing.assert_allclose(after[middle], tone[middle], atol=3e-8)


def test_the_claimed_error_of_white_noise_is_the_real_one(sounds: Any) -> None:
    noise = np.random.default_rng(2).standard_normal(60_000)
    after = sounds.whole(RumbleFilter(2000.0, 2).take_off([sounds.audio(noise, sigma=1.0)]))
    assert after.sigma[0] == pytest.approx(np.std(after.samples), rel=0.01)
    assert after.sigma[0] < 0.99


def test_a_passage_shorter_than_the_filter_and_a_nan_survive(sounds: Any) -> None:
    samples = sounds.process(500)
    samples[100] = np.nan
    after = sounds.whole(RumbleFilter().take_off([sounds.audio(samples)]))
    assert after.samples.size == 500
    assert np.all(np.isfinite(after.samples))
    assert np.flatnonzero(after.flags & Quality.INTERPOLATED).tolist() == [100]
    assert list(RumbleFilter().take_off([])) == []


@pytest.mark.parametrize("bad", [(0.0, 3), (20.0, 0), (20.0, 9), (float("nan"), 3)])
def test_impossible_parameters_are_refused(bad: tuple[float, int]) -> None:
    with pytest.raises(ArgumentError):
        RumbleFilter(*bad)


def test_a_corner_too_high_for_the_rate_is_refused() -> None:
    with pytest.raises(ArgumentError, match="a quarter of the rate"):
        RumbleFilter(30_000.0).low_pass(RATE_HZ)
