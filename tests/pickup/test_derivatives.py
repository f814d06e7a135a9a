"""Space-time derivatives, and the contrast by which they are scaled."""

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow.derivatives import FOUR_POINT, group_derivatives, texture_contrast
from gramoscope.pickup.flow.frame_derivatives import (
    first_differences,
    four_point_derivatives,
    frames_needed,
    gaussian_derivatives,
)
from gramoscope.pickup.registration import Canvas


def _canvas(mean: np.ndarray, trend: np.ndarray | None = None) -> Canvas:
    trend = np.zeros_like(mean) if trend is None else trend
    count = np.full(mean.shape[1], 2)
    return Canvas(mean.astype(np.float32), trend.astype(np.float32), count, np.zeros(2), np.arange(2))


def test_four_points_differentiate_polynomials_up_to_the_fourth_degree() -> None:
    nodes = np.arange(-2, 3).astype(float)
    for degree in range(5):
        assert FOUR_POINT @ nodes**degree == pytest.approx(1.0 if degree == 1 else 0.0, abs=1e-6)


def test_a_tilted_picture_has_its_tilt() -> None:
    row, column = np.mgrid[:13, :29]
    d = group_derivatives(_canvas(40 + 1.5 * column - 0.7 * row, 0.3 + 0.0 * row), smoothing_px=0.0)
    np.testing.assert_allclose(d.x[:, 2:-2], 1.5, atol=1e-4)
    np.testing.assert_allclose(d.y[2:-2], -0.7, atol=1e-4)
    np.testing.assert_allclose(d.t, 0.3, atol=1e-6)


def test_smoothing_is_that_of_a_gaussian_on_space_and_time_alike() -> None:
    column, omega, sigma = np.arange(90), 0.35, 1.4
    wave = np.broadcast_to(np.sin(omega * column), (31, 90))
    d = group_derivatives(_canvas(100 + 20 * wave, 3 * wave), smoothing_px=sigma)
    left, inner = np.exp(-((omega * sigma) ** 2) / 2), slice(10, -10)
    np.testing.assert_allclose(d.x[5, inner], 20 * left * omega * np.cos(omega * column[inner]), atol=0.03)
    np.testing.assert_allclose(d.t[5, inner], 3 * left * wave[5, inner], atol=0.01)


def test_contrast_is_that_of_the_sharpest_rows_whatever_the_height_of_the_picture() -> None:
    rng = np.random.default_rng(1)
    gradient = rng.normal(0, 0.5, (90, 640)).astype(np.float32)
    gradient[37:44] = rng.normal(0, 6.0, (7, 640))
    assert texture_contrast(gradient) == pytest.approx(6.0, rel=0.12)
    taller = np.concatenate([gradient, rng.normal(0, 0.5, (300, 640)).astype(np.float32)])
    assert texture_contrast(taller) == texture_contrast(gradient)


def test_a_scratch_does_not_decide_the_contrast() -> None:
    rng = np.random.default_rng(2)
    gradient = rng.normal(0, 0.5, (90, 640)).astype(np.float32)
    gradient[37:44] = rng.normal(0, 6.0, (7, 640))
    scratched = gradient.copy()
    scratched[:, 100:130] = 80.0
    assert texture_contrast(scratched) == pytest.approx(texture_contrast(gradient), rel=0.1)
    assert texture_contrast(np.zeros((20, 64), np.float32)) == 0


def test_first_differences_are_those_in_the_middle_of_the_cube() -> None:
    row, column = np.mgrid[3:16, 5:34].astype(float)
    first, second = (40 + 1.5 * column * row - 0.7 * row + 0.3 * t * column for t in (2, 3))
    d = first_differences(first, second)
    inner, y, x = (slice(None, -1),) * 2, row[:-1, :-1] + 0.5, column[:-1, :-1] + 0.5
    np.testing.assert_allclose(d.x[inner], 1.5 * y + 0.3 * 2.5, rtol=1e-5)
    np.testing.assert_allclose(d.y[inner], 1.5 * x - 0.7, rtol=1e-5)
    np.testing.assert_allclose(d.t[inner], 0.3 * x, rtol=1e-5)
    assert not np.any([a[-1].any() or a[:, -1].any() for a in (d.x, d.y, d.t)])


def test_first_differences_need_frames_of_one_shape() -> None:
    with pytest.raises(ArgumentError, match="same shape"):
        first_differences(np.zeros((7, 9)), np.zeros((9, 7)))


def _travelling_wave(frames: int, *, u: float, omega_x: float, omega_y: float) -> np.ndarray:
    t, row, column = np.meshgrid(np.arange(frames) - frames // 2, np.arange(41), np.arange(53), indexing="ij")
    return 120 + 60 * np.sin(omega_x * (column - u * t) + omega_y * row + 0.4)


def test_a_travelling_wave_has_the_derivatives_of_a_wave_smoothed_in_space_and_time() -> None:
    u, omega_x, omega_y, sigma = 0.6, 0.4, 0.25, 1.5
    d = gaussian_derivatives(_travelling_wave(15, u=u, omega_x=omega_x, omega_y=omega_y), sigma=sigma)
    row, column = np.mgrid[7:34, 7:46]
    left = np.exp(-(omega_x**2 + omega_y**2 + (u * omega_x) ** 2) * sigma**2 / 2)
    slope = 60 * left * np.cos(omega_x * column + omega_y * row + 0.4)
    inner = slice(7, -7), slice(7, -7)
    for found, expected in ((d.x, omega_x), (d.y, omega_y), (d.t, -u * omega_x)):
        np.testing.assert_allclose(found[inner], expected * slope, atol=0.002 * 60)


def test_where_the_kernels_reach_beyond_the_picture_derivatives_are_zero() -> None:
    d = gaussian_derivatives(_travelling_wave(15, u=0.6, omega_x=0.4, omega_y=0.25), sigma=1.5)
    for a in (d.x, d.y, d.t):
        assert not a[:7].any()
        assert not a[-7:].any()
        assert not a[:, :7].any()
        assert not a[:, -7:].any()
        assert np.all(a[7:-7, 7:-7] != 0)


def test_more_frames_than_the_kernels_reach_change_nothing_and_fewer_are_refused() -> None:
    assert frames_needed(1.5) == 15
    film = _travelling_wave(19, u=0.6, omega_x=0.4, omega_y=0.25)
    a, b = gaussian_derivatives(film, sigma=1.5), gaussian_derivatives(film[2:-2], sigma=1.5)
    np.testing.assert_array_equal(a.t, b.t)
    with pytest.raises(ArgumentError, match="at least 15"):
        gaussian_derivatives(film[:13], sigma=1.5)
    with pytest.raises(ArgumentError, match="odd"):
        gaussian_derivatives(film[:16], sigma=1.5)


def test_four_points_in_space_and_time_are_exact_on_a_tilted_film() -> None:
    t, row, column = np.meshgrid(np.arange(7), np.arange(17), np.arange(23), indexing="ij")
    d = four_point_derivatives(10 + 1.5 * column - 0.7 * row + 0.2 * t + 0.01 * t**4.0, border_px=3)
    np.testing.assert_allclose(d.x[3:-3, 3:-3], 1.5, rtol=1e-5)
    np.testing.assert_allclose(d.y[3:-3, 3:-3], -0.7, rtol=1e-5)
    np.testing.assert_allclose(d.t[3:-3, 3:-3], 0.2 + 0.04 * 27, rtol=1e-5)
