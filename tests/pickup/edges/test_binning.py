"""Pictures with hundreds of pixels from groove to groove: binned, read, and brought back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gramoscope.pickup.edges.binning import BINNED_PITCH_PX, binned_picture, binning_factor, unbinned
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.quality import NOT_MEASURED, Quality
from gramoscope.signal_path import GrooveEdges

Make = Callable[..., Any]
CARTRIDGE = EdgeCartridge()


def test_near_grooves_and_short_pictures_are_left_as_they_are() -> None:
    assert binning_factor(1.4 * BINNED_PITCH_PX, 5000) == 1
    assert binning_factor(1.6 * BINNED_PITCH_PX, 5000) == 2
    assert binning_factor(8 * BINNED_PITCH_PX, 5000) == 8
    assert binning_factor(8 * BINNED_PITCH_PX, 200) == 3
    assert binning_factor(8 * BINNED_PITCH_PX, 20) == 1


def test_no_mean_is_rounded_away(picture_of: Make) -> None:
    image = np.random.default_rng(1).integers(0, 200, (24, 36)).astype(np.uint8)
    found = binned_picture(picture_of(image), 4, 250)
    assert found.image.dtype == np.uint16
    assert found.white_level == 255 * 16
    np.testing.assert_array_equal(found.image, image.reshape(6, 4, 9, 4).sum(axis=(1, 3)))
    assert found.seen.all()


def test_sixteen_bits_stay_sixteen_bits(picture_of: Make) -> None:
    image = np.full((16, 16), 65_000, np.uint16)
    found = binned_picture(picture_of(image, white_level=65_535), 2, 65_500)
    assert found.white_level == 65_535
    assert (found.image == 65_000).all()


def test_what_is_burnt_brightens_no_block(picture_of: Make) -> None:
    image = np.full((8, 8), 100, np.uint8)
    image[0, 0] = 255  # one of sixteen: left out
    image[4:8, 4:6] = 255  # half a block: burnt
    found = binned_picture(picture_of(image), 4, 250)
    assert found.image.tolist() == [[1600, 1600], [1600, 255 * 16]]


def test_borders_go_on_as_the_last_pixels_do(picture_of: Make) -> None:
    image = np.repeat(np.arange(10, dtype=np.uint8)[:, None] * 10, 11, axis=1)
    found = binned_picture(picture_of(image), 4, 250)
    assert found.image.shape == (3, 3)
    assert found.image[:, 2].tolist() == [16 * 15, 16 * 55, 16 * 87.5]


def test_places_come_back_between_the_blocks() -> None:
    factor, columns = 5, 203
    blocks = -(-columns // factor)

    def course(column: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        return 300 + 0.1 * column + 12 * np.sin(2 * np.pi * column / 60)

    # the middle of block j is column 5 j + 2, and of row r of blocks row 5 r + 2
    row = (course(factor * np.arange(blocks) + 2.0) - 2) / factor
    flags = np.zeros((2, blocks), np.uint16)
    flags[1, 7] = np.uint16(Quality.INTERPOLATED)
    hidden = np.where(np.arange(blocks) < 10, np.nan, row)
    edges = GrooveEdges(3, np.stack([row, hidden]), np.full((2, blocks), 0.2), 4.0, flags, hidden, hidden * 0 + 0.1)
    found = unbinned(edges, factor, columns)
    column = np.arange(float(columns))
    np.testing.assert_allclose(found.row_px[0, 5:-5], course(column)[5:-5], atol=0.02)
    assert np.isnan(found.row_px[1, :47]).all()
    np.testing.assert_allclose(found.row_px[1, 55:-5], course(column)[55:-5], atol=0.02)
    np.testing.assert_array_equal(np.isnan(found.bottom_row_px), np.isnan(found.row_px[1]))
    assert np.nanmax(found.row_sigma_px) == pytest.approx(1.0)
    assert found.correlation_samples == 20.0
    assert np.flatnonzero(found.flags[1]).tolist() == [35, 36, 37, 38, 39]
    assert found.number == 3


def test_an_edge_that_is_nowhere_stays_nowhere() -> None:
    nothing = np.full((2, 20), np.nan)
    flags = np.full((2, 20), np.uint16(NOT_MEASURED))
    found = unbinned(GrooveEdges(0, nothing, nothing, 1.0, flags, nothing[0], nothing[0]), 3, 60)
    assert np.isnan(found.row_px).all()
    assert found.row_px.shape == (2, 60)


def test_a_picture_of_four_times_the_pixels_has_its_edges_four_times_as_far(photograph: Make, picture_of: Make) -> None:
    drawn = photograph(pitch_px=120.0, width_px=70.0, rows=360).still()
    large = picture_of(np.kron(drawn.image, np.ones((4, 4), np.uint8)))
    here, there = CARTRIDGE.find(drawn), CARTRIDGE.find(large)
    assert len(here) == len(there) == 3
    for small, big in zip(here, there, strict=True):
        # column 4 j + 1 is as near to the middle of its block as 4 j + 2
        middle = 0.5 * (big.row_px[:, 1::4] + big.row_px[:, 2::4])
        np.testing.assert_allclose(middle, 4 * small.row_px + 1.5, atol=0.05)
        np.testing.assert_allclose(big.row_sigma_px[:, ::4], 4 * small.row_sigma_px, rtol=0.02)
        np.testing.assert_array_equal(big.flags[:, ::4], small.flags)


@pytest.mark.parametrize("scene", [{"blur_px": 5.2}, {"blur_px": 1.3}, {"blur_px": 5.2, "noise_blur_px": 4.0}])
def test_errors_are_true_in_large_pictures(photograph: Make, scene: dict[str, float]) -> None:
    drawn = photograph(
        columns=1600, rows=1200, pitch_px=400.0, first_px=80.3, width_px=240.0, swing_px=16.0, period_px=320.0, **scene
    )
    grooves = CARTRIDGE.find(drawn.still())
    assert len(grooves) == 3
    pulls = []
    for groove, true in zip(grooves, drawn.edges(), strict=True):
        assert np.mean(groove.flags == 0) > 0.98
        off = groove.row_px - true
        pulls.append((off - off.mean(axis=1, keepdims=True)) / groove.row_sigma_px)
    # without binning errors were five to fourteen times the claimed ones, where the blur is wide
    assert 0.8 < np.sqrt(np.mean(np.square(pulls))) < 1.2


@pytest.mark.parametrize(("blur_px", "noise"), [(2.0, 0.0), (5.2, 0.5)])
def test_large_pictures_with_next_to_no_noise_have_edges_too(photograph: Make, blur_px: float, noise: float) -> None:
    drawn = photograph(
        columns=800, rows=600, pitch_px=200.0, first_px=40.0, width_px=120.0, noise=noise, swing_px=6.0, blur_px=blur_px
    )
    grooves = CARTRIDGE.find(drawn.still())
    assert len(grooves) == 3
    for groove, true in zip(grooves, drawn.edges(), strict=True):
        assert np.mean(groove.flags == 0) > 0.9
        measured = groove.flags == 0
        assert (groove.row_px - true)[measured].std() < 0.05
