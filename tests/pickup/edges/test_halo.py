"""How far burnt light shines: closed form, and pictures whose halos are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.pickup.edges.halo import FEWEST_RUNS, NO_HALO, Halo, learn_halo

Make = Callable[..., Any]
BURNT = 250


def _specks(count: int) -> tuple[tuple[float, float, float], ...]:
    """Single pixels, on land and on walls, far from each other."""
    row, column = np.meshgrid(np.arange(20.0, 280, 28), np.arange(20.0, 580, 28), indexing="ij")
    return tuple((r, c, 0.5) for r, c in zip(row.ravel()[:count], column.ravel()[:count], strict=True))


def test_a_halo_falls_off_by_e_in_its_length_along_each_axis() -> None:
    burnt = np.zeros((41, 31), np.bool_)
    burnt[20, 15] = True
    share = Halo(along_px=2.0, across_px=3.0).share(burnt)
    column, row = np.mgrid[-20:21, -15:16]
    expected = np.exp(-np.hypot(column / 2.0, row / 3.0))
    np.testing.assert_allclose(share[expected > 0.011], expected[expected > 0.011])
    assert not share[expected < 0.009].any()


@pytest.mark.parametrize("halo_px", [(2.0, 3.0), (1.2, 1.7), (2.5, 2.5)], ids=str)
def test_a_halo_is_as_long_as_it_was_drawn(photograph: Make, halo_px: tuple[float, float]) -> None:
    halo = learn_halo(photograph(columns=600).still(dust=_specks(200), halo_px=halo_px), BURNT)
    assert halo.along_px == pytest.approx(halo_px[0], rel=0.12)
    assert halo.across_px == pytest.approx(halo_px[1], rel=0.12)


def test_the_gain_does_not_matter(photograph: Make, picture_of: Make) -> None:
    picture = photograph(columns=600).still(dust=_specks(200), halo_px=(2.0, 3.0))
    bright = picture_of(picture.image.astype(np.uint16) * 200, white_level=65535)
    one, other = learn_halo(picture, BURNT), learn_halo(bright, 200 * BURNT)
    assert (one.along_px, one.across_px) == pytest.approx((other.along_px, other.across_px))


def test_dust_with_sharp_borders_has_hardly_a_halo(photograph: Make) -> None:
    halo = learn_halo(photograph(columns=600).still(dust=_specks(200)), BURNT)
    assert max(halo.along_px, halo.across_px) < 0.5


def test_too_little_dust_tells_of_no_halo(photograph: Make, picture_of: Make) -> None:
    drawn = photograph(columns=600)
    assert learn_halo(drawn.still(), BURNT) == NO_HALO
    assert learn_halo(drawn.still(dust=_specks(FEWEST_RUNS // 2 - 1), halo_px=(2.0, 3.0)), BURNT) == NO_HALO
    assert learn_halo(picture_of(np.full((10, 10), 255, np.uint8)), BURNT) == NO_HALO
    assert not NO_HALO.share(np.ones((3, 3), np.bool_)).any()


def test_what_is_not_seen_tells_nothing(photograph: Make) -> None:
    picture = photograph(columns=600).still(dust=_specks(200), halo_px=(2.0, 3.0))
    seen = np.broadcast_to(np.False_, picture.seen.shape)
    assert learn_halo(replace(picture, seen=seen), BURNT) == NO_HALO
