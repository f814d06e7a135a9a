"""Where the bench expects the sharp stripes, against real pictures of a groove."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import lateral_of_row_m
from gramoscope.disc.formats import Disc
from gramoscope.errors import ArgumentError
from gramoscope.microscope.cover_glass import CoverGlass

CLEAN = Path(__file__).parents[2].parent / "shared" / "captures" / "practice-clean"


def bench_of(manifest):
    disc, glass, camera = manifest["disc"], manifest["cover_glass"], manifest["camera"]
    return Bench(
        disc=Disc(groove_width_m=disc["groove_width_um"] * 1e-6),
        cover_glass=CoverGlass(
            thickness_m=glass["thickness_mm"] * 1e-3, refractive_index=glass["refractive_index"], side=glass["side"]
        ),
        sensor=Sensor(
            width_px=camera["width_px"], height_px=camera["height_px"], pixel_pitch_m=camera["pixel_pitch_um"] * 1e-6
        ),
        focus_below_land_m=manifest["microscope"]["focus_below_land_um"] * 1e-6,
    )


@pytest.fixture(scope="module")
def film():
    if not CLEAN.is_dir():
        pytest.skip(f"the practice capture {CLEAN.name} is not here")
    return bench_of(tomllib.loads((CLEAN / "capture.toml").read_text(encoding="utf-8")))


def sharpest_rows(group):
    """The three rows with the most energy of differences along the groove, in the first 40 µm of a group."""
    frames = tifffile.imread(CLEAN / "frames" / f"g{group:06d}.tif")[:, :, :101].astype(float)
    sharpness = gaussian_filter1d(np.mean(np.diff(frames, axis=2) ** 2, axis=(0, 2)), 5)
    peaks, found = find_peaks(sharpness, height=0.0)
    return np.sort(peaks[np.argsort(found["peak_heights"])[-3:]])


@pytest.mark.parametrize("group", [0, 3, 5, 12, 19, 24, 29])
def test_the_sharpest_rows_of_the_film_are_where_the_bench_expects_its_three_stripes(film, group):
    """Only the groove's own place is taken from the film; spacing, order and side of the glass are the bench's."""
    found = sharpest_rows(group)
    sensor = film.sensor
    middle = lateral_of_row_m(np.mean(found[:2]), height_px=sensor.height_px, pixel_pitch_m=sensor.pixel_pitch_m)
    np.testing.assert_allclose(found, film.stripe_rows(float(middle)), atol=4)


def test_the_first_stretch_of_the_film_shows_the_middle_of_the_groove_at_row_147(film):
    np.testing.assert_allclose(sharpest_rows(0), [102, 192, 288], atol=3)


def test_the_expected_rows_are_those_of_the_geometry_by_hand(film):
    """Depth 20 µm beside the glass and 57.4 under it, walls of 45°, 150 µm wide: 55.0 and 17.6 µm from the middle."""
    rows = np.array(film.stripe_rows(0.0)) - (film.sensor.height_px - 1) / 2
    np.testing.assert_allclose(rows * 0.390625, [-17.61, 17.61, 55.0], atol=0.01)


def test_glass_on_the_other_side_moves_the_third_stripe_to_the_other_wall(film):
    low = np.array(film.stripe_rows(5e-6))
    other = replace(film, cover_glass=replace(film.cover_glass, side="high"))
    middle = (film.sensor.height_px - 1) / 2 + 5e-6 / film.sensor.pixel_pitch_m
    np.testing.assert_allclose(other.stripe_rows(5e-6), np.sort(2 * middle - low))


def test_without_a_glass_there_are_two_stripes():
    bench = Bench(cover_glass=None)
    assert bench.focus_through_glass_m == bench.focus_below_land_m
    outer, inner = bench.stripe_rows()
    assert (inner - outer) * bench.sensor.pixel_pitch_m == pytest.approx(2 * 55e-6)


def test_the_edge_is_where_it_was_measured_or_else_in_the_middle():
    assert Bench(cover_glass=CoverGlass(edge_row=310.5)).glass_edge_row == 310.5
    assert Bench(cover_glass=CoverGlass()).glass_edge_row == 511.5


def test_the_passage_ends_with_the_last_column_of_the_last_frame():
    bench = Bench(
        sensor=Sensor(width_px=101, height_px=64, pixel_pitch_m=1e-6),
        sequence=Sequence(groups=3, frames_per_group=5, frame_step_m=2e-6, group_step_m=90e-6),
    )
    assert bench.passage_length_m == pytest.approx((2 * 90 + 4 * 2 + 100) * 1e-6)


@pytest.mark.parametrize(
    ("part", "wrong"),
    [
        (Disc, {"cut": "diagonal"}),
        (Disc, {"groove_width_m": 0.0}),
        (Disc, {"wall_angle_rad": 1.6}),
        (Sensor, {"bits": 7}),
        (Sensor, {"width_px": 8}),
        (Sensor, {"pixel_pitch_m": -1e-6}),
        (Sensor, {"rows": "up"}),
        (Sequence, {"groups": 0}),
        (Sequence, {"group_step_m": 0.0}),
        (Sequence, {"frame_step_m": -1e-6}),
    ],
)
def test_an_impossible_bench_is_refused(part, wrong):
    with pytest.raises(ArgumentError):
        part(**wrong)
