"""From two walls to the two directions of movement."""

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER
from gramoscope.quality import Quality
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm.directions import observe

PHI = np.deg2rad(50.0)
LATERAL, VERTICAL = np.array([0.02, -0.05, 0.01]), np.array([0.03, 0.01, -0.04])


def _trace(slope: np.ndarray, sigma: np.ndarray | None = None, flags: np.ndarray | None = None) -> WallTrace:
    n = slope.shape[1]
    return WallTrace(
        number=4,
        arc_start_m=3e-3,
        arc_step_m=4e-6,
        offset_m=np.zeros((2, n)),
        offset_sigma_m=np.full((2, n), 1e-7),
        slope=slope,
        slope_sigma=np.full((2, n), 0.01) if sigma is None else sigma,
        correlation_samples=1.0,
        flags=np.zeros((2, n), np.uint16) if flags is None else flags,
    )


def _walls() -> np.ndarray:
    """The inner wall moves by a − h cot φ, the outer one by a + h cot φ."""
    slope = np.empty((2, 3))
    slope[INNER], slope[OUTER] = LATERAL - VERTICAL / np.tan(PHI), LATERAL + VERTICAL / np.tan(PHI)
    return slope


@pytest.mark.parametrize(("direction", "true"), [("lateral", LATERAL), ("vertical", VERTICAL)])
def test_both_walls_give_the_movement_exactly(direction: str, true: np.ndarray) -> None:
    seen = observe(_trace(_walls()), direction, wall_angle_rad=PHI)
    np.testing.assert_allclose(seen.slope, true, atol=1e-15)
    np.testing.assert_allclose(seen.arc_m, [3e-3, 3.004e-3, 3.008e-3])
    scale = np.tan(PHI) if direction == "vertical" else 1.0
    np.testing.assert_allclose(np.sqrt(seen.variance), 0.01 / np.sqrt(2) * scale)
    assert not seen.flags.any()


@pytest.mark.parametrize("wall", [INNER, OUTER])
def test_one_wall_alone_is_read_as_if_the_groove_moved_in_the_direction_of_the_cut_only(wall: int) -> None:
    sign = -1 if wall == INNER else 1
    slope = np.full((2, 3), np.nan)
    flags = np.zeros((2, 3), np.uint16)
    flags[1 - wall] = Quality.NO_STRIPE | Quality.INTERPOLATED
    slope[wall] = LATERAL
    seen = observe(_trace(slope, flags=flags), "lateral", wall_angle_rad=PHI)
    np.testing.assert_allclose(seen.slope, LATERAL)
    np.testing.assert_allclose(seen.variance, 1e-4)
    assert not seen.flags.any()
    slope[wall] = sign * VERTICAL / np.tan(PHI)
    seen = observe(_trace(slope, flags=flags), "vertical", wall_angle_rad=PHI)
    np.testing.assert_allclose(seen.slope, VERTICAL)
    np.testing.assert_allclose(seen.variance, 1e-4 * np.tan(PHI) ** 2)


def test_a_vertical_cut_takes_half_the_difference_however_sure_the_walls_are() -> None:
    sigma = np.array([[0.01] * 3, [0.03] * 3])
    seen = observe(_trace(_walls(), sigma), "vertical", wall_angle_rad=PHI)
    # anything else would let lateral movement through
    np.testing.assert_allclose(seen.slope, VERTICAL)
    np.testing.assert_allclose(seen.variance, (0.01**2 + 0.03**2) / 4 * np.tan(PHI) ** 2)


def test_the_surer_wall_weighs_more_in_a_lateral_cut() -> None:
    sigma = np.array([[0.01] * 3, [0.03] * 3])
    slope = np.array([[0.01] * 3, [0.02] * 3])
    seen = observe(_trace(slope, sigma), "lateral", wall_angle_rad=PHI)
    np.testing.assert_allclose(seen.slope, (0.01 * 9 + 0.02) / 10)
    np.testing.assert_allclose(1 / seen.variance, 1e4 + 1e4 / 9)


def test_a_measured_wall_wins_over_one_that_was_filled_in() -> None:
    flags = np.zeros((2, 3), np.uint16)
    flags[OUTER, 1] = Quality.SPARSE | Quality.INTERPOLATED
    flags[:, 2] = Quality.SPARSE | Quality.INTERPOLATED
    seen = observe(_trace(_walls(), flags=flags), "lateral", wall_angle_rad=PHI)
    np.testing.assert_allclose(seen.slope[[0, 2]], LATERAL[[0, 2]])
    assert seen.slope[1] == _walls()[INNER, 1]
    assert seen.flags.tolist() == [0, 0, Quality.SPARSE | Quality.INTERPOLATED]


def test_nothing_seen_is_nan_with_all_the_reasons() -> None:
    flags = np.array([[Quality.NO_STRIPE | Quality.INTERPOLATED] * 3, [Quality.DARK | Quality.INTERPOLATED] * 3])
    seen = observe(_trace(np.full((2, 3), np.nan), flags=flags.astype(np.uint16)), "vertical", wall_angle_rad=PHI)
    assert np.isnan(seen.slope).all()
    assert np.isnan(seen.variance).all()
    np.testing.assert_array_equal(seen.flags, Quality.NO_STRIPE | Quality.DARK | Quality.INTERPOLATED)


def test_thinning_keeps_every_so_manieth() -> None:
    seen = observe(_trace(_walls()), "lateral", wall_angle_rad=PHI).thinned(2)
    np.testing.assert_allclose(seen.arc_m, [3e-3, 3.008e-3])
    np.testing.assert_allclose(seen.slope, LATERAL[::2])
