"""The Cramér–Rao bound of a scene: closed forms, invariance, and the spread of real scores."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.accuracy import bound
from benchmarks.accuracy.bound import PHYSICS, SharpStripe
from gramoscope.simulation.scene import filming_bench, named_scene

ROWS_PX = np.array([-2.3, -1.3, -0.3, 0.7, 1.7, 2.7])
F = 0.13


def told(stripe: SharpStripe, rows_px: np.ndarray = ROWS_PX, f: float = F) -> float:
    return bound.fisher_density(*bound.covariance(stripe, f, rows_px))


def test_the_scene_of_the_published_bound_is_read_with_fifty_decibels() -> None:
    information = bound.information(PHYSICS, reach_px=30)
    density = bound.place_density_m2_hz(3 * information, pixel_pitch_m=0.5e-3 / 1280, groove_speed_m_s=0.939336)
    assert information == pytest.approx(62, rel=0.02)
    assert bound.snr_db(0.03, bound.velocity_noise_m_s(density)) == pytest.approx(49.8, abs=0.4)


def test_more_rows_and_more_frequencies_tell_hardly_more() -> None:
    usual = bound.information(PHYSICS, reach_px=30, frequencies=24)
    assert bound.information(PHYSICS, reach_px=45, frequencies=24) == pytest.approx(usual, rel=0.06)
    assert bound.information(PHYSICS, reach_px=30, frequencies=40) == pytest.approx(usual, rel=0.01)


def test_the_derivative_is_that_of_the_covariance() -> None:
    step_px = 1e-4
    after, before = (bound.covariance(PHYSICS, F, ROWS_PX + d)[0] for d in (step_px, -step_px))
    _, derivative = bound.covariance(PHYSICS, F, ROWS_PX)
    assert derivative == pytest.approx((after - before) / (2 * step_px), abs=1e-5 * np.abs(derivative).max())


def test_the_sharp_row_has_the_contrast_it_was_given() -> None:
    node, weight = np.polynomial.legendre.leggauss(24)
    power = sum(
        w * (bound.covariance(PHYSICS, f, np.zeros(1))[0][0, 0] - PHYSICS.noise**2) / 2
        for f, w in zip((node + 1) / 4, weight, strict=True)
    )
    assert power == pytest.approx(PHYSICS.contrast**2, rel=1e-3)


def test_a_wall_that_is_equally_sharp_everywhere_tells_nothing() -> None:
    assert told(replace(PHYSICS, blur_per_row=0.0)) == pytest.approx(0, abs=1e-12)


def test_a_lone_row_in_focus_tells_nothing_and_beside_the_focus_half_the_square_of_its_relative_change() -> None:
    silent = replace(PHYSICS, noise=1e-6)
    assert told(silent, np.array([0.0])) == pytest.approx(0, abs=1e-12)
    row_px, step_px = 3.7, 1e-4
    after, before = (np.log(bound.covariance(silent, F, np.array([row_px + d]))[0][0, 0]) for d in (step_px, -step_px))
    assert told(silent, np.array([row_px])) == pytest.approx(0.5 * ((after - before) / (2 * step_px)) ** 2, rel=1e-5)


def test_a_lone_row_without_noise_tells_as_much_at_any_contrast_and_noise_takes_the_fourth_power() -> None:
    row = np.array([3.7])
    strong = replace(PHYSICS, contrast=1e4)
    assert told(replace(strong, contrast=2e4), row) == pytest.approx(told(strong, row), rel=1e-3)
    weak = replace(PHYSICS, contrast=1e-3)
    assert told(replace(weak, contrast=2e-3), row) == pytest.approx(16 * told(weak, row), rel=1e-3)


def test_only_the_ratio_of_contrast_to_noise_counts() -> None:
    twice = replace(PHYSICS, contrast=2 * PHYSICS.contrast, noise=2 * PHYSICS.noise)
    assert told(twice) == pytest.approx(told(PHYSICS), rel=1e-9)


def test_a_mirrored_stripe_tells_as_much() -> None:
    assert told(PHYSICS, -ROWS_PX[::-1]) == pytest.approx(told(PHYSICS), rel=1e-9)


def test_rows_seen_with_more_frames_tell_more_but_never_more_than_the_square_of_their_number() -> None:
    one, four = (told(replace(PHYSICS, noise=2.5 / np.sqrt(frames))) for frames in (1, 4))
    assert one < four <= 16 * one


def test_real_scores_spread_as_the_information_says() -> None:
    # rows of a picture at one frequency are complex Gaussian; a score is the slope of their log-likelihood at the truth,
    # found by moving the stripe and not by any formula for the information
    rng = np.random.default_rng(11)
    step_px = 0.01
    C = bound.covariance(PHYSICS, F, ROWS_PX)[0]
    shape = (20_000, len(ROWS_PX))
    x = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2) @ np.linalg.cholesky(C).T
    likelihoods = []
    for d in (step_px, -step_px):
        moved = bound.covariance(PHYSICS, F, ROWS_PX + d)[0]
        fit = np.sum(x.conj() * np.linalg.solve(moved, x.T).T, axis=1).real
        likelihoods.append(-np.linalg.slogdet(moved)[1] - fit)
    score = (likelihoods[0] - likelihoods[1]) / (2 * step_px)
    # a complex number holds two real ones, so that its information is twice the density of one sign of f
    assert abs(score.mean()) < 4 * score.std() / np.sqrt(shape[0])
    assert score.var() == pytest.approx(2 * told(PHYSICS), rel=0.05)


def test_a_picture_drawn_row_by_row_from_blurred_texture_has_the_covariance() -> None:
    # white light on a fine periodic grid, filtered in two dimensions row by row as each row is blurred
    rng = np.random.default_rng(5)
    stripe = replace(PHYSICS, contrast=1.0, noise=0.0)
    rows, columns, high = np.array([-3, 0, 2, 6]), 32, 96
    f = np.fft.fftfreq(columns)[None, :]
    k = np.fft.fftfreq(high)[:, None]
    sigma = stripe.grain_px / np.sqrt(8 * np.log(2))
    grains = np.exp(-2 * (np.pi * sigma) ** 2 * (f**2 + k**2))
    found = np.zeros((len(rows), len(rows)))
    for _ in range(3000):
        light = np.fft.fft2(rng.standard_normal((high, columns))) * grains
        lines = []
        for row in rows:
            radius = np.hypot(stripe.blur_per_row * row, stripe.floor_px)
            blurred = light * bound.disc_mtf(2 * np.pi * radius * np.hypot(f, k))
            lines.append(np.fft.ifft2(blurred)[row % high])
        spectrum = np.fft.fft(np.array(lines), axis=1)[:, 4]
        found += np.outer(spectrum, spectrum.conj()).real
    C, _ = bound.covariance(stripe, 4 / columns, rows.astype(float))
    assert found / found[1, 1] == pytest.approx(C / C[1, 1], abs=0.06)


def test_soft_edges_let_a_fifth_less_noise_through_than_sharp_ones() -> None:
    sharp, soft = bound.velocity_noise_m_s(1e-20), bound.velocity_noise_compared_m_s(1e-20)
    assert (soft / sharp) ** 2 == pytest.approx(0.797, abs=0.005)


def test_a_scene_in_half_the_light_of_one_frame_or_at_the_inner_radius_can_be_read_less_well() -> None:
    scene = named_scene(filming_bench())
    usual = bound.scene_density_m2_hz(scene, reach_px=12)
    dim = replace(scene, rig=replace(scene.rig, dim=0.5))
    bench = scene.bench
    few = replace(scene, bench=replace(bench, sequence=replace(bench.sequence, frames_per_group=1)))
    inner = replace(scene, bench=replace(bench, rotation=replace(bench.rotation, radius_m=0.055)))
    assert bound.scene_density_m2_hz(dim, reach_px=12) > 1.3 * usual
    assert bound.scene_density_m2_hz(few, reach_px=12) > 3 * usual
    assert bound.scene_density_m2_hz(inner, reach_px=12) == pytest.approx(usual * 115 / 55, rel=1e-9)
