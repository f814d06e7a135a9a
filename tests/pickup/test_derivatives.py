"""Space-time derivatives, and the contrast by which they are scaled."""

import numpy as np
import pytest

from gramoscope.pickup.flow.derivatives import FOUR_POINT, group_derivatives, texture_contrast
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
