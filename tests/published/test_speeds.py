"""Numbers that the standards of archives print about speed (IASA TC-04, the stroboscope discs)."""

import pytest

from gramoscope.errors import ArgumentError
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speeds import NAMED_SPEEDS, speed_called


@pytest.mark.parametrize(
    ("mains_hz", "bars", "rpm"), [(60, 92, 78.26), (50, 77, 77.92), (60, 94, 76.60), (60, 90, 80.0)]
)
def test_a_stroboscope_disc_stands_still_at_its_speed(mains_hz, bars, rpm):
    """120 flashes a second for 60 Hz mains: in the time between two of them the table turns by one bar."""
    between_flashes_s = 1 / (2 * mains_hz)
    rotation = Rotation(rpm=rpm, radius_m=0.127)
    turned = rotation.arc_of_time_m(between_flashes_s) / 0.127
    assert turned * bars / (2 * 3.141592653589793) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "rpm"),
    [
        ("78-US", 78.26),
        ("78-europe", 77.92),
        ("76-us", 76.60),
        ("80", 80.0),
        ("45", 45.0),
        ("33⅓", 33.333),
        ("77.5", 77.5),
    ],
)
def test_a_speed_has_a_name(text, rpm):
    assert speed_called(text).rpm == pytest.approx(rpm, abs=5e-3)


@pytest.mark.parametrize("text", ["78-eu", "fast", "", "nan", "-78", "3300"])
def test_a_speed_that_nobody_knows_is_refused_with_the_names(text):
    with pytest.raises(ArgumentError):
        speed_called(text)


def test_what_78_turned_at_is_left_to_the_person_who_asks():
    """78 is a number: 78.26 and 77.92 have names of their own, and none of them is guessed."""
    assert speed_called("78").rpm == 78
    assert speed_called("78").origin == ""
    assert all(speed.origin for speed in NAMED_SPEEDS.values())
