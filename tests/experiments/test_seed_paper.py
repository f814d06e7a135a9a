"""The pure computations behind the pages of the seed paper give what the pages say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.seed_paper import hough, in_focus, kalman, make, optics, orientation, sound, wall_trials
from experiments.seed_paper.page import Claim, Page
from experiments.seed_paper.take import NOISE_RATE_HZ, film_in_memory, noise_sound, short_bench
from gramoscope.camera.noise import SensorNoise
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.simulation.scene import Scene, filming_bench


def test_the_rig_in_numbers_is_what_the_paper_prints() -> None:
    n = optics.numbers()
    assert n.object_distance_m == pytest.approx(4e-3)
    assert n.focal_length_m == pytest.approx(3.902e-3, abs=1e-6)
    assert n.shift_m == pytest.approx(37.39e-6, abs=0.01e-6)
    assert n.shift_at_limit_m == pytest.approx(40.67e-6, abs=0.01e-6)
    assert n.separation_px == pytest.approx(95.7, abs=0.05)
    assert n.groove_speed_m_s == pytest.approx(0.93934, abs=5e-6)
    assert n.pixel_rate_hz == pytest.approx(2404.71e3, abs=20)
    assert n.seconds == pytest.approx(3.19, abs=0.005)


def test_the_mean_shift_lies_between_that_of_the_axis_and_that_of_the_rim() -> None:
    n = optics.numbers()
    assert n.shift_m < n.shift_mean_m < n.shift_at_rim_m
    assert n.shift_mean_m > (n.shift_m + n.shift_at_limit_m) / 2


def test_every_claim_of_the_optics_has_an_answer() -> None:
    claims = optics.claims(optics.numbers())
    assert len(claims) > 15
    assert all(claim.place and claim.claim and claim.ours for claim in claims)


def test_flow_that_is_exact_has_no_error_and_flow_that_is_not_has_the_angle_between_them() -> None:
    sharp = np.array([[True, True, False], [True, False, False]])
    exact = Flow(np.full((2, 3), -2.0, np.float32), np.zeros((2, 3), np.float32))
    assert in_focus.flow_error(exact, -2.0, sharp).angle_deg == pytest.approx(0, abs=1e-5)
    still = Flow(np.zeros((2, 3), np.float32), np.zeros((2, 3), np.float32))
    error = in_focus.flow_error(still, -1.0, sharp)
    assert error.angle_deg == pytest.approx(45)
    assert error.outside_end_point_px == pytest.approx(1)


def test_sharp_zones_follow_the_stripes() -> None:
    rows = np.array([[20.0, 30.0, 40.0], [80.0, 80.0, 80.0]])
    zones = in_focus.sharp_zones(rows, (100, 3))
    assert list(np.flatnonzero(zones[:, 0])) == [*range(12, 29), *range(72, 89)]
    assert zones[48, 2]
    assert not zones[28, 2]


def test_the_papers_search_takes_the_picture_in_one_piece_in_steps_of_one_degree() -> None:
    search = hough.straight_search()
    assert search.segments == 1
    assert np.allclose(np.rad2deg(search.theta_rad), np.arange(-45, 46))


def test_true_stripes_lie_where_a_film_shows_them() -> None:
    bench = short_bench(frames=1, groups=7, base=filming_bench(height_px=544))
    scene = Scene(bench, noise=SensorNoise(1e9, 0.0), groove_middle_m=9e-6, seed=3)
    take = film_in_memory(noise_sound(low_hz=300, high_hz=900, seconds=0.05, seed=2), NOISE_RATE_HZ, scene, [6])
    image = take.groups[0].images[0].astype(float)
    sharpness = np.abs(np.diff(image[:, 200:320], axis=1)).mean(axis=1)
    rows = take.stripe_rows(take.groups[0], np.arange(200.0, 320.0)).mean(axis=1)
    for row in rows:
        near = np.arange(int(row) - 25, int(row) + 26)
        assert np.average(near, weights=sharpness[near] ** 4) == pytest.approx(row, abs=4)


def test_without_outliers_the_robust_estimator_is_nearly_as_good_as_least_squares() -> None:
    wall = wall_trials.walls(noise_px=1.0)
    robust, least = (wall_trials.rms_error(s) for s in (wall.robust_slopes(), wall.least_squares_slopes()))
    assert least == pytest.approx(wall_trials.bound(1.0, 100), rel=0.1)
    assert robust < 1.1 * least


@pytest.mark.parametrize("together", [False, True])
def test_with_a_third_of_the_centroids_wrong_the_robust_estimator_hardly_errs(together: bool) -> None:
    wall = wall_trials.walls(noise_px=1.0, outliers=0.33, together=together)
    clean = wall_trials.bound(1.0, 100)
    assert wall_trials.rms_error(wall.robust_slopes()) < 2.2 * clean
    assert wall_trials.rms_error(wall.least_squares_slopes()) > 10 * clean


def test_a_fitted_line_answers_a_tone_as_the_formula_says() -> None:
    time = (np.arange(4001) / 4000 - 0.5) * 40e-6
    for frequency_hz in (900.0, 13_000.0, 29_000.0):
        fitted = np.sum(time * np.sin(2 * np.pi * frequency_hz * time)) / np.sum(time**2) / (2 * np.pi * frequency_hz)
        assert orientation.least_squares_response(np.array([frequency_hz]), 40e-6)[0] == pytest.approx(fitted, abs=2e-3)


def test_a_hundred_pixels_pass_half_the_power_at_14_khz_and_nothing_at_34() -> None:
    lasts_s = 100 / optics.numbers().pixel_rate_hz
    assert orientation.frequency_of_gain_hz(1 / np.sqrt(2), lasts_s) == pytest.approx(13.9e3, rel=0.01)
    assert orientation.frequency_of_gain_hz(0.0, lasts_s) == pytest.approx(1.4303 / lasts_s, rel=1e-3)


def test_the_robust_estimator_answers_a_tone_like_least_squares() -> None:
    expected = orientation.least_squares_response(np.array([9000.0]), 100 / optics.numbers().pixel_rate_hz)[0]
    assert orientation.tone_response(9000.0, 100) == pytest.approx(expected, abs=0.03)


def test_the_papers_correlations_are_below_zero_decibel() -> None:
    assert sound.snr_of_r_db(np.sqrt(0.5)) == pytest.approx(0)
    assert sound.snr_of_r_db(sound.PAPER_SONG_R) == pytest.approx(-3.4, abs=0.05)
    assert sound.snr_of_r_db(sound.PAPER_DAMAGED_R) == pytest.approx(-3.3, abs=0.05)


def test_noise_is_equally_loud_in_every_octave() -> None:
    samples = noise_sound(low_hz=200, high_hz=12_000, seconds=4.0, seed=1)
    power = np.abs(np.fft.rfft(samples)) ** 2
    f = np.fft.rfftfreq(samples.size, 1 / NOISE_RATE_HZ)
    octaves = [power[(f >= low) & (f < 2 * low)].sum() for low in (400.0, 800.0, 1600.0, 3200.0)]
    assert np.ptp(10 * np.log10(octaves)) < 1.0


def test_error_bars_and_errors_of_a_sound_are_told_apart() -> None:
    arc = np.arange(2000) * 4e-6
    true = np.sin(arc / 1e-4)
    off = np.random.default_rng(4).normal(scale=0.1, size=2000)
    heard = kalman.Sound(arc, true + off, np.full(2000, 0.2), true, np.ones(2000, bool))
    assert heard.real == pytest.approx(0.1, rel=0.1)
    assert heard.claimed == pytest.approx(0.2)
    assert heard.within_two_sigma > 0.99
    assert heard.signal_to_noise_db == pytest.approx(10 * np.log10(0.5 / 0.01), abs=0.5)


def test_a_page_that_lacks_a_library_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> object:
        raise ModuleNotFoundError(f"No module named 'cv2' in {name}")

    monkeypatch.setattr(make.importlib, "import_module", missing)
    page = make.make_page("flow", tmp_path)
    assert "cv2" in page.finding
    assert "cv2" in (tmp_path / "flow.md").read_text(encoding="utf-8")


def test_prose_is_joined_and_a_claim_without_a_difference_says_that_they_agree(tmp_path: Path) -> None:
    page = Page("trial", "A trial", folder=tmp_path)
    page.say("One line\n   and another.\n\n  A second paragraph.")
    page.claims([Claim("7", "0.39", "0.390625")])
    text = page.write().read_text(encoding="utf-8")
    assert "One line and another.\n\nA second paragraph." in text
    assert "| 7 | 0.39 | 0.390625 | they agree |" in text
