"""The rendered surface against its parts: section, texture and light, put together anew in NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.conventions import rad
from gramoscope.disc.groove import section
from gramoscope.disc.texture import ACROSS, sample_across
from gramoscope.microscope.illumination import Illumination
from gramoscope.simulation.blur_grids import PER_ROW
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene
from gramoscope.simulation.surface import Strip, surface_strip

# far enough from the start for the sound to have risen
FIRST, COLUMNS, MARGIN_PX, STAGE_M = 35_190, 150, 24, 3.3e-6


@pytest.fixture
def oblique(small: Scene) -> Scene:
    """A lamp at one side, uneven walls, and a groove that does not run through the middle."""
    return replace(
        small,
        illumination=Illumination(oblique=0.4, azimuth_rad=rad(40.0), elevation_rad=rad(35.0)),
        rig=Rig(inner_angle_error_rad=rad(2.0), outer_angle_error_rad=rad(-1.0)),
        groove_middle_m=-6e-6,
        level_m_s=0.08,
    )


def _strip(scene: Scene, passage: Passage) -> Strip:
    return surface_strip(scene, passage, first_column=FIRST, columns=COLUMNS, margin_px=MARGIN_PX, stage_m=STAGE_M)


def _across_m(scene: Scene, passage: Passage, strip: Strip) -> np.ndarray:
    return strip.lateral_m[:, None] - scene.groove_middle_m - passage.displacement_m(strip.arc_m)[0]


@pytest.fixture
def both_ways(oblique: Scene, sound: np.ndarray) -> Passage:
    """A passage that moves sideways and up at once: the right channel alone."""
    stereo = replace(oblique.bench, disc=replace(oblique.bench.disc, cut="stereo"))
    return cut_passage(
        np.stack([np.zeros_like(sound), sound], axis=1), rate_hz=48_000, scene=replace(oblique, bench=stereo)
    )


def test_the_surface_is_the_section_moved_by_the_groove(oblique: Scene, both_ways: Passage) -> None:
    strip = _strip(oblique, both_ways)
    lift_m = both_ways.displacement_m(strip.arc_m)[1]
    expected = oblique.groove.height_m(_across_m(oblique, both_ways, strip), lift_m=lift_m)
    np.testing.assert_allclose(strip.height_m, expected, atol=1e-10)
    rows_m = strip.lateral_m.reshape(-1, PER_ROW)
    assert rows_m[MARGIN_PX].mean() == pytest.approx(-214.5 * oblique.bench.sensor.pixel_pitch_m + STAGE_M)
    np.testing.assert_allclose(np.diff(strip.lateral_m), oblique.bench.sensor.pixel_pitch_m / PER_ROW, rtol=1e-6)
    assert strip.arc_m[0] == pytest.approx(FIRST * oblique.bench.sensor.pixel_pitch_m)


def test_light_is_shade_times_texture(oblique: Scene, both_ways: Passage) -> None:
    strip = _strip(oblique, both_ways)
    pitch_m = oblique.bench.sensor.pixel_pitch_m
    field = oblique.texture.field(FIRST, COLUMNS, pitch_m=pitch_m, seed=oblique.seed)
    slope_s = np.gradient(strip.height_m.astype(float), pitch_m, axis=1)
    slope_l = np.gradient(strip.height_m.astype(float), pitch_m / PER_ROW, axis=0)
    shade = oblique.illumination.brightness(slope_s, slope_l, height_m=strip.height_m)
    across_m = _across_m(oblique, both_ways, strip)
    straight = _straight(strip)
    assert straight.mean() > 0.5
    assert np.abs(both_ways.slope(strip.arc_m)).max() > 0.025  # the walls lean along the groove as well
    for row in range(4, len(strip.lateral_m) - 4, 3):
        on_land = strip.height_m[row] == 0
        place_m = np.array([section(x, oblique.groove.shape)[2] for x in across_m[row]])
        place_m[on_land] = strip.lateral_m[row] - oblique.groove_middle_m + pitch_m * ACROSS / 2
        expected = shade[row] * sample_across(field, place_m, pitch_m=pitch_m)
        np.testing.assert_allclose(strip.light[row][straight[row]], expected[straight[row]], rtol=2e-3, atol=1e-4)


def _straight(strip: Strip) -> np.ndarray:
    """Where the surface is flat over some pixels either way, so that differences give its slope."""
    bend = np.abs(np.diff(strip.height_m, 2, axis=0, prepend=np.nan, append=np.nan))
    bend += np.abs(np.diff(strip.height_m, 2, axis=1, prepend=np.nan, append=np.nan))
    return np.asarray(bend < 2e-10)


def test_a_warp_lifts_everything(oblique: Scene, both_ways: Passage) -> None:
    warped = replace(oblique, rig=replace(oblique.rig, warp_m=9e-6, warp_length_m=0.5e-3))
    lifted = _strip(warped, both_ways).height_m - _strip(oblique, both_ways).height_m
    expected = 9e-6 * np.sin(2 * np.pi * _strip(oblique, both_ways).arc_m / 0.5e-3)
    np.testing.assert_allclose(lifted, np.broadcast_to(expected, lifted.shape), atol=1e-10)
