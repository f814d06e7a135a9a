"""Smoothing by running means is nearly smoothing by a Gaussian."""

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.pickup.texture.smoothing import blur, half_bell, half_widths, smooth, smooth_both

VALUES = np.cumsum(np.random.default_rng(2).normal(size=800)) + 3


def smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    out = np.empty_like(values)
    smooth(values, sigma, out)
    return out


@pytest.mark.parametrize("sigma", [2.6, 12.0, 17.3, 24.0, 200.0])
def test_three_running_means_are_nearly_a_gaussian(sigma: float) -> None:
    impulse = np.zeros(6001)
    impulse[3000] = 1.0
    answer = smoothed(impulse, sigma)
    place = np.arange(-3000, 3001)
    assert answer.sum() == pytest.approx(1.0)
    assert answer @ place == pytest.approx(0.0, abs=1e-9)
    variance = answer @ place**2
    assert variance == pytest.approx(sum(((2 * h + 1) ** 2 - 1) / 12 for h in half_widths(sigma)))
    assert np.sqrt(variance) == pytest.approx(sigma, rel=0.025, abs=0.2)
    bell = np.exp(-0.5 * place**2 / variance)
    assert np.abs(answer - bell / bell.sum()).max() < 0.075 / (np.sqrt(2 * np.pi) * sigma)


@pytest.mark.parametrize("sigma", [12.0, 200.0])
def test_beyond_the_ends_the_last_value_is_held(sigma: float) -> None:
    gaussian = ndimage.gaussian_filter1d(VALUES, sigma, mode="nearest")
    assert np.std(smoothed(VALUES, sigma) - gaussian) < 0.03 * np.std(VALUES)
    np.testing.assert_allclose(smoothed(np.full(50, 7.3), sigma), 7.3)
    np.testing.assert_allclose(smoothed(VALUES[::-1].copy(), sigma), smoothed(VALUES, sigma)[::-1], atol=1e-9)


def test_what_is_narrower_than_a_column_stays_as_it_is() -> None:
    np.testing.assert_allclose(smoothed(VALUES, 0.2), VALUES)


@pytest.mark.parametrize("sigma", [1.5, 3.0, 4.0])
@pytest.mark.parametrize("width", [5, 800])
def test_a_narrow_gaussian_is_the_gaussian(sigma: float, width: int) -> None:
    values, out = VALUES[:width], np.empty(width)
    blur(values, half_bell(sigma), values[0], values[-1], out)
    np.testing.assert_allclose(out, ndimage.gaussian_filter1d(values, sigma, mode="nearest"), rtol=1e-12)
    blur(values, half_bell(sigma), 0.0, 0.0, out)
    np.testing.assert_allclose(out, ndimage.gaussian_filter1d(values, sigma, mode="constant"), rtol=1e-12)


@pytest.mark.parametrize("width", [1, 7, 40, 500])
@pytest.mark.parametrize("sigma", [0.2, 3.0, 12.0, 200.0])
def test_two_rows_at_a_time_are_smoothed_as_each_by_itself(sigma: float, width: int) -> None:
    rows = np.random.default_rng(3).normal(size=(2, width))
    together, alone = np.empty((2, 2, width))
    smooth_both(rows[0], rows[1], sigma, together[0], together[1])
    for row, out in zip(rows, alone, strict=True):
        smooth(row, sigma, out)
    np.testing.assert_array_equal(together, alone)
