import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.apparatus.manifest import Manifest, read_bench, read_manifest, write_manifest
from gramoscope.camera.sensor import Sensor
from gramoscope.disc.formats import Disc
from gramoscope.errors import ArgumentError, CaptureError, ManifestError
from gramoscope.microscope.cover_glass import CoverGlass
from gramoscope.microscope.objective import Objective
from gramoscope.turntable.rotation import Rotation

WHOLE = """
format = "gramoscope-capture/1"

[disc]
cut = "vertical"
rpm = 80
radius_mm = 121.7
wall_angle_deg = 43.7
date = 1911-05-03
matrix = 1234

[microscope]
magnification = 40.0
numerical_aperture = 0.65
tube_length_mm = 160.0

[cover_glass]
thickness_mm = 0.11
refractive_index = 1.515
edge_row = 310.0
side = "low"

[camera]
width_px = 1280
height_px = 1024
bits = 12
colour = "rgb"
pixel_pitch_um = 0.390625
columns = "backward"
rows = "inward"

[sequence]
frames = "frames/g{group:06d}.tif"
groups = 60
frames_per_group = 12
frame_step_um = 0.8
group_step_um = 469.53
"""


def number(low, high, **options):
    return st.floats(low, high, allow_nan=False, allow_subnormal=False, **options)


TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
GLASSES = st.builds(
    CoverGlass,
    thickness_m=number(1e-6, 9e-3),
    refractive_index=number(1.01, 3.9),
    side=st.sampled_from(["low", "high"]),
    edge_row=st.none() | number(-900, 900),
    focus_shift_m=st.none() | number(1e-7, 9e-3),
)
BENCHES = st.builds(
    Bench,
    disc=st.builds(
        Disc,
        cut=st.sampled_from(["lateral", "vertical", "stereo"]),
        groove_width_m=number(1e-6, 9e-3),
        wall_angle_rad=number(0.001, 1.569),
        characteristic=st.none() | TEXT.filter(bool),
        notes=st.dictionaries(st.sampled_from(["title", "performer", "label", "matrix", "side", "date"]), TEXT),
    ),
    rotation=st.builds(Rotation, rpm=number(1, 900), radius_m=number(0.05, 0.9), pitch_m=number(0, 1e-6)),
    objective=st.builds(
        Objective,
        magnification=number(1, 900),
        numerical_aperture=number(0.01, 0.99),
        tube_length_m=number(1e-3, 9),
    ),
    cover_glass=st.none() | GLASSES,
    sensor=st.builds(
        Sensor,
        width_px=st.integers(16, 5000),
        height_px=st.integers(16, 5000),
        bits=st.integers(8, 16),
        colour=st.sampled_from(["mono", "rgb"]),
        pixel_pitch_m=number(1e-9, 9e-4),
        columns=st.sampled_from(["forward", "backward"]),
        rows=st.sampled_from(["inward", "outward"]),
    ),
    sequence=st.builds(
        Sequence,
        groups=st.integers(1, 9000),
        frames_per_group=st.integers(1, 100),
        frame_step_m=number(0, 1e-5),
        group_step_m=number(1e-9, 1e-3),
    ),
    focus_below_land_m=number(-9e-4, 9e-4),
)


@settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
)
@given(bench=BENCHES, log=st.none() | st.just("frames.csv"))
def test_a_bench_comes_back_to_the_last_bit(tmp_path, bench, log):
    path = tmp_path / "capture.toml"
    write_manifest(path, bench, frames="frames/g{group:06d}.tif", log=log)
    assert read_manifest(path) == Manifest(bench, "frames/g{group:06d}.tif", log)


@pytest.fixture
def manifest(tmp_path):
    """Write a manifest, with some words replaced, and return its path."""

    def manifest(*changes, text=WHOLE):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "capture.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return manifest


def test_units_become_si_and_what_is_optional_has_its_default(manifest):
    bench = read_manifest(manifest()).bench
    assert bench.disc == Disc("vertical", 150e-6, math.radians(43.7), None, {"date": "1911-05-03", "matrix": "1234"})
    assert bench.rotation == Rotation(80.0, 0.1217, 0.0)
    assert bench.objective == Objective(40.0, 0.65, 0.16)
    assert bench.cover_glass == CoverGlass(0.00011, 1.515, "low", 310.0, None)
    assert bench.sensor == Sensor(1280, 1024, 12, "rgb", 0.390625e-6, "backward", "inward")
    assert bench.sequence == Sequence(60, 12, 0.8e-6, 469.53e-6)
    assert bench.focus_below_land_m == 20e-6


def test_the_manifest_can_be_named_by_its_folder(manifest):
    assert read_manifest(manifest().parent).frames == "frames/g{group:06d}.tif"


def test_a_microscope_without_glass_has_no_such_table(manifest):
    start, end = WHOLE.index("[cover_glass]"), WHOLE.index("[camera]")
    assert read_manifest(manifest((WHOLE[start:end], ""))).bench.cover_glass is None


