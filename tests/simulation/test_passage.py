"""What lies on the record: place, time and wow."""

import numpy as np
import pytest

from gramoscope.disc.cutting import cut_sound
from gramoscope.errors import ArgumentError
from gramoscope.simulation.passage import Passage
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.wow import Wow

RATE_HZ = 48_000.0
TIME_S = np.arange(12_000) / RATE_HZ
SPIRAL = Rotation(rpm=78.0, radius_m=0.09, pitch_m=2.5e-4)
WOW = Wow(depth=0.01, frequency_hz=7.0, phase_rad=0.8)


@pytest.fixture(scope="module")
def passage() -> Passage:
    sound = np.sin(2 * np.pi * 620 * TIME_S)
    return Passage(cut_sound(sound, rate_hz=RATE_HZ, level_m_s=0.03, cut="lateral"), SPIRAL, WOW)


def test_the_slope_is_the_derivative_of_the_displacement(passage: Passage) -> None:
    arc_m = np.linspace(0.05, 0.06, 100_001)
    step_m = arc_m[1] - arc_m[0]
    lateral, _ = passage.displacement_m(arc_m)
    middle = passage.slope((arc_m[1:] + arc_m[:-1]) / 2)[0]
    np.testing.assert_allclose(np.diff(lateral) / step_m, middle, atol=1e-6)


def test_the_velocity_is_slope_times_groove_speed(passage: Passage) -> None:
    arc_m = np.array([0.02, 0.07, 0.11])
    expected = passage.slope(arc_m) * SPIRAL.speed_at_m_s(arc_m)
    np.testing.assert_allclose(passage.velocity_m_s(arc_m), expected, rtol=1e-12)


def test_the_sound_stands_at_its_place_shifted_by_the_wow(passage: Passage) -> None:
    nominal_s = np.linspace(0.05, 0.2, 5001)
    velocity = passage.velocity_m_s(SPIRAL.arc_of_time_m(nominal_s))[0] / WOW.rate(nominal_s)
    expected = 0.03 * np.sqrt(2) * np.sin(2 * np.pi * 620 * WOW.sound_time_s(nominal_s))
    np.testing.assert_allclose(velocity, expected, atol=0.02 * 0.03)


def test_wow_keeps_time_zero_and_its_rate_is_its_derivative() -> None:
    assert WOW.sound_time_s(0.0) == 0
    time_s = np.linspace(0.3, 0.5, 2001)
    slope = np.gradient(WOW.sound_time_s(time_s), time_s)[1:-1]
    np.testing.assert_allclose(slope, WOW.rate(time_s)[1:-1], atol=1e-6)
    assert np.ptp(WOW.rate(np.linspace(0, 1, 9999))) / 2 == pytest.approx(0.01, rel=1e-4)


def test_no_wow_leaves_time_alone() -> None:
    np.testing.assert_array_equal(Wow().sound_time_s(TIME_S), TIME_S)


@pytest.mark.parametrize("wrong", [{"depth": -0.1}, {"depth": 0.9}, {"frequency_hz": 0.0}])
def test_an_impossible_wow_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArgumentError):
        Wow(**wrong)
