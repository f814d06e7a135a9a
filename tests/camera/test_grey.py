import numpy as np
import pytest

from gramoscope.camera.frames import Unusable, develop
from gramoscope.camera.grey import fit_to_bits, grey_of_colour, grey_of_colour_reference
from gramoscope.camera.sensor import Sensor


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_is_the_rounded_mean_of_the_channels(dtype):
    frame = np.random.default_rng(5).integers(0, np.iinfo(dtype).max + 1, (31, 47, 3)).astype(dtype)
    exact = np.floor(frame.astype(np.float64).mean(axis=-1) + 0.5)  # thirds are never halves
    np.testing.assert_array_equal(grey_of_colour(frame), exact)
    np.testing.assert_array_equal(grey_of_colour(frame), grey_of_colour_reference(frame))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_stored_as_colour_comes_back_exactly(dtype):
    levels = np.arange(np.iinfo(dtype).max + 1, dtype=dtype)[:, np.newaxis]
    np.testing.assert_array_equal(grey_of_colour(np.repeat(levels[..., np.newaxis], 3, axis=-1)), levels)


def test_opacity_is_not_a_colour():
    frame = np.random.default_rng(6).integers(0, 256, (17, 29, 4)).astype(np.uint8)
    np.testing.assert_array_equal(grey_of_colour(frame), grey_of_colour(frame[..., :3]))
    np.testing.assert_array_equal(grey_of_colour(frame[..., :2]), frame[..., 0])


def test_numbers_that_fit_are_left_alone():
    frame = np.array([[3, 4095]], np.uint16)
    fitted, remark = fit_to_bits(frame, bits=12)
    assert remark is None
    np.testing.assert_array_equal(fitted, frame)


@pytest.mark.parametrize(
    ("frame", "bits", "expected"),
    [
        (np.array([[0, 128, 255]], np.uint8), 12, [[0, 2056, 4095]]),
        (np.array([[0, 32896, 65535]], np.uint16), 8, [[0, 128, 255]]),
        (np.array([[0, 32768, 65520]], np.uint16), 12, [[0, 2048, 4094]]),
    ],
)
def test_numbers_of_another_depth_are_scaled_with_a_remark(frame, bits, expected):
    fitted, remark = fit_to_bits(frame, bits=bits)
    np.testing.assert_array_equal(fitted, expected)
    assert f"capture.toml says {bits}" in remark


@pytest.mark.parametrize(
    ("frame", "word"),
    [
        (np.ones((20, 31), np.float32), "float32"),
        (np.ones((20, 30), np.uint8), "30 × 20 pixels, needed 31 × 20"),
        (np.ones((2, 20, 31, 3), np.uint8), "4 dimensions"),
    ],
)
def test_a_picture_of_no_use_leaves_black_and_a_reason(frame, word):
    out = np.zeros((20, 31), np.uint8)
    remark = develop(frame, sensor=Sensor(width_px=31, height_px=20), out=out)
    assert isinstance(remark, Unusable)
    assert word in remark
    assert not out.any()


@pytest.mark.parametrize(
    ("columns", "rows", "row", "column"),
    [
        ("forward", "inward", 3, 7),
        ("backward", "inward", 3, 23),
        ("forward", "outward", 16, 7),
        ("backward", "outward", 16, 23),
    ],
)
def test_developing_turns_the_picture_the_canonical_way_round(columns, rows, row, column):
    frame = np.zeros((20, 31), np.uint8)
    frame[row, column] = 200
    out = np.zeros_like(frame)
    develop(frame, sensor=Sensor(width_px=31, height_px=20, columns=columns, rows=rows), out=out)
    assert out[3, 7] == 200
    assert np.count_nonzero(out) == 1
