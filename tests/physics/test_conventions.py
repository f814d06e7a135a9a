"""Axes and signs, pinned down."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gramoscope.conventions import (
    INNER,
    OUTER,
    arc_of_column_m,
    deg,
    lateral_of_row_m,
    mirror,
    mirror_row,
    motion_of_stereo,
    rad,
    row_of_lateral_px,
    stereo_of_motion,
)

columns = st.sampled_from(["forward", "backward"])
rows = st.sampled_from(["inward", "outward"])
PICTURE = np.arange(2 * 5 * 7).reshape(2, 5, 7)


@given(columns, rows)
def test_the_mirror_is_its_own_inverse(columns, rows):
    once = mirror(PICTURE, columns=columns, rows=rows)
    np.testing.assert_array_equal(mirror(once, columns=columns, rows=rows), PICTURE)


def test_backward_turns_columns_and_outward_turns_rows():
    assert mirror(PICTURE, columns="backward", rows="inward")[1, 3, 0] == PICTURE[1, 3, 6]
    assert mirror(PICTURE, columns="forward", rows="outward")[1, 0, 2] == PICTURE[1, 4, 2]
    np.testing.assert_array_equal(mirror(PICTURE, columns="forward", rows="inward"), PICTURE)


@given(rows, st.floats(-50, 500))
def test_a_row_is_mirrored_as_the_picture_is(rows, row):
    assert mirror_row(mirror_row(row, height_px=448, rows=rows), height_px=448, rows=rows) == pytest.approx(row)
    picture = np.arange(448.0)[:, None]
    mirrored = mirror(picture, columns="forward", rows=rows)
    assert mirrored[int(mirror_row(100, height_px=448, rows=rows)), 0] == 100


def test_place_grows_with_the_column_and_lateral_place_with_the_row():
    np.testing.assert_allclose(arc_of_column_m([0, 3], arc_start_m=1e-3, pixel_pitch_m=0.4e-6), [1e-3, 1.0012e-3])
    low, high = lateral_of_row_m([100, 101], height_px=383, pixel_pitch_m=0.4e-6)
    assert high - low == pytest.approx(0.4e-6)
    assert lateral_of_row_m(191, height_px=383, pixel_pitch_m=0.4e-6) == 0


@given(st.floats(-100, 1100), st.floats(-1e-3, 1e-3))
def test_row_and_lateral_place_are_inverse_wherever_the_stage_stands(row, stage_m):
    place = lateral_of_row_m(row, height_px=384, pixel_pitch_m=0.39e-6, stage_m=stage_m)
    back = row_of_lateral_px(place, height_px=384, pixel_pitch_m=0.39e-6, stage_m=stage_m)
    assert back == pytest.approx(row, abs=1e-6)


def test_equal_channels_are_a_lateral_cut_and_opposite_ones_a_vertical_cut():
    sound = np.array([0.3, -1.0, 0.2])
    lateral, vertical = motion_of_stereo(sound, sound)
    np.testing.assert_allclose(lateral, np.sqrt(2) * sound)
    np.testing.assert_array_equal(vertical, 0)
    lateral, vertical = motion_of_stereo(-sound, sound)
    np.testing.assert_array_equal(lateral, 0)
    np.testing.assert_allclose(vertical, np.sqrt(2) * sound)


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_stereo_there_and_back_keeps_channels_and_power(left, right):
    lateral, vertical = motion_of_stereo(np.array(left), np.array(right))
    back = stereo_of_motion(lateral, vertical)
    np.testing.assert_allclose(back, (left, right), atol=1e-15)
    assert lateral**2 + vertical**2 == pytest.approx(left**2 + right**2)


def test_a_single_channel_moves_one_wall_along_its_normal_and_slides_along_the_other():
    """The inner wall climbs towards +l, so its normal out of the record is (−l, +z)/√2: the left channel's, reversed."""
    inner_normal, outer_normal = np.array([-1, 1]) / np.sqrt(2), np.array([1, 1]) / np.sqrt(2)
    left_only = np.array(motion_of_stereo(np.array(0.7), np.array(0.0)))
    right_only = np.array(motion_of_stereo(np.array(0.0), np.array(0.7)))
    assert left_only @ inner_normal == pytest.approx(-0.7)
    assert left_only @ outer_normal == pytest.approx(0, abs=1e-15)
    assert right_only @ outer_normal == pytest.approx(0.7)
    assert right_only @ inner_normal == pytest.approx(0, abs=1e-15)


def test_the_inner_wall_comes_first():
    assert (INNER, OUTER) == (0, 1)


@given(st.floats(-720, 720))
def test_degrees_and_radians_are_inverse(angle):
    assert deg(rad(angle)) == pytest.approx(angle, abs=1e-9)
