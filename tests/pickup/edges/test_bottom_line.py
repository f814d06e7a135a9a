"""The line along the bottom of a groove: where it was drawn, with true errors, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.edges.bottom_line import line_aside_px
from gramoscope.pickup.edges.edge_band import edge_band
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge

Make = Callable[..., Any]
CARTRIDGE = EdgeCartridge()


@pytest.mark.parametrize(
    "scene",
    [
        {"bottom": 40.0},
        {"bottom": -40.0},
        {"bottom": 60.0, "bottom_px": 4.0},
        {"bottom": 40.0, "noise": 10.0, "noise_blur_px": 1.0},
        {"bottom": 40.0, "light": 0.6},
    ],
    ids=str,
)
def test_the_line_is_found_where_it_was_drawn_and_errs_as_much_as_it_says(
    photograph: Make, scene: dict[str, float]
) -> None:
    drawn = photograph(columns=600, **scene)
    grooves = CARTRIDGE.find(drawn.still())
    assert len(grooves) == 3
    pulls = []
    for groove, true in zip(grooves, drawn.edges(), strict=True):
        seen = np.isfinite(groove.bottom_row_px)
        assert seen.mean() > 0.95
        np.testing.assert_array_equal(seen, np.isfinite(groove.bottom_row_sigma_px))
        error = (groove.bottom_row_px - true.mean(axis=0))[seen]
        assert abs(error.mean()) < 0.1
        pulls.append((error - error.mean()) / groove.bottom_row_sigma_px[seen])
    assert 0.8 < np.sqrt(np.mean(np.concatenate(pulls) ** 2)) < 1.25


@pytest.mark.parametrize("scene", [{}, {"noise": 25.0}, {"light": 0.6}, {"noise": 10.0, "noise_blur_px": 1.5}], ids=str)
def test_there_is_no_line_where_none_was_drawn(photograph: Make, scene: dict[str, float]) -> None:
    for seed in range(3):
        for groove in CARTRIDGE.find(photograph(columns=600, seed=seed, **scene).still()):
            assert np.isnan(groove.bottom_row_px).all()
            assert np.isnan(groove.bottom_row_sigma_px).all()


def test_columns_in_which_dust_hides_the_line_have_none(photograph: Make) -> None:
    drawn = photograph(columns=600, bottom=40.0)
    row = drawn.edges()[1].mean(axis=0)[300]
    groove = CARTRIDGE.find(drawn.still(dust=((row, 300.0, 8.0),)))[1]
    assert np.isnan(groove.bottom_row_px[295:306]).all()
    assert np.isfinite(groove.bottom_row_px[:280]).all()


@pytest.mark.parametrize("bottom_px", [1.5, 3.0, 4.5])
@pytest.mark.parametrize("cut_px", [0, 60])
def test_a_bottom_as_bright_as_land_tears_no_groove_in_two(
    photograph: Make, picture_of: Make, bottom_px: float, cut_px: int
) -> None:
    drawn = photograph(columns=600, rows=420, grooves=4, bottom=80.0, bottom_px=bottom_px)
    grooves = CARTRIDGE.find(picture_of(drawn.still().image[cut_px:].copy()))
    assert len(grooves) == 4
    for groove, true in zip(grooves, drawn.edges() - cut_px, strict=True):
        for wall in (OUTER, INNER):
            if true[wall].min() > 10:
                assert np.abs(groove.row_px[wall] - true[wall]).max() < 1.0


def test_the_line_is_looked_for_on_both_sides_of_the_middle(photograph: Make) -> None:
    drawn = photograph(columns=600, bottom=40.0)
    middle = drawn.edges()[1].mean(axis=0)
    for aside in (-6.0, 0.0, 7.0):
        band = edge_band(drawn.still(), middle - aside, wall=INNER, half_px=15, burnt=255)
        assert line_aside_px(band) == pytest.approx(aside, abs=1.0)
