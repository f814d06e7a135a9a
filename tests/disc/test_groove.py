"""The groove's section against plane geometry."""

import numpy as np
import pytest

from gramoscope.conventions import rad
from gramoscope.disc.formats import Disc
from gramoscope.disc.groove import GrooveProfile, section
from gramoscope.errors import ArgumentError

UNEVEN = GrooveProfile(140e-6, inner_angle_rad=rad(47.0), outer_angle_rad=rad(42.0), bottom_radius_m=9e-6)


def test_the_walls_stand_at_their_angles_and_meet_the_land_at_the_edges() -> None:
    down_m = 13e-6
    inner_m, outer_m = 70e-6 - down_m / np.tan(rad(47.0)), -70e-6 + down_m / np.tan(rad(42.0))
    np.testing.assert_allclose(UNEVEN.height_m([inner_m, outer_m]), -down_m, rtol=1e-12)
    np.testing.assert_array_equal(UNEVEN.height_m([70.01e-6, -70.01e-6, 3e-4]), 0.0)


def test_the_bottom_is_round_and_passes_smoothly_into_both_walls() -> None:
    across_m = np.linspace(-60e-6, 55e-6, 40_001)
    step_m = across_m[1] - across_m[0]
    slope = np.diff(UNEVEN.height_m(across_m)) / step_m
    # the circle bends by 1/(r cos³φ) at most; a corner would turn by tan 42° + tan 47° at once
    assert np.abs(np.diff(slope)).max() < 1.01 * step_m / 9e-6 / np.cos(rad(47.0)) ** 3
    assert UNEVEN.height_m(across_m).min() == pytest.approx(-UNEVEN.depth_m, rel=1e-6)


def test_a_symmetric_bottom_lies_where_the_textbook_says() -> None:
    groove = GrooveProfile(150e-6, bottom_radius_m=12e-6)
    # the circle's centre is r/cos φ above the corner
    assert groove.depth_m == pytest.approx(75e-6 - 12e-6 * (np.sqrt(2) - 1), rel=1e-12)


def test_arc_length_grows_by_the_length_of_the_surface() -> None:
    across_m = np.linspace(-69e-6, 69e-6, 20_001)
    points = np.array([section(x, UNEVEN.shape) for x in across_m])
    walked_m = np.cumsum(np.hypot(np.diff(across_m), np.diff(points[:, 0])))
    np.testing.assert_allclose(points[1:, 2] - points[0, 2], walked_m, atol=1e-11)


def test_the_slope_is_the_derivative_of_the_height() -> None:
    across_m = np.linspace(-69e-6, 69e-6, 20_001)
    points = np.array([section(x, UNEVEN.shape) for x in across_m])
    np.testing.assert_allclose(np.gradient(points[:, 0], across_m)[1:-1], points[1:-1, 1], atol=2e-3)


def test_a_lift_moves_the_walls_and_leaves_the_land() -> None:
    across_m = np.array([-90e-6, -50e-6, 11e-6, 66e-6])
    lifted = UNEVEN.height_m(across_m, lift_m=7e-6)
    assert lifted[0] == 0
    assert lifted[3] == 0
    np.testing.assert_allclose(lifted[1:3], UNEVEN.height_m(across_m[1:3]) + 7e-6, rtol=1e-12)


def test_the_groove_of_a_disc_has_its_errors() -> None:
    groove = GrooveProfile.of_disc(Disc(wall_angle_rad=rad(44.0)), inner_error_rad=rad(1.5), outer_error_rad=rad(-2.0))
    assert (groove.inner_angle_rad, groove.outer_angle_rad) == pytest.approx((rad(45.5), rad(42.0)))


@pytest.mark.parametrize(
    "wrong", [{"width_m": 0.0}, {"inner_angle_rad": 1.6}, {"bottom_radius_m": -1e-6}, {"bottom_radius_m": 120e-6}]
)
def test_an_impossible_groove_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArgumentError):
        GrooveProfile(**wrong)
