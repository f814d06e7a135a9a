"""Coarse paths of both walls: what is jitter, and which one has gone astray."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.pickup.texture.coarse_path import (
    LEAST_PARTED_COLUMNS,
    MOST_PARTED_PX,
    along_columns,
    astray,
    of_walls,
    settled,
    silenced,
)
from gramoscope.pickup.texture.smoothing import half_bell

WIDTH = 800
COLUMN = np.arange(WIDTH)
SMOOTH_PX = 200.0
SEEN = 0.15
SWING = 12 * np.sin(2 * np.pi * COLUMN / 400 + 0.4)


JITTER = np.random.default_rng(8).normal(size=(2, WIDTH))


@pytest.mark.parametrize(("cut", "sign"), [("lateral", 1.0), ("vertical", -1.0)])
def test_settled_paths_swing_together_and_keep_their_distance(cut: Cut, sign: float) -> None:
    swing = 12 * np.sin(2 * np.pi * COLUMN / 400 + 0.4)
    path = np.array([sign * swing + sign * -1.5, swing + 1.5])
    found = settled(path + JITTER, np.ones((2, WIDTH)), cut, smooth_px=SMOOTH_PX)
    # what one wall has alone is smoothed away; what is common is left for the exact reading
    apart = sign * found[INNER] - found[OUTER]
    assert np.std(apart) < 0.35 * np.std(JITTER[INNER] - JITTER[OUTER])
    assert apart.mean() == pytest.approx(-3.0, abs=0.6)
    np.testing.assert_allclose(settled(path, np.ones((2, WIDTH)), cut, smooth_px=SMOOTH_PX), path, atol=0.02)


def test_a_wall_without_support_takes_the_path_of_the_other() -> None:
    swing = 12 * np.sin(2 * np.pi * COLUMN / 400 + 0.4)
    support = np.ones((2, WIDTH))
    support[INNER, 300:500] = 0.0
    path = np.array([swing, swing])
    path[INNER, 300:500] += 7.0
    found = settled(path, support, "lateral", smooth_px=SMOOTH_PX)
    assert np.abs(found - swing).max() < 0.1


def test_walls_of_a_stereo_cut_are_left_alone() -> None:
    path = JITTER.copy()
    np.testing.assert_array_equal(settled(path, np.ones((2, WIDTH)), "stereo", smooth_px=SMOOTH_PX), path)


def _floor_beside(wall: int, *, px: float, columns: slice, cut: Cut = "lateral") -> FloatArray:
    """Paths of a groove that swings, one of which runs beside its wall for a while."""
    path = np.array([SWING if cut == "lateral" else -SWING, SWING]) + 0.6 * JITTER
    path[wall, columns] += px
    return path


@pytest.mark.parametrize("cut", ["lateral", "vertical"])
@pytest.mark.parametrize("wall", [INNER, OUTER])
@pytest.mark.parametrize("px", [-14.0, 14.0])
def test_a_wall_that_parts_from_the_other_at_once_is_astray(cut: Cut, wall: int, px: float) -> None:
    support = np.ones((2, WIDTH))
    support[wall] = 0.7
    path = _floor_beside(wall, px=px, columns=slice(300, 420), cut=cut)
    lost = astray(path, support, cut, least_support=SEEN)
    expected = np.zeros((2, WIDTH), np.bool_)
    expected[wall, 300 - LEAST_PARTED_COLUMNS : 420 + LEAST_PARTED_COLUMNS] = True
    np.testing.assert_array_equal(lost, expected)
    found = settled(path, np.where(lost, 0.0, support), cut, smooth_px=SMOOTH_PX)
    assert np.abs(found - _floor_beside(wall, px=0.0, columns=slice(0), cut=cut)).max() < 4
    # believed, it would have drawn the other one along
    assert np.abs(settled(path, support, cut, smooth_px=SMOOTH_PX)[wall, 330:390] - found[wall, 330:390]).min() > 2


@pytest.mark.parametrize(
    "path",
    [
        _floor_beside(INNER, px=0.5 * MOST_PARTED_PX, columns=slice(300, 420)),
        _floor_beside(INNER, px=14.0, columns=slice(300, 300 + LEAST_PARTED_COLUMNS // 2)),
        np.array([SWING - 0.02 * np.abs(COLUMN - 400), SWING + 0.02 * np.abs(COLUMN - 400)]) * 0.8,
    ],
    ids=["near", "short", "warped"],
)
def test_what_warp_and_jitter_do_is_not_astray(path: FloatArray) -> None:
    assert not astray(path, np.ones((2, WIDTH)), "lateral", least_support=SEEN).any()


def test_nobody_is_astray_where_one_wall_alone_is_seen_or_both_are_driven() -> None:
    path = _floor_beside(OUTER, px=14.0, columns=slice(300, 420))
    support = np.ones((2, WIDTH))
    assert not astray(path, support, "stereo", least_support=SEEN).any()
    support[OUTER, 280:] = 0.1
    assert not astray(path, support, "lateral", least_support=SEEN).any()
    assert not astray(path[:, 300:390], support[:, :90], "lateral", least_support=SEEN).any()


@pytest.mark.parametrize("cells", [1, 2, 40])
@pytest.mark.parametrize("columns", [slice(0, 327), slice(16, 301)])
def test_cells_are_joined_by_straight_lines_between_their_middles(cells: int, columns: slice) -> None:
    found = np.random.default_rng(4).normal(size=(3, cells))
    drawn = along_columns(found, columns, cell_px=8, half_bell=half_bell(1.5))
    middle, x = (np.arange(cells) + 0.5) * 8 - 0.5, np.arange(columns.start, columns.stop)
    smooth = ndimage.gaussian_filter1d(found, 1.5, axis=1, mode="nearest")
    np.testing.assert_allclose(drawn, [np.interp(x, middle, one) for one in smooth], rtol=1e-12, atol=1e-14)


def test_a_wall_is_as_sharp_as_its_best_stripe_and_silent_where_it_is_lost() -> None:
    rng, wall = np.random.default_rng(5), np.array([OUTER, OUTER, INNER])
    support, lost = rng.uniform(0, 0.6, (3, WIDTH)), rng.uniform(size=(2, WIDTH)) < 0.2
    np.testing.assert_array_equal(of_walls(support, wall), [support[2], support[:2].max(axis=0)])
    np.testing.assert_array_equal(of_walls(support[:2], wall[:2])[INNER], 0.0)
    left = silenced(support, lost, wall, least_best_support=0.25)
    faint = support.max(axis=0) < 0.25
    assert 0 < faint.sum() < WIDTH
    np.testing.assert_array_equal(left, np.where(lost[wall] | faint, 0.0, support))