def test_rows_that_run_outward_turn_glass_edge_and_side_round(manifest):
    glass = read_manifest(manifest(('rows = "inward"', 'rows = "outward"'))).bench.cover_glass
    assert glass.edge_row == 1023 - 310
    assert glass.side == "high"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("radius_mm", "radius_m", ["unknown key [disc] radius_m: ", "radius_mm", "missing key [disc] radius_mm"]),
        ("rpm = 80\n", "", ["missing key [disc] rpm", "above 0"]),
        ("[camera]\n", "[camera]\ngroups = 3\n", ["unknown key [camera] groups", "belongs in [sequence]"]),
        ("[cover_glass]", "[coverglass]", ["unknown key coverglass", "cover_glass"]),
        ("bits = 12", "bits = 18", ["[camera] bits = 18", "at least 8 and at most 16"]),
        ("bits = 12", "bits = 12.0", ["bits = 12.0", "whole number"]),
        ("groups = 60", "groups = true", ["groups = True", "whole number"]),
        ("rpm = 80", "rpm = nan", ["rpm = NaN", "above 0"]),
        ("rpm = 80", "rpm = 1e999", ["rpm = 1E+999", "at most 1000"]),
        ("rpm = 80", 'rpm = "80"', ["rpm = '80'", "a number"]),
        ("rpm = 80", "rpm = false", ["rpm = False", "a number"]),
        ("magnification = 40.0", "magnification = 1e-400", ["magnification", "positive"]),
        ('"vertical"', '"hill-and-dale"', ["cut = 'hill-and-dale'", '"lateral" or "vertical" or "stereo"']),
        ("capture/1", "capture/2", ["format = 'gramoscope-capture/2'", '"gramoscope-capture/1"']),
        ("rpm = 80", "rpm = = 80", ["not TOML", "line 6"]),
        ("rpm = 80", "rpm = 80\nrpm = 78", ["not TOML", "line 7"]),
        ("[disc]", "[discs]", ["missing key [disc]", "a table", "unknown key discs"]),
        ("frames/g", "../g", ["leaves the folder"]),
        ("{group:06d}", "{groups:06d}", ["{groups}", "{group} and {frame} only"]),
        ("{group:06d}", "", ["the same for all 60 groups"]),
        (
            "group_step_um = 469.53",
            'group_step_um = 469.53\nlog = "/etc/frames.csv"',
            ["leaves the folder", "frames.csv"],
        ),
        ("rpm = 80", "rpm = 80\npitch_um = 9000", []),
    ],
)
def test_what_is_wrong_is_named(manifest, old, new, words):
    path = manifest((old, new))
    if not words:
        read_manifest(path)
        return
    with pytest.raises(ManifestError) as caught:
        read_manifest(path)
    for word in words:
        assert word in str(caught.value)


def test_a_groove_that_would_reach_the_centre_is_an_error(manifest):
    with pytest.raises(ManifestError, match="centre of the disc"):
        read_manifest(manifest(("rpm = 80", "rpm = 80\npitch_um = 10000"), ("groups = 60", "groups = 10000000")))


def test_all_problems_are_named_at_once(manifest):
    with pytest.raises(ManifestError) as caught:
        read_manifest(
            manifest(("rpm = 80", "rpm = -1"), ("bits = 12", "bitts = 12"), ('side = "low"', 'side = "left"'))
        )
    text = str(caught.value)
    assert "4 problems" in text
    assert text.index("rpm = -1") < text.index("side = 'left'") < text.index("missing key [camera] bits")
    assert "bitts" in text


@pytest.mark.parametrize("name", ["nowhere", "capture.toml/inside"])
def test_a_missing_file_or_folder_is_named(tmp_path, name):
    (tmp_path / "capture.toml").write_text(WHOLE)
    with pytest.raises(CaptureError, match="there is no"):
        read_manifest(tmp_path / Path(name) / "capture.toml")


def test_bytes_that_are_no_text_are_an_error(tmp_path):
    path = tmp_path / "capture.toml"
    path.write_bytes(b"format = \xff\xfe")
    with pytest.raises(ManifestError, match="UTF-8"):
        read_manifest(path)


def test_a_byte_order_mark_does_no_harm(tmp_path):
    path = tmp_path / "capture.toml"
    path.write_text(WHOLE, encoding="utf-8-sig")
    assert read_manifest(path).bench.rotation.rpm == 80


def test_a_bench_for_filming_needs_no_frames_and_no_groups(manifest):
    path = manifest(('frames = "frames/g{group:06d}.tif"\ngroups = 60\n', ""))
    assert read_bench(path).sequence == Sequence(1, 12, 0.8e-6, 469.53e-6)
    with pytest.raises(ManifestError, match=r"missing key \[sequence\] frames"):
        read_manifest(path)


def test_text_of_every_kind_comes_back(tmp_path):
    title = 'a "quote", a \\ and\ta tab\nnext line \x7f \x00 Dvořák 🎻 #[x]'
    bench = Bench(disc=Disc(notes={"title": title}))
    write_manifest(tmp_path / "capture.toml", bench)
    assert read_manifest(tmp_path).bench.disc.notes == {"title": title}


@pytest.mark.parametrize(
    "bench",
    [Bench(disc=Disc(notes={"colour": "red"})), Bench(focus_below_land_m=1.0), Bench(sequence=Sequence(groups=10**8))],
)
def test_a_bench_that_the_format_cannot_hold_is_not_written(tmp_path, bench):
    with pytest.raises(ArgumentError):
        write_manifest(tmp_path / "capture.toml", bench)
    assert not (tmp_path / "capture.toml").exists()


def test_round_numbers_are_written_as_people_write_them(tmp_path):
    bench = Bench(disc=Disc(wall_angle_rad=np.pi / 4))
    write_manifest(tmp_path / "capture.toml", bench)
    text = (tmp_path / "capture.toml").read_text()
    for line in ("radius_mm = 115.0", "wall_angle_deg = 45.0", "pixel_pitch_um = 0.390625", "group_step_um = 469.53"):
        assert line in text
