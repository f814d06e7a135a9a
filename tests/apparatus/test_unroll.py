"""Discs straightened: the centre is found, the grooves come out where they are, and nothing half-written stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gramoscope.apparatus import unroll as unroll_module
from gramoscope.apparatus.still import open_stills
from gramoscope.apparatus.unroll import disc_scan, unroll
from gramoscope.camera.frames_image import write_png
from gramoscope.errors import ArgumentError, CaptureError, OutputError
from gramoscope.simulation.still import StillScene, cut_still, disc_picture, still_picture
from gramoscope.turntable.disc_centre import DiscCentre, refined_centre, rough_centre

RADIUS_PX = 330
SCENE = StillScene(
    turns=7,
    turn_px=round(2 * np.pi * RADIUS_PX),
    pixel_pitch_m=20e-6,
    level_m_s=0.004,
    dust_per_m=5.0,
    noise=1.5,
    seed=6,
)
CENTRE = (371.37, 352.81)
"""Row and column; the picture is neither square nor centred."""


def picture(squeeze: float = 1.0) -> np.ndarray:
    time_s = np.arange(round(8000 * SCENE.seconds)) / 8000
    passage = cut_still(np.sin(2 * np.pi * 53.0 * time_s), rate_hz=8000.0, scene=SCENE)
    return disc_picture(SCENE, passage, centre_px=CENTRE, size_px=(730, 700), squeeze=squeeze)


@pytest.fixture(scope="module")
def disc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("disc") / "disc.png"
    write_png(path, picture())
    return path


def test_the_centre_is_found_to_a_tenth_of_a_pixel(disc: Path) -> None:
    scan = disc_scan(disc)
    assert scan.centre.row_px == pytest.approx(CENTRE[0], abs=0.1)
    assert scan.centre.column_px == pytest.approx(CENTRE[1], abs=0.1)
    assert scan.centre.pitch_px == pytest.approx(13.0, abs=0.5)
    assert scan.outer_px == pytest.approx(RADIUS_PX, abs=13)
    assert scan.inner_px == pytest.approx(RADIUS_PX - 9 * 13, abs=26)


def test_a_start_that_is_off_is_put_right() -> None:
    image = picture()
    row, column = rough_centre(image)
    assert np.hypot(row - CENTRE[0], column - CENTRE[1]) < 8
    found = refined_centre(image, (CENTRE[0] + 2.5, CENTRE[1] - 2.0), inner_px=225, outer_px=325)
    assert np.hypot(found.row_px - CENTRE[0], found.column_px - CENTRE[1]) < 0.1


def test_pixels_that_are_not_square_are_an_ellipse() -> None:
    """Circles squeezed by 1 % in height: radii along the rows are that much longer, half of it as cos 2θ."""
    found = refined_centre(picture(squeeze=1.01), CENTRE, inner_px=225, outer_px=322)
    assert found.cos2_px / found.mean_radius_px == pytest.approx(0.005, abs=5e-4)
    assert abs(found.sin2_px / found.mean_radius_px) < 5e-4


def test_places_go_anticlockwise_as_one_looks_down_on_the_record() -> None:
    row, column = DiscCentre(10.0, 20.0).places([0.0, np.pi / 2, np.pi], 5.0)
    assert np.allclose(row, [10, 5, 10])
    assert np.allclose(column, [25, 20, 15])


def test_what_comes_out_is_the_still(disc: Path, tmp_path: Path) -> None:
    scan = replace(disc_scan(disc, outer_px=RADIUS_PX - 4, inner_px=RADIUS_PX - 100))
    manifest = unroll(scan, tmp_path / "capture", disc=SCENE.disc, pixel_pitch_m=20e-6, rpm=78.0)
    capture = open_stills(tmp_path / "capture")
    assert capture.manifest == manifest
    assert capture.bench.rotation.time_of_arc_s(scan.turn_px * 20e-6) == pytest.approx(60 / 78)
    time_s = np.arange(round(8000 * SCENE.seconds)) / 8000
    passage = cut_still(np.sin(2 * np.pi * 53.0 * time_s), rate_hz=8000.0, scene=SCENE)
    flat = still_picture(replace(SCENE, noise=0.0), passage).astype(float)
    image = capture.group(0).image.astype(float)
    ours = image[:90, np.linspace(0, scan.turn_px, SCENE.turn_px, endpoint=False).astype(int)]
    theirs = flat[4:94, : SCENE.turn_px]
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.98


def test_turns_are_counted_from_the_outside(disc: Path) -> None:
    scan = disc_scan(disc, outer_px=RADIUS_PX - 2.0, turns=3)
    assert scan.outer_px - scan.inner_px == pytest.approx(4.5 * 13, abs=3)


def test_a_failure_leaves_nothing(disc: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(unroll_module, "write_png", full)
    with pytest.raises(OutputError, match="No space left"):
        unroll(disc_scan(disc), tmp_path / "capture")
    assert list(tmp_path.iterdir()) == []


def test_bad_input_is_said(disc: Path, tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="is missing"):
        disc_scan(tmp_path / "no.png")
    with pytest.raises(ArgumentError, match="inside the picture"):
        disc_scan(disc, centre_px=(5000.0, 3.0))
    with pytest.raises(ArgumentError, match="as far as the picture goes"):
        disc_scan(disc, outer_px=400.0)
    (tmp_path / "capture").mkdir()
    (tmp_path / "capture" / "mine.txt").write_text("keep")
    with pytest.raises(OutputError, match="exists"):
        unroll(disc_scan(disc), tmp_path / "capture")
    write_png(tmp_path / "blank.png", np.full((200, 200), 100, np.uint8))
    with pytest.raises(ArgumentError, match="without any change"):
        disc_scan(tmp_path / "blank.png")
