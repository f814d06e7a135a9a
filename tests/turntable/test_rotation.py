"""Angle, radius and time, against numerical integration and each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from gramoscope.errors import ArgumentError
from gramoscope.turntable.rotation import Rotation

rotations = st.builds(
    Rotation,
    rpm=st.floats(16, 100),
    radius_m=st.floats(0.05, 0.2),
    pitch_m=st.one_of(st.just(0.0), st.floats(1e-12, 1e-3)),
)


def test_the_spiral_is_the_one_that_integration_draws():
    """dr/dt = −p ω/2π and ds/dt = ω r, step by step, for 40 turns."""
    rotation = Rotation(rpm=76.6, radius_m=0.121, pitch_m=237e-6)
    omega = rotation.angular_speed_rad_s
    seconds = np.linspace(0.3, 31.0, 23)
    drawn = solve_ivp(
        lambda t, y: [-rotation.pitch_m * omega / (2 * np.pi), omega * y[0]],
        (0, 31.0),
        [0.121, 0.0],
        t_eval=seconds,
        rtol=1e-11,
        atol=1e-13,
    )
    radius, arc = drawn.y
    np.testing.assert_allclose(rotation.arc_of_time_m(seconds), arc, rtol=1e-9)
    np.testing.assert_allclose(rotation.radius_at_m(arc), radius, rtol=1e-9)
    np.testing.assert_allclose(rotation.time_of_arc_s(arc), seconds, rtol=1e-9)


def test_a_turn_loses_one_pitch():
    rotation = Rotation(rpm=80.0, radius_m=0.09, pitch_m=254e-6)
    arc = rotation.arc_of_time_m(60 / 80.0)
    assert rotation.radius_at_m(arc) == pytest.approx(0.09 - 254e-6, rel=1e-12)


@given(rotations, st.floats(-0.5, 30.0))
def test_place_and_time_are_inverse(rotation, time_s):
    arc = rotation.arc_of_time_m(time_s)
    assert rotation.time_of_arc_s(arc) == pytest.approx(time_s, rel=1e-9, abs=1e-12)


@given(rotations, st.floats(-0.1, 20.0))
def test_the_speed_is_how_fast_the_place_changes(rotation, time_s):
    h = 1e-5
    slope = (rotation.arc_of_time_m(time_s + h) - rotation.arc_of_time_m(time_s - h)) / (2 * h)
    assert rotation.speed_at_m_s(rotation.arc_of_time_m(time_s)) == pytest.approx(slope, rel=1e-7)


@given(st.floats(16, 100), st.floats(0.05, 0.2), st.floats(-0.1, 3.0))
def test_a_vanishing_pitch_is_a_circle(rpm, radius_m, arc_m):
    spiral, circle = Rotation(rpm, radius_m, pitch_m=1e-13), Rotation(rpm, radius_m)
    assert spiral.time_of_arc_s(arc_m) == pytest.approx(circle.time_of_arc_s(arc_m), rel=1e-8)


def test_before_the_first_frame_time_is_negative_and_the_radius_greater():
    rotation = Rotation(rpm=78.0, radius_m=0.1, pitch_m=254e-6)
    assert rotation.time_of_arc_s(-0.01) < 0
    assert rotation.radius_at_m(-0.01) > 0.1
    assert np.isnan(rotation.radius_at_m(np.nan))


@pytest.mark.parametrize(
    "wrong",
    [{"rpm": 0, "radius_m": 0.1}, {"rpm": 78, "radius_m": -0.1}, {"rpm": 78, "radius_m": 0.1, "pitch_m": -1e-6}],
)
def test_impossible_turntables_are_refused(wrong):
    with pytest.raises(ArgumentError):
        Rotation(**wrong)


def test_a_groove_that_would_cross_the_centre_is_refused():
    with pytest.raises(ArgumentError, match="254"):
        Rotation(rpm=78, radius_m=0.05, pitch_m=254e-6).radius_at_m(np.array([0.0, 40.0]))
