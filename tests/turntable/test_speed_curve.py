"""Speeds over time, against numerical integration and each other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from gramoscope.errors import ArgumentError
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import DriftingRotation, SpeedCurve

CURVE = SpeedCurve((-1.5, 3.0, 4.0, 11.0), (81.0, 78.26, 79.9, 71.0))
SPIRAL = Rotation(rpm=78.0, radius_m=0.0931, pitch_m=254e-6)
DRIFT = DriftingRotation.following(CURVE, SPIRAL)


def omega_rad_s(time_s):
    return np.interp(time_s, CURVE.time_s, CURVE.rpm) * 2 * np.pi / 60


def test_the_groove_under_a_drifting_table_is_the_one_that_integration_draws():
    """dφ/dt = ω(t), ds/dt = ω r, dr/dt = −p ω/2π; ignoring the curve would be wrong by 4 %."""
    seconds = np.linspace(0.2, 17.0, 19)
    drawn = solve_ivp(
        lambda t, y: omega_rad_s(t) * np.array([1.0, y[2], -SPIRAL.pitch_m / (2 * np.pi)]),
        (0, 17.0),
        [0.0, 0.0, SPIRAL.radius_m],
        t_eval=seconds,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.05,
    )
    angle, arc, radius = drawn.y
    np.testing.assert_allclose(DRIFT.angle_of_time_rad(seconds), angle, rtol=1e-6)
    np.testing.assert_allclose(DRIFT.arc_of_time_m(seconds), arc, rtol=1e-6)
    np.testing.assert_allclose(DRIFT.speed_at_m_s(arc), omega_rad_s(seconds) * radius, rtol=1e-6)


@given(st.lists(st.tuples(st.floats(0.01, 5), st.floats(60, 100)), min_size=1, max_size=6), st.floats(-9, 30))
def test_angle_and_time_are_inverse_and_time_is_zero_at_zero(steps, time_s):
    gaps, rpm = zip(*steps, strict=True)
    curve = SpeedCurve(tuple(np.cumsum(gaps) - 4.0), rpm)
    assert curve.time_of_angle_s(curve.angle_of_time_rad(time_s)) == pytest.approx(time_s, rel=1e-9, abs=1e-9)
    assert curve.angle_of_time_rad(0.0) == pytest.approx(0.0, abs=1e-12)
    assert curve.angle_of_time_rad(time_s + 0.01) > curve.angle_of_time_rad(time_s)


def test_a_flat_curve_is_a_rotation():
    arc = np.linspace(-0.01, 9.0, 31)
    flat = DriftingRotation.following(SpeedCurve((2.0, 5.0), (78.0, 78.0)), SPIRAL)
    np.testing.assert_allclose(flat.time_of_arc_s(arc), SPIRAL.time_of_arc_s(arc), rtol=1e-12)
    np.testing.assert_allclose(flat.speed_at_m_s(arc), SPIRAL.speed_at_m_s(arc), rtol=1e-12)
    assert np.isnan(flat.time_of_arc_s(np.nan))


def test_before_and_after_the_curve_the_speed_stays():
    assert DRIFT.curve.rpm_at([-9.0, 99.0]).tolist() == [81.0, 71.0]
    step = DRIFT.angle_of_time_rad(30.0) - DRIFT.angle_of_time_rad(29.0)
    assert step == pytest.approx(71 * 2 * np.pi / 60)
    assert DRIFT.rpm == pytest.approx(81 - 2.74 / 3)
    assert replace(DRIFT, pitch_m=0.0).fastest_m_s(0.0) == pytest.approx(81 * 2 * np.pi / 60 * 0.0931)


@pytest.mark.parametrize(
    ("time_s", "rpm"),
    [((), ()), ((0.0, 0.0), (78.0, 78.0)), ((0.0,), (0.0,)), ((0.0, 1.0), (78.0,)), ((np.nan,), (78.0,))],
)
def test_impossible_curves_are_refused(time_s, rpm):
    with pytest.raises(ArgumentError):
        SpeedCurve(time_s, rpm)
