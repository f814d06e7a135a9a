"""Frames laid over each other in one pass: the same mean as that of `register`, column by column."""

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.pickup.overlay import (
    EXACT_FRAMES,
    PHASES,
    TILE_COLUMNS,
    TILE_ROWS,
    all_tiles,
    frames_in,
    overlay,
    overlay_width,
    slope_along,
    tiles_about,
    to_phases,
)
from gramoscope.pickup.registration import register

SHIFT_PX = np.array([0.0, 2.3, 3.9, 6.75])
NUMBER = np.array([0, 1, 3, 4])


def _film(dtype: type = np.uint8, *, height: int = 2 * TILE_ROWS + 5) -> np.ndarray:
    rng = np.random.default_rng(6)
    return rng.integers(3, np.iinfo(dtype).max - 3, (4, height, 61)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("height", [1, TILE_ROWS, 2 * TILE_ROWS + 5])
@pytest.mark.parametrize("shift_px", [SHIFT_PX, np.array([0.0, 2.0, 4.5, 6.5]), np.array([0.25, 3.25, 7.25, 57.25])])
def test_the_mean_is_that_of_the_canvas(dtype: type, height: int, shift_px: np.ndarray) -> None:
    """Frames of one fraction of a pixel are added as whole numbers, as far as all of them reach."""
    images = _film(dtype, height=height)
    laid, canvas = overlay(images, shift_px, NUMBER), register(images, shift_px, NUMBER)
    np.testing.assert_allclose(laid.columns.T, canvas.mean, rtol=2e-6, atol=1e-4 * np.iinfo(dtype).max / 255)
    np.testing.assert_array_equal(laid.frames, canvas.frames)
    assert laid.columns.flags.c_contiguous


def test_frames_are_counted_where_all_taps_of_their_interpolation_lie() -> None:
    x = np.arange(overlay_width(61, SHIFT_PX))
    # columns from −1 to +2 about the place in the frame
    first = [np.floor(x - shift) - 1 for shift in SHIFT_PX]
    np.testing.assert_array_equal(frames_in(61, SHIFT_PX), sum((one >= 0) & (one + 3 <= 60) for one in first))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("width", [93, 2500])
@pytest.mark.parametrize("shift_px", [SHIFT_PX, np.array([0.0, 2.0, 4.5, 6.5])])
def test_wide_frames_are_added_many_pixels_at_a_time(dtype: type, width: int, shift_px: np.ndarray) -> None:
    rng = np.random.default_rng(11)
    images = rng.integers(3, np.iinfo(dtype).max - 3, (4, TILE_ROWS + 3, width)).astype(dtype)
    laid, canvas = overlay(images, shift_px, NUMBER), register(images, shift_px, NUMBER)
    np.testing.assert_allclose(laid.columns.T, canvas.mean, rtol=2e-6, atol=1e-4 * np.iinfo(dtype).max / 255)


def test_more_frames_of_one_fraction_than_sums_have_room_for_are_added_in_turn() -> None:
    images = np.full((600, TILE_ROWS, 80), 255, np.uint8)
    laid = overlay(images, np.zeros(600), np.arange(600))
    np.testing.assert_allclose(laid.columns, 255, rtol=1e-6)


def test_phases_are_few_and_shifts_right_in_the_mean() -> None:
    shift = np.cumsum(np.r_[0.0, np.random.default_rng(2).uniform(1.5, 2.5, 40)])
    near = to_phases(shift)
    assert np.unique(near % 1).size == PHASES
    assert (near - shift).mean() == pytest.approx(0, abs=1e-6)
    assert np.abs(near - shift).max() < 0.7 / PHASES
    np.testing.assert_array_equal(to_phases(shift[:EXACT_FRAMES]), shift[:EXACT_FRAMES])


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


@pytest.mark.parametrize("width", [61, 5 * TILE_COLUMNS + 3])
def test_only_what_is_wanted_is_drawn(width: int) -> None:
    rng = np.random.default_rng(4)
    images = rng.integers(3, 250, (4, 5 * TILE_ROWS + 2, width)).astype(np.uint8)
    whole = overlay(images, SHIFT_PX, NUMBER).columns
    wanted = rng.uniform(size=all_tiles(whole.shape[::-1]).shape) < 0.5
    drawn = overlay(images, SHIFT_PX, NUMBER, wanted).columns
    inside = wanted.repeat(TILE_ROWS, axis=0).repeat(TILE_COLUMNS, axis=1)[: whole.shape[1], : whole.shape[0]].T
    # what no frame covers repeats its neighbour, drawn or not
    middle = slice(1, -2)
    np.testing.assert_array_equal(drawn[middle], np.where(inside, whole, 0)[middle])
    assert 0.2 < inside.mean() < 0.8


def test_tiles_lie_about_the_lines_that_are_wanted() -> None:
    shape = (10 * TILE_ROWS, 4 * TILE_COLUMNS)
    column = np.arange(shape[1])
    lines = np.array([40.0 + 0.2 * column, np.full(shape[1], 148.0)])
    lines[1, : 2 * TILE_COLUMNS + 10] = np.nan
    wanted = tiles_about(lines, shape, reach_px=9.0)
    inside = wanted.repeat(TILE_ROWS, axis=0).repeat(TILE_COLUMNS, axis=1)
    row = np.arange(shape[0])[:, None]
    near = (np.abs(row - lines[:, None, :]) <= 9.0).any(axis=0)
    assert inside[near].all()
    # no tile without need, but for the corners that a line cuts
    assert wanted.sum() <= np.count_nonzero(near.reshape(10, TILE_ROWS, 4, TILE_COLUMNS).any(axis=(1, 3)))
    assert not tiles_about(lines - 1e4, shape, reach_px=9.0).any()
    assert not tiles_about(np.full((1, shape[1]), np.nan), shape, reach_px=9.0).any()


def test_the_slope_along_the_groove_is_that_of_a_gaussian() -> None:
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(90, 7)).astype(np.float32)
    expected = ndimage.gaussian_filter(columns.T, 1.0, order=(0, 1), mode="nearest")
    found = slope_along(columns)
    assert found.shape == (7, 90)
    assert found.flags.c_contiguous
    np.testing.assert_allclose(found, expected, atol=0.01 * expected.std())
    ramp = np.tile(3.0 * np.arange(40.0), (5, 1)).T.astype(np.float32)
    np.testing.assert_allclose(slope_along(ramp)[:, 4:-4], 3.0, rtol=1e-6)
