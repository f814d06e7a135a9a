"""How far a flow is from the true one."""

import numpy as np
import pytest

from gramoscope.pickup.flow.flow_error import angular_error_rad, end_point_error_px
from gramoscope.pickup.flow.horn_schunck import Flow


def _flow(u: float, v: float) -> Flow:
    return Flow(np.full((3, 5), u, np.float32), np.full((3, 5), v, np.float32))


def test_the_angle_between_rest_and_one_pixel_a_frame_is_45_degrees() -> None:
    np.testing.assert_allclose(angular_error_rad(_flow(1.0, 0.0), _flow(0.0, 0.0)), np.pi / 4)
    np.testing.assert_allclose(angular_error_rad(_flow(0.0, 0.0), _flow(0.0, -1.0)), np.pi / 4)


def test_the_angle_is_that_of_the_arc_cosine_in_the_definition() -> None:
    u, v, u0, v0 = 1.25, -0.5, -2.5, 0.75
    cosine = (u * u0 + v * v0 + 1) / np.sqrt((u**2 + v**2 + 1) * (u0**2 + v0**2 + 1))
    np.testing.assert_allclose(angular_error_rad(_flow(u, v), _flow(u0, v0)), np.arccos(cosine), rtol=1e-12)


def test_small_angles_keep_their_digits() -> None:
    step = 2.0**-20
    found = angular_error_rad(_flow(2.0 + step, 0.0), _flow(2.0, 0.0))
    np.testing.assert_allclose(found, step / 5, rtol=1e-5)


def test_opposite_flows_are_nearly_a_half_turn_apart_when_fast() -> None:
    assert angular_error_rad(_flow(1e3, 0.0), _flow(-1e3, 0.0)).max() == pytest.approx(np.pi, abs=0.003)


def test_the_end_point_error_is_a_distance() -> None:
    np.testing.assert_allclose(end_point_error_px(_flow(3.5, 1.0), _flow(0.5, -3.0)), 5.0)


def test_nan_stays_where_it_is() -> None:
    found = _flow(1.0, 2.0)
    found.u[1, 3] = np.nan
    for error in (angular_error_rad(found, _flow(1.0, 2.0)), end_point_error_px(found, _flow(1.0, 2.0))):
        assert np.isnan(error[1, 3])
        assert np.isnan(error).sum() == 1
