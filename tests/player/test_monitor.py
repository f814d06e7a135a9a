"""What the monitor counts is what passed, however it was cut into pieces."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gramoscope.player.monitor import MOST_PROBLEMS, Monitor, Overview
from gramoscope.quality import REPAIRS, Quality
from gramoscope.signal_path import Audio, WallTrace
from gramoscope.tonearm.splice import Match

RATE_HZ = 96_000.0
INTERPOLATED, OUTLIER = int(Quality.INTERPOLATED), int(Quality.OUTLIER)


def _audio(size: int, seed: int = 3) -> Audio:
    rng = np.random.default_rng(seed)
    flags = rng.choice([0, 0, 0, INTERPOLATED, OUTLIER, INTERPOLATED | OUTLIER], size).astype(np.uint16)
    return Audio(0, RATE_HZ, rng.normal(0.01, 0.03, size), rng.uniform(0.001, 0.004, size), flags)


def _pieces(audio: Audio, cuts: list[int]) -> list[Audio]:
    edges = [0, *sorted(min(cut, audio.samples.size) for cut in cuts), audio.samples.size]
    return [
        Audio(a, RATE_HZ, audio.samples[a:b], audio.sigma[a:b], audio.flags[a:b]) for a, b in itertools.pairwise(edges)
    ]


def _heard(pieces: list[Audio], samples_per_point: int = 1) -> Monitor:
    monitor = Monitor()
    monitor.overview.samples_per_point = samples_per_point
    for piece in pieces:
        monitor.heard(piece)
    return monitor


def test_the_sums_are_those_of_numpy() -> None:
    audio = _audio(1237)
    found = _heard(_pieces(audio, [100, 101, 640])).as_dict()
    missing = (audio.flags & INTERPOLATED) != 0
    noise = np.mean(audio.sigma[~missing] ** 2)
    assert found["share"]["interpolated"] == pytest.approx(missing.mean())
    assert found["share"]["measured"] == pytest.approx(1 - missing.mean())
    assert found["level"]["rms_cm_s"] == pytest.approx(100 * np.sqrt(np.mean(audio.samples**2)))
    assert found["level"]["peak_cm_s"] == pytest.approx(100 * np.abs(audio.samples).max())
    assert found["noise_estimate"]["sigma_rms_cm_s"] == pytest.approx(100 * np.sqrt(noise))
    snr = (np.mean(audio.samples[~missing] ** 2) - noise) / noise
    assert found["noise_estimate"]["signal_to_noise_db"] == pytest.approx(10 * np.log10(snr))
    assert found["flagged_samples"]["outlier"] == np.count_nonzero(audio.flags & OUTLIER)
    told = [flag for flag in Quality if flag not in REPAIRS | Quality.SILENCE]
    assert set(found["flagged_samples"]) == {str(flag.name).lower() for flag in told}


@given(st.lists(st.integers(0, 331), max_size=6), st.integers(1, 40))
def test_nothing_depends_on_how_the_sound_was_cut_into_pieces(cuts: list[int], samples_per_point: int) -> None:
    audio = _audio(331)
    whole, parts = _heard([audio], samples_per_point), _heard(_pieces(audio, cuts), samples_per_point)
    for name in ("samples", "interpolated", "flags", "peak_m_s"):
        assert getattr(whole, name) == getattr(parts, name)
    assert parts.power == pytest.approx(whole.power)
    assert parts.noise_power == pytest.approx(whole.noise_power)
    for one, other in zip(whole.overview.waveform(RATE_HZ), parts.overview.waveform(RATE_HZ), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_nan_among_the_errors_does_not_spoil_the_estimate() -> None:
    audio = _audio(50)
    sigma = audio.sigma.copy()
    sigma[7] = np.nan
    assert np.isfinite(_heard([replace(audio, sigma=sigma)]).noise_m_s)


def test_before_anything_is_heard_the_figures_are_unknown_not_zero() -> None:
    monitor = Monitor()
    assert np.isnan([monitor.measured_share, monitor.noise_m_s, monitor.snr_db]).all()
    assert monitor.as_dict()["groups"] == {"read": 0, "lost": 0}
    assert all(part.size == 0 for part in monitor.overview.waveform(RATE_HZ))


@pytest.mark.parametrize(("size", "per_point"), [(1, 1), (1, 7), (6, 7), (7, 7), (350, 7), (353, 7), (999, 1), (40, 2)])
def test_the_overview_has_even_steps_and_the_right_extremes(size: int, per_point: int) -> None:
    audio = _audio(size)
    overview = Overview(per_point)
    for piece in _pieces(audio, [size // 3, size // 2]):
        overview.add(piece)
    time_s, velocity, sigma, missing = overview.waveform(RATE_HZ)
    assert time_s.size == velocity.size == sigma.size == missing.size
    if time_s.size > 1:
        np.testing.assert_allclose(np.diff(time_s), time_s[1] - time_s[0], rtol=1e-9)
        span_s = time_s.size * (time_s[1] - time_s[0])
        assert -1e-6 < span_s * RATE_HZ - size < per_point - 1 + 1e-6
    assert velocity.max() == audio.samples.max()
    assert velocity.min() == audio.samples.min()
    assert sigma.max() == audio.sigma.max()
    assert missing.any() == bool((audio.flags & INTERPOLATED).any())


def test_without_thinning_the_overview_is_the_sound_itself() -> None:
    audio = _audio(77)
    overview = Overview()
    overview.add(audio)
    time_s, velocity, _, missing = overview.waveform(RATE_HZ)
    np.testing.assert_array_equal(velocity, audio.samples)
    np.testing.assert_array_equal(missing, (audio.flags & INTERPOLATED) != 0)
    np.testing.assert_allclose(time_s, np.arange(77) / RATE_HZ)


def _trace(number: int, *, seen: bool, problems: tuple[str, ...] = ()) -> WallTrace:
    slope = np.full((2, 9), np.nan)
    flags = np.zeros((2, 9), np.uint16)
    if seen:
        slope[0] = 0.01
        flags[0, 4:6] = OUTLIER
    else:
        flags[:] = INTERPOLATED
    steps = np.array([0.7e-6, np.nan, 0.9e-6])
    return WallTrace(number, 0.0, 4e-6, slope, slope, slope, slope, 1.0, flags, frame_step_m=steps, problems=problems)


def test_stretches_without_a_groove_are_lost_and_their_numbers_kept() -> None:
    monitor = Monitor()
    for number in range(5):
        monitor.picked_up(_trace(number, seen=number not in (1, 4)), frames_lost=number)
    found = monitor.as_dict()
    assert found["groups"] == {"read": 3, "lost": 2}
    assert found["lost_groups"] == [1, 4]
    assert found["frames_lost"] == 0 + 1 + 2 + 3 + 4
    assert found["flagged_pickup_samples"]["outlier"] == 3 * 2, "a wall that is not read does not count"
    assert found["frame_step"]["steps_measured"] == 10
    assert found["frame_step"]["measured_mean_um"] == pytest.approx(0.8)
    assert found["frame_step"]["measured_spread_um"] == pytest.approx(0.1)


def test_problems_are_told_up_to_a_number_and_counted_beyond_it() -> None:
    monitor = Monitor()
    for number in range(MOST_PROBLEMS // 2 + 3):
        monitor.picked_up(_trace(number, seen=True, problems=(f"a {number}", f"b {number}")), frames_lost=0)
    found = monitor.as_dict()
    assert len(found["problems"]) == MOST_PROBLEMS
    assert found["problems"][:3] == ["group 0, a 0", "group 0, b 0", "group 1, a 1"]
    assert found["problems_not_listed"] == 6


def test_matched_overlaps_tell_how_far_the_encoder_was_off() -> None:
    monitor = Monitor()
    for error_m in (3e-6, -4e-6, float("nan")):
        monitor.spliced(_match(error_m))
    monitor.spliced(None)
    found = monitor.as_dict()["group_positions"]
    assert (found["overlaps_matched"], found["overlaps_not_matched"]) == (2, 1)
    assert found["rms_error_of_the_nominal_step_um"] == pytest.approx(np.sqrt((9 + 16) / 2))


def _match(error_m: float) -> Match:
    return Match(error_m=error_m, correlation=0.8)
