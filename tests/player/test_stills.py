"""Photographs played: what comes out, where each groove lies in it, and what is said when little is known."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.manifest_still import StillManifest
from gramoscope.apparatus.opening import opened
from gramoscope.apparatus.still import open_picture, open_stills
from gramoscope.camera.frames_image import write_png
from gramoscope.conventions import rad
from gramoscope.disc.formats import Disc
from gramoscope.errors import ArgumentError, CaptureError
from gramoscope.player.again import load_again
from gramoscope.player.outputs import BESIDE
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe, recipe_for
from gramoscope.player.stills import SILENCE_S
from gramoscope.quality import NOT_MEASURED
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.still import (
    StillScene,
    cut_still,
    edges_of_turn,
    still_picture,
    still_truth_m_s,
    write_still,
)

RATE_HZ = 24_000
SCENE = StillScene(
    turns=3, turn_px=1800, overlap_px=160, rpm=200.0, level_m_s=0.0077, grain=0.02, noise=1.0, dust_per_m=30.0, seed=8
)
PRACTICE = Path(__file__).parents[2].parent / "shared" / "data" / "micrographs"


@pytest.fixture(scope="module")
def passage() -> Passage:
    """Two tones that run through all turns."""
    time_s = np.arange(round(8000 * SCENE.seconds)) / 8000
    sound = np.sin(2 * np.pi * 95.6 * time_s + 1.1) + 0.7 * np.sin(2 * np.pi * 158.7 * time_s)
    return cut_still(sound, rate_hz=8000.0, scene=SCENE)


def played(capture: Any, out: Path, **settings: Any) -> dict[str, Any]:
    play(capture, load_recipe(recipe_for(capture)), out, Settings(rate_hz=float(RATE_HZ), workers=2, **settings))
    return json.loads((out / "report.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def spiral(passage: Passage, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A row of two pictures that show a turn and a little more, played."""
    folder = tmp_path_factory.mktemp("spiral")
    write_still(folder / "capture", SCENE, passage, pictures=2, shared_px=90)
    return folder / "out", played(open_stills(folder / "capture"), folder / "out")


