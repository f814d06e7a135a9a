"""From planes to samples: flags, error bars, and what stands in where nothing was seen."""

import numpy as np
import pytest

from gramoscope.pickup.wall import fit_planes
from gramoscope.pickup.wall_samples import UNSEEN_SLOPE_SIGMA, WallSamples, samples_of_wall
from gramoscope.quality import Quality

STATIONS = np.arange(0.0, 401.0, 20.0)
COLUMNS = np.arange(401)
EXPECTED_ROW = np.array([214.0, 310.0])


def _samples(
    measured: np.ndarray, *, length: int = 1, line_slope: np.ndarray | None = None, seed: int = 1
) -> WallSamples:
    rng = np.random.default_rng(seed)
    noise = [np.convolve(rng.normal(size=400 + length), np.ones(length) / np.sqrt(length), "valid") for _ in range(2)]
    rows = EXPECTED_ROW[:, None] + 5.0 + 0.02 * COLUMNS + np.array(noise)
    planes = fit_planes(rows, measured, STATIONS, neighbourhood_px=100.0, least_points=30)
    line = np.full(STATIONS.size, 0.05) if line_slope is None else line_slope
    return samples_of_wall(planes, rows, measured, STATIONS, line_slope=line, expected_row=EXPECTED_ROW)


def test_a_wall_seen_everywhere_has_no_flags_and_its_own_slope_and_place() -> None:
    samples = _samples(np.ones((2, 401), bool))
    assert not samples.flags.any()
    assert (np.abs(samples.slope - 0.02) < 5 * samples.slope_sigma).all()
    # the place is that of the middle between the two stripes
    error = samples.row_px - (262.0 + 5.0 + 0.02 * STATIONS)
    assert (np.abs(error) < 5 * samples.row_sigma_px).all()


def test_where_too_few_columns_were_measured_the_line_stands_in_and_says_so() -> None:
    measured = np.ones((2, 401), bool)
    measured[:, 130:300] = False
    samples = _samples(measured)
    gap = slice(10, 12)
    np.testing.assert_array_equal(samples.flags[gap], Quality.SPARSE | Quality.INTERPOLATED)
    np.testing.assert_array_equal(samples.slope[gap], 0.05)
    np.testing.assert_allclose(samples.slope_sigma[gap], np.hypot(UNSEEN_SLOPE_SIGMA, 0.05))
    assert not samples.flags[[0, 5, -1]].any()


def test_where_there_is_no_line_either_there_is_nothing() -> None:
    samples = _samples(np.zeros((2, 401), bool), line_slope=np.full(STATIONS.size, np.nan))
    np.testing.assert_array_equal(samples.flags, Quality.NO_STRIPE | Quality.INTERPOLATED)
    for values in (samples.slope, samples.slope_sigma, samples.row_px, samples.row_sigma_px):
        assert np.isnan(values).all()


@pytest.mark.parametrize("length", [1, 4])
def test_error_bars_are_true_whether_columns_err_together_or_alone(length: int) -> None:
    measured = np.ones((2, 401), bool)
    z = []
    for seed in range(60):
        samples = _samples(measured, length=length, seed=seed)
        # every fifth station: their neighbourhoods do not overlap
        z.append((samples.slope[3:-3:5] - 0.02) / samples.slope_sigma[3:-3:5])
    assert 0.8 < np.std(z) < 1.2


def test_a_place_seen_at_one_depth_alone_is_the_same_place() -> None:
    measured = np.ones((2, 401), bool)
    both = _samples(measured)
    measured[1] = False
    one = _samples(measured)
    np.testing.assert_allclose(one.row_px, both.row_px, atol=1.0)
    assert (one.slope_sigma > both.slope_sigma).all()
