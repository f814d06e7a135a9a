"""Clicks at known places, in a process that is known and in real music."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soxr

from gramoscope.errors import ArgumentError
from gramoscope.listening.wav import read_sound
from gramoscope.preamp.declick import Declicker
from gramoscope.quality import Quality

MUSIC = Path(__file__).parents[2].parent / "shared" / "data" / "audio"
PLACES = np.arange(700, 15_000, 1490)
LENGTH = 20


def test_clicks_are_found_where_they_are_and_most_of_them_goes_away(sounds: Any) -> None:
    clean = sounds.process(16_000)
    spoilt = sounds.with_bursts(clean, PLACES, length=LENGTH, height=0.02)
    after = sounds.whole(Declicker().declick([sounds.audio(spoilt)]))
    touched = (after.flags & Quality.DECLICKED) != 0
    assert all(touched[place : place + LENGTH].mean() > 0.8 for place in PLACES)
    near = np.isin(np.arange(16_000), (PLACES[:, np.newaxis] + np.arange(-8, LENGTH + 8)).ravel())
    assert not np.any(touched & ~near)
    before_db, after_db = (
        10 * np.log10(np.sum(clean**2) / np.sum((sound - clean) ** 2)) for sound in (spoilt, after.samples)
    )
    assert after_db > before_db + 12


def test_the_claimed_errors_are_the_real_ones(sounds: Any) -> None:
    clean = sounds.process(60_000, seed=8)
    spoilt = sounds.with_bursts(clean, range(700, 59_000, 590), length=LENGTH, height=0.05)
    after = sounds.whole(Declicker().declick([sounds.audio(spoilt)]))
    touched = (after.flags & Quality.DECLICKED) != 0
    pull = (after.samples - clean)[touched] / after.sigma[touched]
    assert np.std(pull) == pytest.approx(1, abs=0.2)


def test_what_is_not_touched_is_passed_on_bit_for_bit(sounds: Any) -> None:
    sound = sounds.audio(
        sounds.with_bursts(sounds.process(16_000), PLACES, length=LENGTH, height=0.02), flags=int(Quality.EDGE)
    )
    after = sounds.whole(Declicker().declick([sound]))
    untouched = (after.flags & Quality.DECLICKED) == 0
    for name in ("samples", "sigma", "flags"):
        np.testing.assert_array_equal(getattr(after, name)[untouched], getattr(sound, name)[untouched])
    assert np.all(after.flags & Quality.EDGE)
    assert 0.01 < 1 - untouched.mean() < 0.05


def test_where_there_is_nothing_to_do_nothing_is_done(sounds: Any) -> None:
    sound = sounds.audio(sounds.process(16_000, seed=9))
    after = sounds.whole(Declicker().declick([sound]))
    sounds.same(after, sound)
    assert after.history[0] == "read from a groove"
    assert "10 standard errors" in after.history[1]


@pytest.mark.parametrize("places", [(1, 2, 3), (1905, 1920, 1935), tuple(range(0, 16_000, 777)), (5, 5)])
def test_cutting_the_sound_into_pieces_changes_no_bit(sounds: Any, places: tuple[int, ...]) -> None:
    # clicks across the edges of blocks, which lie at multiples of 1920 by the number of the sample
    spoilt = sounds.with_bursts(sounds.process(16_000), [700, 1903, 3830, 9000], length=LENGTH, height=0.03)
    sound = sounds.audio(spoilt)
    sounds.same(
        sounds.whole(Declicker().declick(sounds.cut(sound, *places))), sounds.whole(Declicker().declick([sound]))
    )


def test_a_click_across_the_edge_of_a_block_is_repaired_whole(sounds: Any) -> None:
    clean = sounds.process(16_000)
    spoilt = sounds.with_bursts(clean, [1903], length=LENGTH, height=0.05)  # samples 1910 … 1929, block ends at 1920
    after = sounds.whole(Declicker().declick([sounds.audio(spoilt)]))
    touched = np.flatnonzero(after.flags & Quality.DECLICKED)
    assert touched[0] <= 1904
    assert touched[-1] >= 1921
    np.testing.assert_array_equal(np.diff(touched), 1)


def test_a_flag_of_the_pickup_is_a_witness_and_those_of_its_ends_are_none(sounds: Any) -> None:
    clean = sounds.process(16_000, seed=11)
    spoilt = clean.copy()
    spoilt[5000:5003] += np.array([0.5, 1.0, 0.5]) * 4 * sounds.scale_m_s
    for flag, found in ((Quality.SPARSE, True), (Quality.EDGE, False), (Quality(0), False)):
        flags = np.zeros(16_000, np.uint16)
        flags[4998:5005] = int(flag)
        after = sounds.whole(Declicker().declick([sounds.audio(spoilt, flags=flags)]))
        assert bool(np.any(after.flags & Quality.DECLICKED)) is found, flag


def test_a_pulse_within_the_claimed_error_is_no_click(sounds: Any) -> None:
    spoilt = sounds.process(16_000)
    spoilt[5000:5003] += 12 * sounds.scale_m_s
    sigma = np.full(16_000, 1e-5)
    assert np.any(sounds.whole(Declicker().declick([sounds.audio(spoilt, sigma=sigma)])).flags)
    sigma[4999:5004] = 1e-2
    assert not np.any(sounds.whole(Declicker().declick([sounds.audio(spoilt, sigma=sigma)])).flags)


def test_a_gap_is_filled_and_flagged_and_one_that_is_too_long_stays_silent(sounds: Any) -> None:
    clean = sounds.process(16_000)
    broken = clean.copy()
    broken[3000:3015] = np.nan
    broken[8000:9000] = np.nan
    after = sounds.whole(Declicker().declick([sounds.audio(broken)]))
    short, long = slice(3000, 3015), slice(8000, 9000)
    assert np.all(after.flags[short] == int(Quality.INTERPOLATED | Quality.DECLICKED))
    assert np.all(np.abs(after.samples - clean)[short] < 5 * after.sigma[short])
    assert np.all(after.flags[long] & Quality.INTERPOLATED)
    np.testing.assert_array_equal(after.samples[8100:8900], 0)
    assert np.all(np.isnan(after.sigma[8100:8900]))
    assert np.all(np.isfinite(after.samples))
    assert np.isnan(broken[3000])


@pytest.mark.parametrize(("claimed_m_s", "refilled"), [(1e-5, False), (1.0, False), (np.nan, True)])
def test_what_was_interpolated_while_reading_stays_unless_nothing_is_claimed_of_it(
    sounds: Any, claimed_m_s: float, refilled: bool
) -> None:
    flags, sigma = np.zeros(16_000, np.uint16), np.full(16_000, 1e-5)
    flags[6000:6010] = int(Quality.INTERPOLATED)
    sigma[6000:6010] = claimed_m_s
    sound = sounds.audio(sounds.process(16_000), sigma=sigma, flags=flags)
    after = sounds.whole(Declicker().declick([sound]))
    assert bool(np.all(after.flags[6000:6010] & Quality.DECLICKED)) is refilled
    assert bool(np.any(after.flags & Quality.DECLICKED)) is refilled


def test_a_disturbance_longer_than_the_longest_click_is_left_alone(sounds: Any) -> None:
    spoilt = sounds.with_bursts(sounds.process(16_000), [6000], length=400, height=0.05)
    sound = sounds.audio(spoilt)
    after = sounds.whole(Declicker(longest_s=0.001).declick([sound]))
    np.testing.assert_array_equal(after.samples[6050:6350], spoilt[6050:6350])


def test_silence_and_passages_too_short_to_learn_from_pass(sounds: Any) -> None:
    for samples in (np.zeros(6000), sounds.process(100), np.zeros(1)):
        sound = sounds.audio(samples)
        sounds.same(sounds.whole(Declicker().declick([sound])), sound)
    assert list(Declicker().declick([])) == []


@pytest.mark.parametrize(
    "bad",
    [
        {"threshold": 0.0},
        {"flagged_threshold": 11.0},
        {"longest_s": 0.0},
        {"order": 0},
        {"block_s": 0.001},
        {"passes": 0},
    ],
)
def test_impossible_parameters_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError):
        Declicker(**bad)


def test_blocks_too_short_for_the_order_are_refused(sounds: Any) -> None:
    with pytest.raises(ArgumentError, match="order of 300"):
        list(Declicker(order=300).declick([sounds.audio(sounds.process(16_000))]))
    first, _, third = sounds.cut(sounds.audio(sounds.process(9000)), 3000, 6000)
    with pytest.raises(ArgumentError, match="starts at sample"):
        list(Declicker().declick([first, third]))


@pytest.mark.parametrize(
    ("name", "untouched_db", "gain_db"), [("orchestra.wav", 90, 3), ("piano.wav", 90, 3), ("speech-male.wav", 38, 3)]
)
def test_clicks_in_real_sound(sounds: Any, name: str, untouched_db: float, gain_db: float) -> None:
    if not (MUSIC / name).is_file():
        pytest.skip(f"{name} is not here")
    samples, rate_hz = read_sound(MUSIC / name, start_s=0.6, seconds=0.6)
    # the resampler rings where the sound is cut off
    clean = soxr.resample(samples[:, 0], rate_hz, sounds.rate_hz)[1000:-1000]
    clean *= 0.03 / np.std(clean)
    clean += 3e-4 * np.random.default_rng(1).standard_normal(clean.size)
    quiet = sounds.whole(Declicker().declick([sounds.audio(clean, sigma=3e-4)]))
    assert np.sum((quiet.samples - clean) ** 2) <= 10 ** (-untouched_db / 10) * np.sum(clean**2)
    places = np.arange(1500, clean.size - 1500, 4801)
    spoilt = sounds.with_bursts(clean, places, length=24, height=0.15)
    after = sounds.whole(Declicker().declick([sounds.audio(spoilt, sigma=3e-4)]))
    assert all(np.any(after.flags[place : place + 24] & Quality.DECLICKED) for place in places)
    assert np.sum((after.samples - clean) ** 2) < 10 ** (-gain_db / 10) * np.sum((spoilt - clean) ** 2)


def test_the_input_is_not_changed(sounds: Any) -> None:
    sound = sounds.audio(sounds.with_bursts(sounds.process(9000), [5000], length=9, height=0.1))
    before = replace(sound, samples=sound.samples.copy(), sigma=sound.sigma.copy(), flags=sound.flags.copy())
    assert np.any(sounds.whole(Declicker().declick([sound])).flags)
    sounds.same(sound, before)
