"""Numbers that the standards of archives print about speed (IASA TC-04, the stroboscope discs)."""

import pytest

from gramoscope.turntable.rotation import Rotation


@pytest.mark.parametrize(
    ("mains_hz", "bars", "rpm"), [(60, 92, 78.26), (50, 77, 77.92), (60, 94, 76.60), (60, 90, 80.0)]
)
def test_a_stroboscope_disc_stands_still_at_its_speed(mains_hz, bars, rpm):
    """120 flashes a second for 60 Hz mains: in the time between two of them the table turns by one bar."""
    between_flashes_s = 1 / (2 * mains_hz)
    rotation = Rotation(rpm=rpm, radius_m=0.127)
    turned = rotation.arc_of_time_m(between_flashes_s) / 0.127
    assert turned * bars / (2 * 3.141592653589793) == pytest.approx(1, abs=1e-4)
