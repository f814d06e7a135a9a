"""Photographs: their manifest, what is assumed of them, and that they come canonical whatever way they were stored."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from gramoscope.apparatus.groove_direction import groove_direction
from gramoscope.apparatus.manifest_still import StillManifest, is_still, read_still_manifest, write_still_manifest
from gramoscope.apparatus.opening import opened
from gramoscope.apparatus.still import StillCapture, open_picture, open_stills
from gramoscope.apparatus.still_bench import Row
from gramoscope.camera.frames_image import write_png
from gramoscope.disc.formats import Disc
from gramoscope.errors import ArgumentError, CaptureError, ManifestError, NoFramesError

SHARED = Path(__file__).parents[2].parent / "shared" / "data" / "micrographs"
ROWS, COLUMNS = 37, 53
SMALL = """
format = "gramoscope-capture/1"
[disc]
cut = "lateral"
[sequence]
kind = "still"
pictures = ["a.png"]
"""


@pytest.fixture
def picture() -> np.ndarray:
    return np.random.default_rng(3).integers(1, 255, (ROWS, COLUMNS), np.uint8)


def written(folder: Path, text: str, *names: str, image: np.ndarray | None = None) -> Path:
    (folder / "capture.toml").write_text(text, encoding="utf-8")
    for name in names:
        write_png(folder / name, np.full((ROWS, COLUMNS), 77, np.uint8) if image is None else image)
    return folder


number = st.floats(1e-6, 900, allow_nan=False, allow_subnormal=False)


@given(
    pitch_um=st.none() | number,
    rpm=st.none() | number,
    radius_mm=st.none() | number,
    angle=st.none() | st.floats(0.01, 1.55),
    axis=st.sampled_from([None, "columns", "rows"]),
    across=st.sampled_from([None, "inward", "outward"]),
    bits=st.none() | st.integers(8, 16),
    turn_px=st.none() | number,
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_a_manifest_comes_back_to_the_last_bit(
    tmp_path, pitch_um, rpm, radius_mm, angle, axis, across, bits, turn_px
) -> None:
    manifest = StillManifest(
        pictures=("a.png", "ü b.tif"),
        disc=Disc(
            "stereo", 77e-6, np.pi / 4 if angle is None else angle, "500N-16", {"title": 'a "b"', "date": "1911"}
        ),
        wall_angle_known=angle is not None,
        pixel_pitch_m=None if pitch_um is None else pitch_um / 1e6,
        rpm=rpm,
        radius_m=None if radius_mm is None else radius_mm / 1e3,
        bits=bits,
        groove_along=axis,
        along="backward",
        across=across,
        row=Row(2, 17.3, turn_px),
    )
    write_still_manifest(tmp_path / "capture.toml", manifest)
    assert read_still_manifest(tmp_path) == manifest
    assert is_still(tmp_path)


def test_an_unusual_angle_of_the_walls_is_not_lost_in_writing(tmp_path: Path) -> None:
    manifest = StillManifest(("a.png",), disc=Disc(wall_angle_rad=0.9))
    write_still_manifest(tmp_path / "capture.toml", manifest)
    assert read_still_manifest(tmp_path) == replace(manifest, wall_angle_known=True)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('cut = "lateral"', "", "missing key [disc] cut"),
        ('cut = "lateral"', 'cut = "sideways"', '"lateral" or "vertical" or "stereo"'),
        ('kind = "still"', 'kind = "still"\npixel_pitch_um = 2.0', "it belongs in [camera]"),
        ('kind = "still"', 'kind = "still"\nturn_pixels = 2', "the nearest known one is turn_px"),
        ('kind = "still"', 'kind = "still"\nturn_px = -2', "a number above 0"),
        ('pictures = ["a.png"]', "pictures = []", "a list of texts, one at least"),
        ('pictures = ["a.png"]', 'pictures = ["../a.png"]', "leaves the folder"),
        ('pictures = ["a.png"]', 'pictures = ["a.wav"]', "ends in .png"),
        ('pictures = ["a.png"]', 'pictures = ["a.png", "b.png"]', "no step_px"),
        ('pictures = ["a.png"]', 'pictures = ["a.png"]\nstep_px = 3', "a step_px"),
        ('pictures = ["a.png"]', 'pictures = ["a.png"]\nturn_px = 54', "show 53"),
    ],
)
def test_what_is_wrong_with_a_manifest_is_said(tmp_path: Path, old: str, new: str, words: str) -> None:
    folder = written(tmp_path, SMALL.replace(old, new), "a.png")
    with pytest.raises(ManifestError) as caught:
        open_stills(folder)
    assert words in str(caught.value)


def test_a_picture_outside_the_folder_is_not_opened(tmp_path: Path, picture: np.ndarray) -> None:
    write_png(tmp_path / "outside.png", picture)
    inside = tmp_path / "capture"
    inside.mkdir()
    (inside / "a.png").symlink_to(tmp_path / "outside.png")
    with pytest.raises(ManifestError, match="leads out"):
        open_stills(written(inside, SMALL))


@pytest.mark.parametrize("axis", ["columns", "rows"])
@pytest.mark.parametrize("along", ["forward", "backward"])
@pytest.mark.parametrize("across", ["inward", "outward"])
def test_s_grows_with_the_column_and_l_with_the_row(tmp_path, picture, axis, along, across) -> None:
    """A spot at a known place s, l of the record is found there whatever way the picture was stored."""
    stored = picture[::1] if across == "inward" else picture[::-1]
    stored = stored if along == "forward" else stored[:, ::-1]
    write_png(tmp_path / "a.png", np.ascontiguousarray(stored if axis == "columns" else stored.T))
    known = StillManifest((), groove_along=axis, along=along, across=across)
    assert np.array_equal(open_picture(tmp_path / "a.png", known).group(0).image, picture)


@pytest.mark.parametrize(
    ("axis", "along", "inward"),
    [
        ("columns", "forward", False),
        ("columns", "backward", True),
        ("rows", "forward", True),
        ("rows", "backward", False),
    ],
)
def test_a_photograph_from_above_is_right_handed(tmp_path, picture, axis, along, inward) -> None:
    """Travelling with s, the centre of the disc is to the left; in a picture rows grow downwards."""
    write_png(tmp_path / "a.png", picture)
    bench = open_picture(tmp_path / "a.png", StillManifest((), groove_along=axis, along=along)).bench
    assert (bench.sensor.rows == "inward") is inward
    forward = 1 if along == "forward" else -1
    left_of_travel = -forward if axis == "columns" else forward  # in rows downwards, or in columns to the right
    assert (left_of_travel > 0) is inward


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.bmp", "deep.png", "deep.tif", "colour.png", "colour.tif"])
def test_every_kind_of_file_gives_the_same_picture(tmp_path: Path, picture: np.ndarray, name: str) -> None:
    stored = picture.astype(np.uint16) * 257 if name.startswith("deep") else picture
    stored = np.repeat(stored[..., None], 3, axis=2) if name.startswith("colour") else stored
    if name.endswith("tif"):
        tifffile.imwrite(tmp_path / name, stored, photometric="rgb" if stored.ndim == 3 else "minisblack")
    elif name.endswith("bmp"):
        Image.fromarray(stored).save(tmp_path / name)
    else:
        write_png(tmp_path / name, stored)
    known = StillManifest((), groove_along="columns", across="inward")
    got = open_picture(tmp_path / name, known).group(0)
    assert got.white_level == (65535 if name.startswith("deep") else 255)
    assert np.array_equal(got.image / got.white_level, picture / 255)


def test_a_jpeg_opens_nearly_as_it_was(tmp_path: Path) -> None:
    smooth = np.add.outer(np.arange(40), np.arange(60)).astype(np.uint8)
    Image.fromarray(smooth).save(tmp_path / "a.jpg", quality=95)
    got = open_picture(tmp_path / "a.jpg", StillManifest((), groove_along="columns", across="inward")).group(0).image
    assert np.abs(got.astype(int) - smooth).max() <= 3


def test_what_nobody_knows_is_assumed_and_said(tmp_path: Path, picture: np.ndarray) -> None:
    write_png(tmp_path / "a.png", picture)
    bench = open_picture(tmp_path / "a.png").bench
    assert (bench.sensor.pixel_pitch_m, bench.rotation.rpm, bench.rotation.radius_m) == (4e-6, 78.0, 0.115)
    assert len(bench.assumed) == 3
    known = StillManifest((), pixel_pitch_m=2e-6, rpm=45.0, radius_m=0.1)
    assert open_picture(tmp_path / "a.png", known).bench.assumed == ()


def test_a_turn_fixes_the_radius(tmp_path: Path, picture: np.ndarray) -> None:
    write_png(tmp_path / "a.png", picture)
    known = StillManifest((), pixel_pitch_m=3e-6, rpm=45.0, groove_along="columns", row=Row(turn_px=50.0))
    bench = open_picture(tmp_path / "a.png", known).bench
    assert bench.assumed == ()
    assert bench.rotation.time_of_arc_s(50 * 3e-6) == pytest.approx(60 / 45)


def test_a_lost_picture_is_told_and_not_seen(tmp_path: Path, picture: np.ndarray) -> None:
    text = SMALL.replace('["a.png"]', '["gone.png", "a.png"]\nstep_px = 40')
    capture = open_stills(written(tmp_path, text, "a.png", image=picture))
    lost, found = capture.group(0), capture.group(1)
    assert not lost.seen.any()
    assert lost.problems == ("gone.png is missing",)
    assert found.seen.all()
    assert found.arc_start_m == pytest.approx(160e-6)
    with pytest.raises(NoFramesError, match=r"gone\.png"):
        open_stills(written(tmp_path, SMALL.replace("a.png", "gone.png")))


def test_what_is_no_picture_is_an_error_in_words(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="there is no picture"):
        open_picture(tmp_path / "a.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(NoFramesError, match="cannot be read"):
        open_picture(tmp_path / "text.png")
    with pytest.raises(ArgumentError, match="mend capture"):
        opened(written(tmp_path, SMALL, "a.png"), StillManifest((), pixel_pitch_m=1e-6))


def test_the_speed_of_a_folder_may_be_said_beside_it(tmp_path: Path) -> None:
    folder = written(tmp_path, SMALL, "a.png")
    capture = opened(folder, StillManifest((), rpm=45.0))
    assert isinstance(capture, StillCapture)
    assert capture.bench.rotation.rpm == 45.0
    assert not any("rpm" in one for one in capture.bench.assumed)


@pytest.mark.parametrize("width", [5, 40])
def test_the_direction_of_grooves_is_found(width: int) -> None:
    """Winding grooves under grain, with a bright fibre across them."""
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[:300, :400]
    wave = 0.3 * width * np.sin(2 * np.pi * columns / (9 * width))
    image = 60 * (np.sin(2 * np.pi * (rows + wave) / (2 * width)) > 0) + 60 + 12 * rng.standard_normal(rows.shape)
    image[80:140, 100:120] = 250
    stored = np.clip(image, 0, 255).astype(np.uint8)
    assert groove_direction(stored).groove_along == "columns"
    assert groove_direction(np.ascontiguousarray(stored.T)).groove_along == "rows"
    assert groove_direction(stored).coherence > 0.1


def test_a_picture_without_direction_is_told_as_doubtful(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.random.default_rng(0).integers(0, 255, (200, 200), np.uint8))
    assert any("--groove-along" in problem for problem in open_picture(tmp_path / "a.png").problems)
    blank = np.full((200, 200), 9, np.uint8)
    assert math.isclose(groove_direction(blank).coherence, 0.0)


@pytest.mark.parametrize("name", ["track_05.png", "track_09.png"])
def test_the_direction_of_real_grooves_is_found(name: str) -> None:
    if not (SHARED / name).is_file():
        pytest.skip(f"the practice picture {name} is not here")
    bench = open_picture(SHARED / name).bench
    assert bench.groove_along == "rows"
    assert bench.found_direction
    known = replace(StillManifest(()), groove_along="columns")
    assert open_picture(SHARED / name, known).bench.groove_along == "columns"
