"""Every number that the paper prints, recomputed with our optics; where ours differs, the test holds both.

"Sound from gramophone record groove surface orientation", sections 2 to 7.
"""

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.camera.sensor import Sensor
from gramoscope.microscope.cover_glass import CoverGlass, shift_exact_m, shift_paraxial_m
from gramoscope.microscope.focus import stripe_separation_m
from gramoscope.microscope.objective import Objective
from gramoscope.turntable.rotation import Rotation, pixel_rate_hz

LENS_40X = Objective(magnification=40, numerical_aperture=0.65, tube_length_m=0.160)
LENS_4X = Objective(magnification=4, numerical_aperture=0.10, tube_length_m=0.160)
GLASS = CoverGlass(thickness_m=0.11e-3, refractive_index=1.515)
TABLE = Rotation(rpm=78.0, radius_m=0.115)
CAMERA = Sensor(width_px=1280, height_px=1024, bits=8, colour="rgb", pixel_pitch_m=0.5e-3 / 1280)
NEIGHBOURHOOD_PX = 100


def test_section_2_images_are_24_bit_colour_1280_by_1024():
    assert CAMERA.frame_shape == (1024, 1280, 3)
    assert 3 * CAMERA.bits == 24


def test_section_2_a_40x_objective_and_a_10x_eye_piece_magnify_400_times():
    assert LENS_40X.magnification * 10 == 400


def test_section_3_the_object_distance_is_4_mm():
    assert LENS_40X.object_distance_m == pytest.approx(4e-3, rel=1e-12)


def test_section_3_the_focal_length_is_3_9_mm():
    printed, ours = 3.9e-3, 3.902e-3
    assert LENS_40X.focal_length_m == pytest.approx(ours, abs=0.5e-6)
    assert round(LENS_40X.focal_length_m, 4) == printed


def test_section_3_an_error_of_7_to_8_per_cent_of_the_distance_equals_a_groove_120_um_deep_at_1_7_mm():
    """Printed: "about 120 µm", 7–8 %, 1.7 mm. Ours: between 1.50 and 1.71 mm, so 1.7 mm belongs to 7 %."""
    depth_m = 120e-6
    assert depth_m / 0.07 == pytest.approx(1.7e-3, abs=0.02e-3)
    assert depth_m / 0.08 == pytest.approx(1.5e-3)


def test_section_4_the_depth_of_field_of_the_40x_objective_is_about_1_um():
    printed, ours = 1e-6, 1.30e-6
    assert LENS_40X.depth_of_field_m() == pytest.approx(ours, abs=0.01e-6)
    assert round(LENS_40X.depth_of_field_m() * 1e6) == round(printed * 1e6)


def test_section_4_the_depth_of_field_of_a_4x_objective_is_about_45_um():
    """The formula gives 55 µm for a 4X/0.10; the printed 45 µm belongs to an aperture of 0.11."""
    printed, ours = 45e-6, 55e-6
    assert LENS_4X.depth_of_field_m() == pytest.approx(ours, rel=1e-9)
    assert LENS_4X.depth_of_field_m() > 1.2 * printed
    assert Objective(magnification=4, numerical_aperture=0.11).depth_of_field_m() == pytest.approx(printed, rel=0.02)


def test_section_4_the_focal_length_of_a_4x_objective_is_about_32_mm():
    assert LENS_4X.focal_length_m == pytest.approx(32e-3, rel=1e-12)


def test_section_5_equation_2_lacks_the_thickness():
    """As printed, δv = 1 − (1/n) cos θ/cos θ′ has no unit; times d it is a length, and its limit is equation 3."""
    theta = np.deg2rad(20.0)
    inside = np.arcsin(np.sin(theta) / 1.515)
    as_printed = 1 - np.cos(theta) / (1.515 * np.cos(inside))
    ours = shift_exact_m(0.11e-3, theta, refractive_index=1.515)
    assert ours == pytest.approx(0.11e-3 * as_printed, rel=1e-12)
    assert as_printed == pytest.approx(0.363, abs=0.001)
    assert as_printed > 9000 * ours


def test_section_5_equation_3_the_glass_shifts_the_focus_by_0_037_mm():
    printed, ours = 0.037e-3, 37.39e-6
    assert GLASS.shift_m == pytest.approx(ours, abs=0.005e-6)
    assert round(GLASS.shift_m, 6) == printed
    assert shift_paraxial_m(0.11e-3, refractive_index=1.515) == GLASS.shift_m


def test_section_5_at_22_5_degrees_the_shift_is_9_per_cent_more_than_close_to_1():
    printed, ours = 37.39e-6, 40.67e-6
    exact = shift_exact_m(0.11e-3, np.deg2rad(22.5), refractive_index=1.515)
    assert exact == pytest.approx(ours, abs=0.005e-6)
    assert exact / printed == pytest.approx(1.088, abs=0.001)


def test_section_5_at_the_rim_of_the_aperture_the_shift_is_a_third_more():
    """40.5°, well beyond the 22.5° that the paper allows its approximation."""
    assert np.rad2deg(LENS_40X.half_angle_rad) == pytest.approx(40.54, abs=0.01)
    rim = shift_exact_m(0.11e-3, LENS_40X.half_angle_rad, refractive_index=1.515)
    assert rim == pytest.approx(48.9e-6, abs=0.05e-6)
    assert rim / GLASS.shift_m == pytest.approx(1.31, abs=0.01)