@pytest.fixture(scope="module")
def single(passage: Passage, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    """One picture of which nothing is known, its grooves running down."""
    folder = tmp_path_factory.mktemp("single")
    image = np.ascontiguousarray(still_picture(SCENE, passage, 200, 1100).T)
    write_png(folder / "grooves.png", image)
    return folder / "grooves.png", folder / "out", played(open_picture(folder / "grooves.png"), folder / "out")


def test_a_spiral_is_one_passage_and_sounds_as_it_was_cut(
    spiral: tuple[Path, dict[str, Any]], passage: Passage
) -> None:
    out, report = spiral
    assert len(report["grooves"]["played"]) == 1
    assert report["grooves"]["turn_px"] == pytest.approx(SCENE.turn_px, abs=0.1)
    heard = 0.5 * soundfile.read(out / "flat.wav")[0]
    cut = still_truth_m_s(SCENE, passage, rate_hz=RATE_HZ)[0]
    inside = slice(RATE_HZ // 20, cut.size - RATE_HZ // 20)
    assert np.corrcoef(heard[inside], cut[inside])[0, 1] > 0.998
    error = np.std(heard[inside] - cut[inside])
    # edges claim what they err by; of two tones the smoother leaves less than of the music that it thinks of
    assert 0.5 < report["noise_estimate"]["sigma_rms_cm_s"] / 100 / error < 2.5
    assert report["scale"]["known"]
    assert report["capture_problems"] == report["problems"] == []


def test_each_groove_has_its_place_in_the_sound(single: tuple[Path, Path, dict[str, Any]]) -> None:
    _, out, report = single
    rows = list(csv.DictReader((out / "grooves.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == SCENE.turns + 1 == len(report["grooves"]["played"])
    starts = [float(row["start_s"]) for row in rows]
    stops = [float(row["stop_s"]) for row in rows]
    assert starts[0] == 0
    assert np.allclose(np.subtract(starts[1:], stops[:-1]), SILENCE_S, atol=1 / RATE_HZ)
    sound, rate = soundfile.read(out / "flat.wav")
    assert stops[-1] * rate == pytest.approx(sound.size) == pytest.approx(report["seconds"] * rate)
    for stop, start in zip(stops[:-1], starts[1:], strict=True):
        assert not sound[round(stop * rate) : round(start * rate)].any()
    labels = [line.split("\t") for line in (out / "grooves.txt").read_text(encoding="utf-8").splitlines()]
    assert [label[2] for label in labels] == [f"groove {k + 1}" for k in range(len(rows))]
    assert np.allclose([float(label[0]) for label in labels], starts, atol=1e-6)
    # silence is nobody's loss
    assert report["share"]["measured"] > 0.9


def test_the_edges_lie_beside_the_sound(single: tuple[Path, Path, dict[str, Any]], passage: Passage) -> None:
    _, out, _ = single
    edges = np.load(out / "edges.npz")
    for groove in range(SCENE.turns):
        rows, flags = edges[f"p000000_g{groove:02d}_row_px"], edges[f"p000000_g{groove:02d}_flags"]
        true = np.stack(edges_of_turn(SCENE, passage, groove, np.arange(200, 1100))[::-1])
        seen = (flags & np.uint16(NOT_MEASURED)) == 0
        assert seen.mean() > 0.9
        assert np.abs(np.median(rows[seen] - true[seen])) < 0.05
        assert np.std(rows[seen] - true[seen]) < 0.3


def test_an_unknown_scale_is_said_loudly(single: tuple[Path, Path, dict[str, Any]]) -> None:
    path, out, report = single
    assert report["scale"] == {
        "known": False,
        "assumed": ["one pixel is 4 µm", "the record turns at 78 rpm", "the groove has a radius of 115 mm"],
        "groove_along": "rows",
        "groove_along_found": True,
    }
    assert "the scale is not known" in report["remarks"][0]
    assert "up and down" in report["remarks"][1]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "the scale is not known" in page
    assert "scale not known" in report["files"]["flat.wav"]["coding_history"][1]
    assert report["capture"] == str(path.resolve())
    assert report["layout"] == "stills"


def test_one_groove_alone_is_the_same_as_among_the_others(
    single: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    path, out, report = single
    alone = played(open_picture(path), tmp_path / "out", groove=2)
    row = report["grooves"]["played"][1]
    assert [one["groove"] for one in alone["grooves"]["played"]] == [2]
    first, stop = (round(row[name] * RATE_HZ) for name in ("start_s", "stop_s"))
    among = soundfile.read(out / "flat.wav", dtype="int32")[0][first:stop]
    assert np.array_equal(soundfile.read(tmp_path / "out" / "flat.wav", dtype="int32")[0], among)
    with pytest.raises(ArgumentError, match=r"1 … 4"):
        played(open_picture(path), tmp_path / "more", groove=5)
    assert not (tmp_path / "more").exists()


def test_a_photograph_is_played_again_bit_for_bit(single: tuple[Path, Path, dict[str, Any]], tmp_path: Path) -> None:
    _, out, report = single
    again = load_again(out / "report.json")
    capture = again.opened(again.capture_folder())
    play(capture, again.recipe(), tmp_path / "out", again.settings(capture, 1), judge=again.judged)
    for name in ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav", "grooves.csv", "groove.png"):
        assert (tmp_path / "out" / name).read_bytes() == (out / name).read_bytes(), name
    assert report["still_manifest"]["pixel_pitch_m"] is None


def test_what_shows_no_groove_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    write_png(tmp_path / "blank.png", np.full((200, 300), 90, np.uint8))
    capture = open_picture(tmp_path / "blank.png", StillManifest((), groove_along="columns"))
    with pytest.raises(CaptureError, match="groove"):
        played(capture, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["blank.png"]


def test_recipes_of_films_and_of_photographs_are_told_apart(
    single: tuple[Path, Path, dict[str, Any]], capture: Path, tmp_path: Path
) -> None:
    path = single[0]
    with pytest.raises(ArgumentError, match="'best' for photographs"):
        play(open_picture(path), load_recipe("best"), tmp_path / "out", Settings())
    with pytest.raises(ArgumentError, match="'stills' for a film"):
        play(open_capture(capture), load_recipe("stills"), tmp_path / "out", Settings())
    with pytest.raises(ArgumentError, match="groove 1 of a film"):
        play(open_capture(capture), load_recipe("seed-paper"), tmp_path / "out", Settings(groove=1))
    assert list(tmp_path.iterdir()) == []
    assert recipe_for(open_picture(path)) == "stills"
    assert recipe_for(open_capture(capture)) == "best"


def test_a_film_takes_the_lists_of_a_photograph_away(
    single: tuple[Path, Path, dict[str, Any]], capture: Path, tmp_path: Path
) -> None:
    for name in BESIDE:
        (tmp_path / name).write_bytes((single[1] / name).read_bytes())
    play(open_capture(capture), load_recipe("seed-paper"), tmp_path, Settings())
    assert not [name for name in BESIDE if (tmp_path / name).exists()]
    assert not list(tmp_path.glob(".*.part"))


@pytest.mark.parametrize(("name", "least"), [("track_05.png", 5), ("track_09.png", 4)])
def test_real_micrographs_play(name: str, least: int, tmp_path: Path) -> None:
    if not (PRACTICE / name).is_file():
        pytest.skip(f"the practice picture {name} is not here")
    report = played(opened(PRACTICE / name), tmp_path / "out")
    assert len(report["grooves"]["played"]) >= least
    assert report["share"]["measured"] > 0.7
    assert not report["scale"]["known"]


def _tones(samples: np.ndarray, rate_hz: float, *tones_hz: float) -> np.ndarray:
    """Complex amplitudes of tones, shape (tone, channel), over a constant."""
    time_s = np.arange(len(samples)) / rate_hz
    turning = np.exp(2j * np.pi * np.outer(time_s, tones_hz))
    window = np.hanning(len(samples) + 2)[1:-1, None]
    design = np.hstack([turning.real, turning.imag, np.ones((len(samples), 1))]) * window
    found = np.linalg.lstsq(design, samples * window, rcond=None)[0]
    return np.asarray(found[: len(tones_hz)] - 1j * found[len(tones_hz) : -1])


def test_each_channel_is_heard_alone_where_it_is_known_how_the_walls_stand(tmp_path: Path) -> None:
    disc, tones_hz = Disc(cut="stereo", groove_width_m=140e-6, wall_angle_rad=rad(52.0)), (158.7, 351.3)
    scene = replace(SCENE, turns=3, disc=disc, level_m_s=0.005, dust_per_m=0.0)
    time_s = np.arange(round(8000 * scene.seconds)) / 8000
    left, right = (np.sin(2 * np.pi * tone * time_s) for tone in tones_hz)
    write_still(tmp_path / "capture", scene, cut_still(np.stack([left, right], axis=1), rate_hz=8000.0, scene=scene))
    leaks = []
    for said in ("wall_angle_deg = 52.0", "wall_angle_deg = 45.0", "# nobody knows"):
        manifest = tmp_path / "capture" / "capture.toml"
        text = re.sub(r"wall_angle_deg = .*", said, manifest.read_text(encoding="utf-8"))
        manifest.write_text(text, encoding="utf-8")
        report = played(open_stills(tmp_path / "capture"), tmp_path / "out")
        tones = _tones(soundfile.read(tmp_path / "out" / "walls.wav")[0][2400:-2400], RATE_HZ, *tones_hz)
        # walls.wav has the outer wall first, which is the right channel
        leaks.append(np.array([tones[0, 0] / tones[0, 1], tones[1, 1] / tones[1, 0]]))
    assert np.abs(leaks[0]).max() < 10 ** (-35 / 20)
    # and where it is not known, as much is heard of the other one as docs/how-to/play-a-photograph.md says
    told = np.rad2deg(np.arctan((1 + leaks[1].real) / (1 - leaks[1].real)))
    assert np.abs(told - 52).max() < 1
    # by their own tones, where nobody says how they stand
    assert np.abs(leaks[2]).max() < 10 ** (-35 / 20)
    found = report["calibration"]["wall_angle_deg"]
    assert found["manifest"] is None
    assert found["taken"] == found["by_test_tones"] == pytest.approx(52, abs=max(0.3, 3 * found["sigma"]))
    assert any("walls were taken to stand at" in remark for remark in report["remarks"])


@pytest.mark.parametrize("pixel_pitch_um", [None, 1.9, 16.0])
def test_a_test_record_sounds_alike_whatever_its_scale_is_taken_for(
    pixel_pitch_um: float | None, tmp_path: Path
) -> None:
    if not (PRACTICE / "track_09.png").is_file():
        pytest.skip("the practice picture track_09.png is not here")
    known = StillManifest(
        (),
        disc=Disc(cut="stereo"),
        pixel_pitch_m=None if pixel_pitch_um is None else pixel_pitch_um * 1e-6,
    )
    capture, rate_hz = opened(PRACTICE / "track_09.png", known), 96_000
    pitch_m = capture.bench.sensor.pixel_pitch_m
    speed_m_s = 2 * np.pi * 78 / 60 * 0.115
    periods_px = np.array([154.52, 40.5])
    play(capture, load_recipe("stills"), tmp_path, Settings(rate_hz=float(rate_hz), full_scale_m_s=1.0))
    sound = soundfile.read(tmp_path / "walls.wav")[0]
    rows = list(csv.DictReader((tmp_path / "grooves.csv").read_text(encoding="utf-8").splitlines()))
    whole = [row for row in rows if float(row["measured"]) > 0.6]
    assert len(whole) == 6
    tones_hz = speed_m_s / (periods_px * pitch_m)
    found = np.stack(
        [
            _tones(
                sound[slice(*(round(float(row[name]) * rate_hz) for name in ("start_s", "stop_s")))], rate_hz, *tones_hz
            )
            for row in whole
        ]
    )
    outer, inner = np.moveaxis(found, 2, 0)
    # 800 Hz on the outer wall, 3000 Hz on the inner one; each loses little to noise, and stands above the other one
    assert np.abs(outer[:, 0]).mean() == pytest.approx(0.25, rel=0.1)
    assert np.abs(inner[:, 1]).mean() > 0.13
    assert (
        20 * np.log10(np.abs(outer[:, 0]).mean() / np.abs(np.mean(outer[:, 1] / np.exp(1j * np.angle(inner[:, 1])))))
        > 24
    )
    assert (
        20 * np.log10(np.abs(inner[:, 1]).mean() / np.abs(np.mean(inner[:, 0] / np.exp(1j * np.angle(outer[:, 0])))))
        > 20
    )
