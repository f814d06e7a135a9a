"""Light and shade, and the two focal planes."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.conventions import rad
from gramoscope.errors import ArgumentError
from gramoscope.microscope.illumination import Illumination
from gramoscope.simulation.optics import field_of, glass_share
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene

LAMPS = Illumination(coaxial=0.5, oblique=0.2, elevation_rad=rad(50.0), azimuth_rad=rad(90.0), hidden_per_m=2000.0)


def test_the_land_has_brightness_one() -> None:
    assert LAMPS.brightness(0.0, 0.0, height_m=0.0) == pytest.approx(1)
    assert LAMPS.brightness(0.0, 0.0, height_m=3e-6) == pytest.approx(1)


def test_the_wall_that_faces_the_lamp_is_brighter_by_lamberts_law() -> None:
    towards = LAMPS.brightness(0.0, -1.0, height_m=0.0)  # falls towards +l, where the lamp stands
    away = LAMPS.brightness(0.0, 1.0, height_m=0.0)
    lit = np.cos(rad(90.0 - 50.0) - rad(45.0)) / np.sin(rad(50.0))
    assert towards == pytest.approx(0.3 + 0.5 * np.sqrt(0.5) + 0.2 * lit)
    assert away == pytest.approx(0.3 + 0.5 * np.sqrt(0.5) + 0.2 * np.sin(rad(5.0)) / np.sin(rad(50.0)))


def test_light_is_lost_with_depth() -> None:
    assert LAMPS.brightness(0.0, 0.0, height_m=-50e-6) == pytest.approx(0.9)


def test_vignetting_takes_its_share_at_the_corners_only() -> None:
    field = Illumination(vignetting=0.2).field(height_px=101, width_px=301)
    assert field[50, 150] == pytest.approx(1)
    np.testing.assert_allclose(field[[0, 0, -1, -1], [0, -1, 0, -1]], 0.8)
    assert 1 - field[0, 150] == pytest.approx(0.2 / (1 + 3**2), rel=0.03)


@pytest.mark.parametrize("wrong", [{"exposure": 0.0}, {"coaxial": 0.8, "oblique": 0.3}, {"vignetting": 1.0}])
def test_impossible_light_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArgumentError):
        Illumination(**wrong)


def test_the_glass_share_changes_smoothly_across_the_edge(small: Scene) -> None:
    edge = small.bench.glass_edge_row
    half_px = small.mixed_zone_m / small.bench.sensor.pixel_pitch_m
    rows = edge + np.linspace(-1.5, 1.5, 301) * half_px
    share = glass_share(rows, scene=small)
    assert share[0] == share[49] == 1
    assert share[-50] == share[-1] == 0
    assert share[150] == pytest.approx(0.5)
    assert 0 <= -np.diff(share).max() < -np.diff(share).min() < 0.02


def test_the_glass_lies_on_its_side_or_is_not_there(small: Scene) -> None:
    glass = small.bench.cover_glass
    assert glass is not None
    high = replace(small, bench=replace(small.bench, cover_glass=replace(glass, side="high")))
    bare = replace(small, bench=replace(small.bench, cover_glass=None))
    rows = [0.0, small.bench.sensor.height_px - 1.0]
    np.testing.assert_array_equal(glass_share(rows, scene=small), [1, 0])
    np.testing.assert_array_equal(glass_share(rows, scene=high), [0, 1])
    np.testing.assert_array_equal(glass_share(rows, scene=bare), [0, 0])


def test_dirt_darkens_some_places_of_every_frame(small: Scene) -> None:
    clean, soiled = field_of(small), field_of(replace(small, rig=Rig(dirt=5)))
    lost = 1 - soiled / clean
    assert 0.1 < lost.max() <= 1
    assert np.median(lost) < 1e-3
