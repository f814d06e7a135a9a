"""Clocks in the groove: hum and tuning are found with true error bars, and not found where there are none."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gramoscope.conventions import FloatArray
from gramoscope.listening.mains_hum import HumFinding, HumListener
from gramoscope.listening.tuning import TuningFinding, TuningListener
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio

RATE_HZ = 4000.0


def _piece(samples: FloatArray, start: int = 0, flags: int = 0) -> Audio:
    return Audio(start, RATE_HZ, samples, np.full(samples.size, 1e-3), np.full(samples.size, flags, np.uint16))


def _hummed(samples: FloatArray, *cuts: int) -> HumFinding:
    listener = HumListener(RATE_HZ)
    for a, b in pairwise([0, *cuts, samples.size]):
        listener.hear(_piece(samples[a:b], a))
    return listener.finding()


def _tuned(samples: FloatArray, *cuts: int) -> TuningFinding:
    listener = TuningListener(RATE_HZ)
    for a, b in pairwise([0, *cuts, samples.size]):
        listener.hear(_piece(samples[a:b], a))
    return listener.finding()


def _time(seconds: float) -> FloatArray:
    return np.arange(round(seconds * RATE_HZ)) / RATE_HZ


def _music(seconds: float, *, cents: float = 0.0, seed: int = 0, spread: float = 4.0) -> FloatArray:
    """Chords of notes with partials, each note a few cents off; and noise."""
    rng, time = np.random.default_rng(seed), _time(seconds)
    sound = 0.02 * rng.standard_normal(time.size)
    for start in np.arange(0, seconds, 0.5):
        here = (time >= start) & (time < start + 0.5)
        for key in rng.choice(np.arange(-24, 12), 3, replace=False):
            f = 440 * 2 ** ((100 * key + cents + spread * rng.standard_normal()) / 1200)
            for partial in (1, 2, 3):
                sound[here] += np.sin(2 * np.pi * partial * f * time[here] + 6 * rng.random()) / partial**2
    return sound


def _hum(seconds: float, line_hz: float, *, seed: int = 0, level: float = 0.02) -> FloatArray:
    """A line with its second and third multiple, under noise that falls with frequency."""
    rng, time = np.random.default_rng(seed), _time(seconds)
    noise = np.cumsum(rng.standard_normal(time.size))
    noise -= np.convolve(noise, np.ones(401) / 401, "same")
    line = sum(a * np.sin(2 * np.pi * h * line_hz * time + h) for h, a in ((1, 1.0), (2, 1.5), (3, 0.4)))
    return noise / noise.std() + level * np.asarray(line)


def test_hum_is_found_and_says_what_the_mains_would_make_of_it() -> None:
    found = _hummed(_hum(40, 58.7, level=0.1))
    assert found.reason is None
    assert abs(found.line_hz - 58.7) < 4 * found.sigma_hz
    assert found.sigma_hz < 0.02
    assert 1 in found.harmonics
    assert 2 in found.harmonics
    assert found.mains_hz() == (60.0,)
    assert HumFinding(line_hz=54.0).mains_hz() == (50.0, 60.0)


def test_hum_under_music_is_found() -> None:
    sound = _music(40) + 2 * _hum(40, 49.1, level=0.3) * 0.05
    found = _hummed(sound)
    assert found.line_hz == pytest.approx(49.1, abs=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_noise_and_music_have_no_hum(seed: int) -> None:
    for sound in (_hum(30, 60.0, seed=seed, level=0.0), _music(30, seed=seed)):
        found = _hummed(sound)
        assert found.reason is not None
        assert "steady" in found.reason


def test_a_note_that_comes_and_goes_is_no_hum() -> None:
    time = _time(40)
    bass = np.sin(2 * np.pi * 55.0 * time) * ((time % 20) < 10)
    assert _hummed(_hum(40, 60.0, level=0.0) + bass).reason is not None


def test_error_bars_of_hum_are_true() -> None:
    found = [_hummed(_hum(60, 58.7, seed=seed, level=0.1)) for seed in range(24)]
    pulls = np.array([(one.line_hz - 58.7) / one.sigma_hz for one in found if one.reason is None])
    assert pulls.size > 15
    assert 0.6 < pulls.std() < 1.45
    assert abs(pulls.mean()) < 0.8


@pytest.mark.parametrize("cents", [-43.0, -7.0, 0.0, 31.0])
def test_the_tuning_is_found(cents: float) -> None:
    found = _tuned(_music(30, cents=cents))
    assert found.reason is None
    assert abs(found.cents - cents) < 4 * found.sigma_cents + 0.7
    assert found.sigma_cents < 2
    assert found.a_hz == pytest.approx(440 * 2 ** (cents / 1200), rel=2e-3)


def test_a_tone_is_placed_between_the_bins_of_its_spectrum() -> None:
    """Bins lie 7 cents apart here."""
    for cents in (11.0, 13.0, 15.0):
        f = 440 * 2 ** (cents / 1200)
        assert _tuned(np.sin(2 * np.pi * f * _time(15))).cents == pytest.approx(cents, abs=0.2)


def test_error_bars_of_the_tuning_are_true() -> None:
    """Notes that are off by chance, 10 cents each: three partials of one note are off alike."""
    found = [_tuned(_music(30, cents=12.0, seed=seed, spread=10.0)) for seed in range(24)]
    pulls = np.array([(one.cents - 12.0) / one.sigma_cents for one in found])
    assert 0.6 < pulls.std() < 1.45
    assert abs(pulls.mean()) < 0.8


def test_noise_and_a_glide_have_no_tuning() -> None:
    time = _time(20)
    glide = np.sin(2 * np.pi * 300 * 10 / np.log(4) * 4 ** (time / 20))
    for sound in (np.random.default_rng(1).standard_normal(time.size), glide):
        assert _tuned(sound).reason is not None


def test_what_is_too_short_or_was_not_measured_says_nothing() -> None:
    for listen in (_hummed, _tuned):
        found = listen(_music(0.7))
        assert found.reason is not None
        assert "too short" in found.reason
    hum, tuning = HumListener(RATE_HZ), TuningListener(RATE_HZ)
    for listener in (hum, tuning):
        listener.hear(_piece(_hum(40, 60.0), flags=Quality.INTERPOLATED))
        assert "too short" in str(listener.finding().reason)


@pytest.mark.parametrize("cuts", [(1, 2, 3), (16_000, 16_001, 70_123)])
def test_how_the_stream_is_cut_changes_nothing(cuts: tuple[int, ...]) -> None:
    sound = _music(30, cents=9.0) + _hum(30, 58.7, level=0.5)
    assert _hummed(sound, *cuts) == _hummed(sound)
    assert _tuned(sound, *cuts) == _tuned(sound)
