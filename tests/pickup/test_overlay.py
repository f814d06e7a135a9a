"""Frames laid over each other in one pass: the same mean as that of `register`, column by column."""

import numpy as np
import pytest

from gramoscope.pickup.overlay import BLOCK_ROWS, overlay
from gramoscope.pickup.registration import register

SHIFT_PX = np.array([0.0, 2.3, 3.9, 6.75])
NUMBER = np.array([0, 1, 3, 4])


def _film(dtype: type = np.uint8, *, height: int = 2 * BLOCK_ROWS + 5) -> np.ndarray:
    rng = np.random.default_rng(6)
    return rng.integers(3, np.iinfo(dtype).max - 3, (4, height, 61)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("height", [1, BLOCK_ROWS, 2 * BLOCK_ROWS + 5])
def test_the_mean_is_that_of_the_canvas(dtype: type, height: int) -> None:
    images = _film(dtype, height=height)
    laid, canvas = overlay(images, SHIFT_PX, NUMBER), register(images, SHIFT_PX, NUMBER)
    np.testing.assert_allclose(laid.columns.T, canvas.mean, rtol=2e-6, atol=1e-4 * np.iinfo(dtype).max / 255)
    np.testing.assert_array_equal(laid.frames, canvas.frames)
    assert laid.columns.flags.c_contiguous


def test_a_ramp_that_moves_with_the_record_stays_a_ramp() -> None:
    column = np.arange(80.0)
    images = np.rint(np.stack([np.tile(2 * (column + d) + 5, (7, 1)) for d in (0.0, 4.0, 9.5)])).astype(np.uint8)
    laid = overlay(images, np.array([0.0, 4.0, 9.5]), np.arange(3))
    np.testing.assert_allclose(laid.columns[1:-2, 3], 2 * np.arange(1, 87) + 5, atol=1e-3)
    # one column at each end is lost to interpolation and repeats its neighbour
    np.testing.assert_array_equal(laid.columns[0], laid.columns[1])
    np.testing.assert_array_equal(laid.frames[[0, 1, 4, 5, 44]], [0, 1, 1, 2, 3])


def test_the_film_stays_as_it_was() -> None:
    images = _film()
    before = images.copy()
    images.flags.writeable = False
    overlay(images, SHIFT_PX, NUMBER)
    np.testing.assert_array_equal(images, before)
