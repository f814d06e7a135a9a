"""Crackle of known density and heights, in a process that is known and in real music."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soxr

from gramoscope.errors import ArgumentError
from gramoscope.listening.wav import read_sound
from gramoscope.preamp.decrackle import Decrackler, mean_field
from gramoscope.quality import Quality

MUSIC = Path(__file__).parents[2].parent / "shared" / "data" / "audio"


def crackle(count: int, *, a_second: float, height: float, seed: int = 3) -> np.ndarray:
    """Impulses at random, low-passed as by groove and pickup."""
    rng = np.random.default_rng(seed)
    struck = rng.random(count) < a_second / 96_000
    pulses = np.where(struck, rng.standard_normal(count), 0.0)
    frequency = np.fft.rfftfreq(count, 1 / 96_000)
    return height * np.fft.irfft(np.fft.rfft(pulses) / (1 + (frequency / 15_000) ** 4), count)


def level_db(sound: np.ndarray, other: np.ndarray) -> float:
    return float(10 * np.log10(np.sum(sound**2) / np.sum(other**2)))


def test_the_posterior_of_a_single_pulse_is_bayes_rule() -> None:
    errors = np.random.default_rng(1).standard_normal(30)
    errors[11] += 3.0
    noise, slab, density = np.ones((1, 30)), np.array([16.0]), 1e-3
    alpha, mean, variance = mean_field(errors, np.ones((1, 1)), noise, slab, density, 1)
    # with a pulse of one tap every place is on its own
    there = density * np.exp(-(errors**2) / 2 / 17) / np.sqrt(17)
    absent = (1 - density) * np.exp(-(errors**2) / 2)
    np.testing.assert_allclose(alpha[0], there / (there + absent), rtol=1e-9)
    np.testing.assert_allclose(mean[0], errors * 16 / 17, rtol=1e-12)
    np.testing.assert_allclose(variance[0], 16 / 17, rtol=1e-12)


def test_crackle_gets_quieter_and_the_claimed_errors_are_the_real_ones(sounds: Any) -> None:
    clean = sounds.process(48_000)
    noise = crackle(48_000, a_second=500, height=0.02)
    after = sounds.whole(Decrackler().decrackle([sounds.audio(clean + noise)]))
    assert level_db(clean, after.samples - clean) > level_db(clean, noise) + 8
    touched = (after.flags & Quality.DECRACKLED) != 0
    assert 0.01 < touched.mean() < 0.1
    pull = (after.samples - clean)[touched] / after.sigma[touched]
    assert np.std(pull) == pytest.approx(1, abs=0.5)


def test_sound_without_crackle_is_passed_on_bit_for_bit(sounds: Any) -> None:
    sound = sounds.audio(sounds.process(48_000, seed=4), flags=int(Quality.SPARSE))
    after = sounds.whole(Decrackler().decrackle([sound]))
    sounds.same(after, sound)
    assert after.history[0] == "read from a groove"
    assert "50%" in after.history[1]


@pytest.mark.parametrize("places", [(1, 2, 3), (1905, 1920, 1935), tuple(range(0, 12_000, 777))])
def test_cutting_the_sound_into_pieces_changes_no_bit(sounds: Any, places: tuple[int, ...]) -> None:
    sound = sounds.audio(sounds.process(12_000) + crackle(12_000, a_second=1000, height=0.02))
    parts = sounds.whole(Decrackler().decrackle(sounds.cut(sound, *places)))
    sounds.same(parts, sounds.whole(Decrackler().decrackle([sound])))
    assert np.any(parts.flags)


def test_a_pulse_within_the_claimed_error_is_no_crackle(sounds: Any) -> None:
    spoilt, sensitive = sounds.process(8000), Decrackler(least_density_hz=0.0)
    spoilt[5000:5003] += 8 * sounds.scale_m_s
    sigma = np.full(8000, 1e-5)
    assert np.any(sounds.whole(sensitive.decrackle([sounds.audio(spoilt, sigma=sigma)])).flags)
    sigma[4999:5004] = 1e-2
    assert not np.any(sounds.whole(sensitive.decrackle([sounds.audio(spoilt, sigma=sigma)])).flags)


def test_a_few_pulses_are_no_crackle(sounds: Any) -> None:
    spoilt = sounds.process(8000)
    spoilt[5000:5003] += 8 * sounds.scale_m_s
    sound = sounds.audio(spoilt)
    sounds.same(sounds.whole(Decrackler().decrackle([sound])), sound)
    assert np.any(sounds.whole(Decrackler(least_density_hz=0.0).decrackle([sound])).flags)


def test_a_nan_counts_as_silence_and_is_flagged(sounds: Any) -> None:
    samples = sounds.process(8000)
    samples[4000:4500] = np.nan
    after = sounds.whole(Decrackler().decrackle([sounds.audio(samples)]))
    assert np.all(np.isfinite(after.samples))
    assert np.all(after.flags[4000:4500] & Quality.INTERPOLATED)


def test_silence_and_passages_too_short_to_learn_from_pass(sounds: Any) -> None:
    for samples in (np.zeros(6000), sounds.process(100), np.zeros(1)):
        sound = sounds.audio(samples)
        sounds.same(sounds.whole(Decrackler().decrackle([sound])), sound)
    assert list(Decrackler().decrackle([])) == []


@pytest.mark.parametrize(
    "bad", [{"probability": 0.0}, {"probability": 1.0}, {"least_density_hz": -1.0}, {"order": 0}, {"block_s": 0.0}]
)
def test_impossible_parameters_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ArgumentError):
        Decrackler(**bad)  # type: ignore[arg-type]


def test_blocks_too_short_for_the_order_are_refused(sounds: Any) -> None:
    with pytest.raises(ArgumentError, match="order of 300"):
        list(Decrackler(order=300).decrackle([sounds.audio(sounds.process(9000))]))


@pytest.mark.parametrize(
    ("name", "untouched_db"), [("orchestra.wav", 90), ("piano.wav", 120), ("singing-female.wav", 120)]
)
def test_real_sound_is_hardly_touched_and_its_crackle_is(sounds: Any, name: str, untouched_db: float) -> None:
    if not (MUSIC / name).is_file():
        pytest.skip(f"{name} is not here")
    samples, rate_hz = read_sound(MUSIC / name, start_s=0.6, seconds=0.4)
    clean = soxr.resample(samples[:, 0], rate_hz, sounds.rate_hz)[1000:-1000]
    clean *= 0.03 / np.std(clean)
    clean += 1e-4 * np.random.default_rng(1).standard_normal(clean.size)
    quiet = sounds.whole(Decrackler().decrackle([sounds.audio(clean, sigma=1e-4)])).samples
    assert np.sum((quiet - clean) ** 2) <= 10 ** (-untouched_db / 10) * np.sum(clean**2)
    noise = crackle(clean.size, a_second=500, height=0.03)
    after = sounds.whole(Decrackler().decrackle([sounds.audio(clean + noise, sigma=1e-4)])).samples
    assert level_db(clean, after - clean) > level_db(clean, noise) + 6
