"""The orientation of a wall: closed forms, efficiency, robustness, and whether its error bars are true."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares

from gramoscope.errors import ArgumentError
from gramoscope.pickup.wall import SCALE_FLOOR_PX, WallOrientation, correlation_length_px, fit_planes

COLUMNS = np.arange(173)
STATION = np.array([83.0])


def _wall(slope: float = 0.037, *, noise: float = 0.0, rng: np.random.Generator | None = None) -> np.ndarray:
    """The centroid lines of two depths."""
    rows = np.array([[211.3], [307.0]]) + slope * (COLUMNS - 83)
    return rows + noise * rng.normal(size=rows.shape) if rng is not None else rows


def _fit(rows: np.ndarray, measured: np.ndarray | None = None, **settings: float):
    measured = np.ones(rows.shape, bool) if measured is None else measured
    return fit_planes(rows, measured, STATION, **({"neighbourhood_px": 100.0, "least_points": 30} | settings))


@pytest.mark.parametrize("depths", [[0], [1], [0, 1]])
def test_exact_lines_give_the_exact_slope_from_one_depth_or_two(depths: list[int]) -> None:
    measured = np.zeros((2, 173), bool)
    measured[depths] = True
    planes = _fit(_wall(), measured)
    assert planes.slope[0] == pytest.approx(0.037, abs=1e-12)
    expected = np.full(2, np.nan)
    expected[depths] = np.array([211.3, 307.0])[depths]
    np.testing.assert_allclose(planes.row[:, 0], expected, atol=1e-9)
    assert planes.points[0] == len(depths) * 101
    assert planes.scatter_px[0] == SCALE_FLOOR_PX


def test_without_outliers_the_fit_is_nearly_as_efficient_as_least_squares() -> None:
    rng = np.random.default_rng(1)
    error = []
    for _ in range(400):
        rows = _wall(noise=1.0, rng=rng)
        x, y = COLUMNS[33:134] - 83.0, rows[:, 33:134]
        ordinary = least_squares(lambda p, x=x, y=y: (y - p[1:, None] - p[0] * x).ravel(), [0.0, 211.0, 307.0]).x[0]
        error.append([ordinary - 0.037, _fit(rows).slope[0] - 0.037])
    variance = np.mean(np.square(error), axis=0)
    assert variance[0] / variance[1] > 0.9
    assert variance[0] == pytest.approx(1 / (2 * ((COLUMNS[33:134] - 83.0) ** 2).sum()), rel=0.2)


def _scattered(rng: np.random.Generator) -> np.ndarray:
    """Dust: two fifths of the points lie anywhere, on either side."""
    return np.where(rng.random((2, 173)) < 0.4, rng.uniform(-60, 60, (2, 173)), 0.0)


def _chipped(rng: np.random.Generator) -> np.ndarray:
    """A chip: in three tenths of the columns both lines run along its rim."""
    into = COLUMNS - rng.integers(33, 104)
    return np.broadcast_to(((into >= 0) & (into < 30)) * (15 + 0.2 * into), (2, 173))


@pytest.mark.parametrize("damage", [_scattered, _chipped])
def test_gross_errors_in_many_points_hardly_move_the_slope(
    damage: Callable[[np.random.Generator], np.ndarray],
) -> None:
    rng = np.random.default_rng(2)
    sigma = 1 / np.sqrt(2 * ((COLUMNS[33:134] - 83.0) ** 2).sum())
    error, ordinary = [], []
    for _ in range(200):
        rows = _wall(noise=1.0, rng=rng) + damage(rng)
        error.append(_fit(rows).slope[0] - 0.037)
        ordinary.append(np.polyfit(COLUMNS[33:134], rows[:, 33:134].mean(axis=0), 1)[0] - 0.037)
    assert np.abs(error).max() < 8 * sigma
    assert np.std(error) < 3 * sigma
    assert np.std(ordinary) > 10 * sigma


def test_the_standard_error_of_the_slope_is_true() -> None:
    rng = np.random.default_rng(3)
    z = []
    for _ in range(900):
        measured = rng.random((2, 173)) < [[0.9], [0.6]]
        planes = _fit(_wall(noise=1.7, rng=rng), measured)
        z.append((planes.slope[0] - 0.037) / planes.slope_sigma[0])
    assert 0.9 < np.std(z) < 1.1
    assert abs(np.mean(z)) < 0.12


def test_the_standard_error_scales_with_the_noise_and_with_the_neighbourhood() -> None:
    rng = np.random.default_rng(4)
    rows = _wall(noise=1.0, rng=rng)
    exact = _wall()
    one, three = (_fit(exact + factor * (rows - exact)).slope_sigma[0] for factor in (1, 3))
    assert three == pytest.approx(3 * one, rel=1e-6)
    assert _fit(rows, neighbourhood_px=50.0).slope_sigma[0] == pytest.approx(2**1.5 * one, rel=0.25)


def test_values_that_were_not_measured_are_not_looked_at() -> None:
    rng = np.random.default_rng(5)
    rows, measured = _wall(noise=1.0, rng=rng), rng.random((2, 173)) < 0.7
    spoilt = np.where(measured, rows, np.nan)
    np.testing.assert_array_equal(_fit(spoilt, measured).slope, _fit(rows, measured).slope)


def test_too_few_points_give_no_slope() -> None:
    measured = np.zeros((2, 173), bool)
    measured[0, 40:69] = True
    planes = _fit(_wall(), measured)
    assert np.isnan([planes.slope[0], planes.slope_sigma[0], planes.scatter_px[0]]).all()
    assert planes.points[0] == 29
    measured[0, 69] = True
    assert _fit(_wall(), measured).slope[0] == pytest.approx(0.037)


def test_a_groove_moved_in_the_picture_has_the_same_slope() -> None:
    rows = _wall(noise=1.0, rng=np.random.default_rng(6))
    here, there = _fit(rows), _fit(rows + 41.25)
    np.testing.assert_allclose(there.slope, here.slope, atol=1e-12)
    np.testing.assert_allclose(there.row, here.row + 41.25)


def test_stations_near_the_ends_use_the_half_of_the_neighbourhood_that_exists() -> None:
    planes = fit_planes(
        _wall(), np.ones((2, 173), bool), np.array([0.0, 172.0]), neighbourhood_px=100.0, least_points=30
    )
    np.testing.assert_allclose(planes.slope, 0.037)
    np.testing.assert_array_equal(planes.points, 102)


def _moving_average(length: int, rng: np.random.Generator) -> np.ndarray:
    kernel = np.ones(length) / np.sqrt(length)
    return np.array([np.convolve(rng.normal(size=20_000 + length - 1), kernel, "valid") for _ in range(2)])


@pytest.mark.parametrize("length", [1, 3, 6])
def test_a_moving_average_of_noise_has_the_correlation_length_of_its_window(length: int) -> None:
    residual = _moving_average(length, np.random.default_rng(7))
    # 1 + 2 Σ (1 − k/n) = n
    assert correlation_length_px(residual) == pytest.approx(length, rel=0.08)


def test_an_autoregression_has_the_correlation_length_of_its_coefficient() -> None:
    rng, a = np.random.default_rng(8), 0.6
    residual = np.zeros((2, 30_000))
    for k in range(1, 30_000):
        residual[:, k] = a * residual[:, k - 1] + rng.normal(size=2)
    # 1 + 2 Σ a^k = (1 + a)/(1 − a)
    assert correlation_length_px(residual) == pytest.approx(4.0, rel=0.08)
    holes = np.where(rng.random(residual.shape) < 0.3, np.nan, residual)
    assert correlation_length_px(holes) == pytest.approx(4.0, rel=0.1)


def test_residuals_without_points_have_no_correlation() -> None:
    assert correlation_length_px(np.full((2, 40), np.nan)) == 1.0


def test_stations_are_a_stride_apart_and_errors_are_shared_by_half_a_neighbourhood() -> None:
    orientation = WallOrientation(neighbourhood_px=60.0, stride_px=8)
    np.testing.assert_array_equal(orientation.stations(33), [0, 8, 16, 24, 32])
    assert orientation.correlation_samples == 3.75
    for settings in ({"neighbourhood_px": 4.0}, {"stride_px": 0}, {"least_share": 0.0}):
        with pytest.raises(ArgumentError):
            WallOrientation(**settings)
