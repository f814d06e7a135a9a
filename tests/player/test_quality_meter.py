"""The figures of the statement of quality, against sums made in one go and against closed forms."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gramoscope.conventions import INNER, OUTER
from gramoscope.player.calibration_check import calibration_check
from gramoscope.player.quality_meter import QualityMeter
from gramoscope.player.response import response_of
from gramoscope.player.strip_chart import StripChart
from gramoscope.player.wall_agreement import WallAgreement
from gramoscope.player.worst_groups import KEPT, WorstGroups
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio, ErrorSpectrum, GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.turntable.rotation import Rotation

RATE_HZ = 96_000.0
COURSE = Course(Rotation(rpm=78.0, radius_m=0.115), "lateral", np.pi / 4, 0.1)
STEP_M, SIGMA_M = 3.125e-6, 40e-9
FILLED, LOST, DARK = (np.uint16(flag) for flag in (Quality.INTERPOLATED, Quality.FRAME_LOST, Quality.DARK))


def _audio(size: int = 1000, seed: int = 3) -> Audio:
    rng = np.random.default_rng(seed)
    flags = rng.choice([0, 0, FILLED, FILLED | LOST, DARK, FILLED | DARK], size).astype(np.uint16)
    return Audio(0, RATE_HZ, rng.normal(0.01, 0.03, size), rng.uniform(0.001, 0.004, size), flags)


def _pieces(audio: Audio, cuts: list[int]) -> list[Audio]:
    edges = [0, *sorted(min(cut, audio.samples.size) for cut in cuts), audio.samples.size]
    return [
        Audio(a, RATE_HZ, audio.samples[a:b], audio.sigma[a:b], audio.flags[a:b]) for a, b in itertools.pairwise(edges)
    ]


def _chart(pieces: list[Audio], samples_per_point: int) -> StripChart:
    chart = StripChart(samples_per_point)
    for piece in pieces:
        chart.add(piece)
    return chart


def test_the_strip_chart_counts_what_is_there() -> None:
    audio = _audio()
    found = _chart(_pieces(audio, [7, 333]), 300).as_dict(RATE_HZ)
    runs = [slice(0, 300), slice(300, 600), slice(600, 900), slice(900, 1000)]
    filled = (audio.flags & FILLED) != 0
    missing = filled & ((audio.flags & (LOST | DARK)) != 0)
    for name, marked in (("measured", ~filled), ("bridged", filled & ~missing), ("missing", missing)):
        np.testing.assert_allclose(found[name], [marked[run].mean() for run in runs], rtol=1e-4)
    rms = [100 * np.sqrt(np.mean(audio.samples[run] ** 2)) for run in runs]
    np.testing.assert_allclose(found["rms_cm_s"], rms, rtol=1e-4)
    noise = [100 * np.sqrt(np.mean(audio.sigma[run][~filled[run]] ** 2)) for run in runs]
    np.testing.assert_allclose(found["sigma_rms_cm_s"], noise, rtol=1e-4)
    assert set(found["flags"]) == {"interpolated", "frame_lost", "dark"}
    np.testing.assert_allclose(
        found["flags"]["dark"], [((audio.flags & DARK) != 0)[run].mean() for run in runs], rtol=1e-4
    )
    assert found["step_s"] == pytest.approx(300 / RATE_HZ)


def test_the_shares_of_the_whole_add_up() -> None:
    audio = _audio()
    chart = _chart([audio], 300)
    filled = (audio.flags & FILLED) != 0
    assert chart.shares()["measured"] == pytest.approx((~filled).mean())
    assert sum(chart.shares().values()) == pytest.approx(1.0)
    assert chart.mean_variance() == pytest.approx(np.mean(audio.sigma[~filled] ** 2))
    assert np.isnan([*StripChart(3).shares().values(), StripChart(3).mean_variance()]).all()


@settings(deadline=None)
@given(st.lists(st.integers(0, 1000), max_size=6), st.integers(20, 400))
def test_not_a_bit_of_the_chart_depends_on_how_the_sound_is_cut(cuts: list[int], samples_per_point: int) -> None:
    audio = _audio()
    whole, parts = _chart([audio], samples_per_point), _chart(_pieces(audio, cuts), samples_per_point)
    assert repr(whole.as_dict(RATE_HZ)) == repr(parts.as_dict(RATE_HZ))
    assert whole.mean_variance() == parts.mean_variance()


def _trace(number: int, *, lateral: float = 1e-6, vertical: float = 0.0, sigma_m: float = SIGMA_M) -> WallTrace:
    """A groove that swings with a period of 80 samples, read with white errors."""
    rng = np.random.default_rng(number)
    phase = 2 * np.pi * np.arange(160) / 80 + number
    a, h = lateral * np.sin(phase), vertical * np.cos(phase)
    offset = np.empty((2, 160))
    offset[INNER], offset[OUTER] = a - h + 35e-6, a + h - 30e-6
    offset += sigma_m * rng.normal(size=(2, 160))
    unknown = np.full((2, 160), np.nan)
    sigma, flags = np.full((2, 160), SIGMA_M), np.zeros((2, 160), np.uint16)
    return WallTrace(number, number * 160 * STEP_M, STEP_M, offset, sigma, unknown, unknown, 1.0, flags)


def _agreement(course: Course = COURSE, **swing: float) -> dict[str, Any]:
    walls = WallAgreement(course)
    for number in range(60):
        walls.add(_trace(number, **swing))
    found = walls.as_dict()
    assert found is not None
    return found


def test_walls_that_differ_by_their_errors_alone_have_a_square_of_one() -> None:
    found = _agreement()
    assert found["chi_squared_per_sample"] == pytest.approx(1.0, abs=0.05)
    assert found["correlation"] > 0.95
    assert found["share_beyond_5_sigma"] == 0
    # three places, weighted 1, −2 and 1, of two walls, over 50 µm, at the groove's speed
    expected = 100 * np.sqrt(2 * 6) * SIGMA_M / 50e-6 * float(COURSE.rotation.speed_at_m_s(0.0))
    assert found["expected_difference_cm_s"] == pytest.approx(expected, rel=1e-3)
    assert found["rms_difference_cm_s"] == pytest.approx(expected, rel=0.03)


def test_errors_that_are_claimed_too_small_and_motion_across_the_cut_are_seen() -> None:
    assert _agreement(sigma_m=2 * SIGMA_M)["chi_squared_per_sample"] == pytest.approx(4.0, abs=0.2)
    assert _agreement(vertical=1e-6)["chi_squared_per_sample"] > 3
    across = _agreement(lateral=0.0, vertical=1e-6)
    assert across["correlation"] < -0.95
    assert across["samples"] == 60 * 128


def test_the_walls_of_a_vertical_cut_agree_when_they_move_apart() -> None:
    found = _agreement(replace(COURSE, direction="vertical"), lateral=0.0, vertical=1e-6)
    assert found["correlation"] > 0.95
    assert found["chi_squared_per_sample"] == pytest.approx(1.0, abs=0.05)


def test_a_wall_that_was_not_seen_is_not_compared() -> None:
    trace = _trace(1)
    flags = trace.flags.copy()
    flags[OUTER, 50:] = FILLED
    offset = trace.offset_m.copy()
    offset[OUTER, 50:] = 1.0
    walls = WallAgreement(COURSE)
    walls.add(replace(trace, offset_m=offset, flags=flags))
    found = walls.as_dict()
    assert found is not None
    assert found["samples"] == 50 - 32
    blind = WallAgreement(COURSE)
    blind.add(replace(trace, offset_m=np.full((2, 160), np.nan)))
    assert blind.as_dict() is None


def test_the_worst_groups_are_those_of_which_least_was_read_and_then_the_most_doubtful() -> None:
    worst = WorstGroups()
    for number in range(30):
        trace = _trace(number)
        offset, sigma = trace.offset_m.copy(), trace.offset_sigma_m.copy()
        if number in (4, 17):
            offset[:, : 10 * number] = np.nan
        if number == 9:
            sigma *= 3
        worst.add(replace(trace, offset_m=offset, offset_sigma_m=sigma))
    found = worst.worst_first()
    assert [group.number for group in found[:3]] == [17, 4, 9]
    assert len(found) == KEPT
    assert found[1].unread == pytest.approx(0.25)
    assert found[2].sigma_m == pytest.approx(3 * SIGMA_M)


def _meter(cut: Any = "lateral", samples: float = 9600) -> QualityMeter:
    return QualityMeter(COURSE, cut, rate_hz=RATE_HZ, passband=0.91, samples=samples)


def test_signal_to_noise_by_band_is_that_of_the_sound_and_of_the_error_bars() -> None:
    rng = np.random.default_rng(5)
    meter, size = _meter(samples=96_000), 96_000
    # white in both: the ratio is the same in every band, and the model's power does not matter, only its shape
    sound = Audio(0, RATE_HZ, rng.normal(0, 0.03, size), np.full(size, 0.003), np.zeros(size, np.uint16))
    frequency = np.geomspace(5.0, 160_000.0, 200)
    density = np.where(frequency < 48_000, 1.0, 1e-12)
    nothing = np.zeros(4)
    motion = GrooveMotion(
        0.0, 1e-6, nothing, nothing, nothing, nothing, nothing.astype(np.uint16),
        ErrorSpectrum(frequency, np.stack([density, np.full(200, np.nan)]), 4),
    )  # fmt: skip
    assert list(meter.followed([motion])) == [motion]
    meter.heard(sound)
    found = meter.as_dict()["spectrum"]
    octaves = found["octaves"]
    np.testing.assert_allclose(octaves["signal_to_noise_db"][2:], 20.0, atol=0.7)
    assert np.sqrt(np.nansum(octaves["error_rms_cm_s"] ** 2)) < 0.3
    assert found["usable_to_hz"]["0_db"] == pytest.approx(35_481, rel=1e-3)
    assert np.isnan(found["usable_to_hz"]["10_db"]) or found["usable_to_hz"]["10_db"] == found["usable_to_hz"]["0_db"]
    power = float(np.sum(np.diff(frequency) * (density[1:] + density[:-1]) / 2))
    assert found["error_bars_over_model"] == pytest.approx(0.003**2 / power)


def test_the_walls_of_a_stereo_record_are_not_compared_and_nothing_known_is_said_so() -> None:
    meter = _meter("stereo")
    meter.picked_up(_trace(3))
    found = meter.as_dict()
    assert found["wall_agreement"] is None
    assert np.isnan(found["spectrum"]["error_bars_over_model"])
    assert np.isnan(found["spectrum"]["usable_to_hz"]["0_db"])
    assert found["worst_groups"][0]["group"] == 3
    assert found["worst_groups"][0]["at_s"] == pytest.approx(480 * STEP_M / 0.9393, rel=1e-3)


@pytest.mark.parametrize(
    ("found", "verdict"), [(0.81, "as stated"), (0.75, "near: look at it"), (0.4, "not as stated: check the manifest")]
)
def test_what_was_found_is_held_against_the_manifest(film: Any, found: float, verdict: str) -> None:
    seen = {"frame_step": {"measured_mean_um": found}, "wall_angle_deg": {"inner": float("nan"), "outer": 45.2}}
    step, angle = calibration_check(film.scene.bench, {}, seen)
    assert (step["what"], step["unit"], step["verdict"]) == ("step from frame to frame", "µm", verdict)
    assert step["difference_percent"] == pytest.approx(100 * (found / 0.8 - 1))
    assert angle["manifest"] == pytest.approx(45.0)


@pytest.mark.parametrize("name", ["riaa", "flat", "columbia-78"])
def test_the_response_is_the_curve_and_the_filter(name: str) -> None:
    found = response_of(name, rate_hz=RATE_HZ)
    assert found["largest_deviation_db"] < 0.02
    near = int(np.argmin(np.abs(found["frequency_hz"] - 1000)))
    assert found["curve_db"][near] == pytest.approx(0.0, abs=0.15)
    assert (found["frequency_hz"][0], found["frequency_hz"][-1]) == pytest.approx((20.0, 20_000.0))
    # IEC 60098: +19.27 dB at 20 Hz, −19.62 dB at 20 kHz
    if name == "riaa":
        assert found["filter_db"][[0, -1]] == pytest.approx([19.27, -19.62], abs=0.02)