def test_section_5_the_two_depths_are_4_and_4_037_mm():
    assert LENS_40X.object_distance_m == pytest.approx(4.000e-3)
    assert round(LENS_40X.object_distance_m + GLASS.shift_m, 6) == 4.037e-3


def test_section_5_the_two_stripes_of_a_45_degree_wall_lie_95_7_pixels_apart():
    apart_px = stripe_separation_m(GLASS.shift_m, wall_angle_rad=np.pi / 4) / CAMERA.pixel_pitch_m
    assert apart_px == pytest.approx(95.7, abs=0.05)


def test_section_4_the_bench_sees_three_stripes_two_at_one_depth_on_opposite_walls():
    low, middle, high = Bench(sensor=CAMERA, cover_glass=GLASS).stripe_rows()
    assert (low + middle) / 2 == pytest.approx((CAMERA.height_px - 1) / 2)
    assert high - middle == pytest.approx(95.7, abs=0.05)


def test_section_6_the_neighbourhood_of_100_pixels_is_39_um_and_nothing_at_24_khz():
    """A straight line fitted over 41.6 µs is deaf near the inverse of that time."""
    length_m = NEIGHBOURHOOD_PX * CAMERA.pixel_pitch_m
    lasts_s = float(TABLE.time_of_arc_s(length_m))
    assert length_m == pytest.approx(39.06e-6, abs=0.005e-6)
    assert lasts_s == pytest.approx(41.6e-6, abs=0.05e-6)
    assert 1 / lasts_s == pytest.approx(24e3, rel=0.005)


def test_section_6_the_mean_over_the_neighbourhood_has_its_first_null_near_24_khz():
    """The difference of the ends of a stretch is the mean of the slopes in it: a sinc whose first null is 1/T."""
    place = (np.arange(NEIGHBOURHOOD_PX) + 0.5) * CAMERA.pixel_pitch_m
    time = TABLE.time_of_arc_s(place)
    f = np.linspace(15e3, 33e3, 1801)
    gain = np.abs(np.mean(np.exp(2j * np.pi * f[:, None] * time), axis=1))
    assert f[np.argmin(gain)] == pytest.approx(24_047, abs=20)


def test_section_7_a_pixel_is_0_39_um():
    printed, ours = 0.39e-6, 0.390625e-6
    assert CAMERA.pixel_pitch_m == ours
    assert round(CAMERA.pixel_pitch_m, 8) == printed


def test_section_7_the_groove_speed_is_939_34_mm_a_second():
    printed, ours = 0.93934, 0.939336
    speed = float(TABLE.speed_at_m_s(0.0))
    assert speed == pytest.approx(ours, abs=0.5e-6)
    assert round(speed, 5) == printed


def test_section_7_the_pixel_rate_is_2404_71_khz():
    """Ours is 2404.70 kHz, from the unrounded pitch; the printed pitch of 0.39 µm would have given 2408.6."""
    printed_khz, ours_khz = 2404.71, 2404.70
    speed = float(TABLE.speed_at_m_s(0.0))
    rate_khz = pixel_rate_hz(speed, pixel_pitch_m=CAMERA.pixel_pitch_m) / 1e3
    assert rate_khz == pytest.approx(ours_khz, abs=0.005)
    assert rate_khz == pytest.approx(printed_khz, abs=0.011)
    assert pixel_rate_hz(speed, pixel_pitch_m=0.39e-6) / 1e3 == pytest.approx(2408.6, abs=0.05)


def test_section_7_the_pixel_rate_is_about_110_times_that_of_a_recording():
    """2404.7/110 = 21.9 kHz: printed "recording sample frequency" is about half of 44.1 kHz, or 20 kHz and a little."""
    rate = pixel_rate_hz(float(TABLE.speed_at_m_s(0.0)), pixel_pitch_m=CAMERA.pixel_pitch_m)
    assert rate / 110 == pytest.approx(21.86e3, abs=20)
    assert rate / 22_050 == pytest.approx(110, rel=0.01)


def test_section_7_6000_groups_are_about_3_seconds():
    """3.19 s if the groups touch without overlap: about 6 % of overlap would make the printed 3 s."""
    sequence = Sequence(groups=6000, frames_per_group=12, frame_step_m=0.8e-6, group_step_m=0.5e-3)
    assert sequence.groups * sequence.group_step_m == pytest.approx(3.0)
    assert float(TABLE.time_of_arc_s(3.0)) == pytest.approx(3.19, abs=0.005)
    assert float(TABLE.time_of_arc_s(3.0 * (1 - 0.061))) == pytest.approx(3.0, abs=0.005)


def test_section_7_synthetic_grooves_were_sampled_at_220_5_khz():
    """Five times 44.1 kHz, eleven times coarser than the pixels of the real record."""
    rate = pixel_rate_hz(float(TABLE.speed_at_m_s(0.0)), pixel_pitch_m=CAMERA.pixel_pitch_m)
    assert 220_500 / 44_100 == 5
    assert rate / 220_500 == pytest.approx(10.9, abs=0.05)
