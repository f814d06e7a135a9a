"""Damage lies at fixed places of the record, whatever stretch is looked at."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from gramoscope.disc.damage import (
    HEAVY_DAMAGE,
    LIGHT_DAMAGE,
    NO_DAMAGE,
    Chip,
    Damage,
    Dust,
    Mark,
    Scratch,
    spoil_surface,
)
from gramoscope.errors import ArgumentError

PITCH_M = 0.4e-6
PLACE = {"groove_width_m": 150e-6, "groove_middle_m": 8e-6, "seed": 12}
LATERAL_M = np.arange(-260, 261) * PITCH_M


def _spoilt(damage: Damage, first: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    arc_m = np.arange(first, first + columns) * PITCH_M
    height_m, albedo = np.zeros((2, len(LATERAL_M), columns), np.float32)
    albedo += 1
    spoil_surface(height_m, albedo, damage.marks(arc_m[0], arc_m[-1], **PLACE), arc_m=arc_m, lateral_m=LATERAL_M)
    return height_m, albedo


def test_overlapping_stretches_see_the_same_damage() -> None:
    ruined = replace(HEAVY_DAMAGE, chips_per_m=3000)
    height_m, albedo = _spoilt(ruined, -900, 4000)
    part = _spoilt(ruined, 700, 1300)
    assert np.abs(height_m).max() > 5e-6  # there is something to see
    np.testing.assert_array_equal(part[0], height_m[:, 1600:2900])
    np.testing.assert_array_equal(part[1], albedo[:, 1600:2900])


def test_no_damage_leaves_the_surface_alone() -> None:
    height_m, albedo = _spoilt(NO_DAMAGE, 30, 2500)
    assert not height_m.any()
    assert (albedo == 1).all()


def test_marks_are_as_frequent_as_stated() -> None:
    kinds = Counter(type(mark) for mark in HEAVY_DAMAGE.marks(0.1, 0.3, **PLACE))
    for kind, per_metre in ((Scratch, 1200), (Chip, 250), (Dust, 2500)):
        assert kinds[kind] == pytest.approx(0.2 * per_metre, abs=4 * np.sqrt(0.2 * per_metre))


def test_more_dust_does_not_move_the_chips() -> None:
    def chips(damage: Damage) -> list[Mark]:
        return [mark for mark in damage.marks(0.0, 0.1, **PLACE) if isinstance(mark, Chip)]

    dusty = Damage(chips_per_m=200, dust_per_m=9000, scratches_per_m=50)
    assert chips(dusty) == chips(Damage(chips_per_m=200)) != []


def test_different_marks_lie_in_different_places() -> None:
    places = [mark.centre_m[0] for mark in HEAVY_DAMAGE.marks(0.0, 0.1, **PLACE)]
    assert len(set(places)) == len(places) > 100


def test_chips_lie_on_the_walls_and_leave_a_deep_irregular_hole() -> None:
    for mark in HEAVY_DAMAGE.marks(0.0, 0.2, **PLACE):
        if isinstance(mark, Chip):
            assert 20e-6 < abs(mark.centre_m[1] - 8e-6) < 75e-6
    chip = Chip(centre_m=(1e-4, 40e-6), length_m=150e-6, width_m=50e-6, depth_m=14e-6, tint=1.3, seed=4)
    arc_m = np.arange(0, 500) * PITCH_M
    height_m, albedo = np.zeros((2, len(LATERAL_M), 500), np.float32)
    spoil_surface(height_m, albedo, iter([chip]), arc_m=arc_m, lateral_m=LATERAL_M)
    hole = height_m[np.abs(LATERAL_M - 40e-6) < 12e-6][:, np.abs(arc_m - 1e-4) < 40e-6]
    assert -20e-6 < np.median(hole) < -8e-6
    assert hole.std() > 2e-6
    assert not height_m[LATERAL_M < 0].any()


def test_dust_lies_on_top_and_is_dark() -> None:
    speck = Dust(centre_m=(60e-6, -20e-6), radius_m=6e-6, elongation=1.4, angle_rad=0.7, tint=0.3)
    arc_m = np.arange(0, 400) * PITCH_M
    height_m = np.zeros((len(LATERAL_M), 400), np.float32)
    albedo = np.ones_like(height_m)
    spoil_surface(height_m, albedo, iter([speck]), arc_m=arc_m, lateral_m=LATERAL_M)
    row, column = np.argmin(np.abs(LATERAL_M + 20e-6)), 150
    assert height_m[row, column] == pytest.approx(6e-6, rel=0.02)
    assert albedo[row, column] == pytest.approx(0.3, rel=1e-5)
    assert height_m.min() == 0


def test_light_damage_is_lighter_than_heavy_damage() -> None:
    light, heavy = (len(list(damage.marks(0.0, 0.1, **PLACE))) for damage in (LIGHT_DAMAGE, HEAVY_DAMAGE))
    assert 0 < light < heavy / 2


@pytest.mark.parametrize("wrong", [{"dust_per_m": -1.0}, {"chip_length_m": 0.0}, {"chip_length_m": 2e-3}])
def test_impossible_damage_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArgumentError):
        Damage(**wrong)
