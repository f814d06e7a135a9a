"""A transfer repeated from its report has the same bits, and what is not the same is said."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gramoscope.apparatus.capture import open_capture
from gramoscope.cli.main import main
from gramoscope.errors import ArgumentError, CaptureError
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.again import load_again
from gramoscope.player.play import Settings
from gramoscope.player.provenance import recipe_of, settings_of
from gramoscope.player.recipe import load_recipe, shipped_recipes
from gramoscope.player.speed import Speed
from gramoscope.turntable.speed_curve import SpeedCurve

SOUNDS = ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav")
WORDS = (
    "--title",
    "Ça ira",
    "--originator",
    "An archive",
    "--rate",
    "48000",
    "--characteristic",
    "columbia-78",
    "--flac",
)


@pytest.fixture(scope="module")
def first(capture: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A transfer with settings of its own, made by the command."""
    out = tmp_path_factory.mktemp("transfers") / "first"
    scale = ("--full-scale-cm-s", "37.5", "--workers", "1")
    assert main(["play", str(capture), "--out", str(out), "--recipe", "seed-paper", *WORDS, *scale, "--quiet"]) == 0
    return out


def _report(folder: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    return read


def _changed(first: Path, folder: Path, **changes: Any) -> Path:
    """The report of the first transfer, in another folder and with something else in it."""
    folder.mkdir()
    report = {**_report(first), **changes}
    (folder / "report.json").write_text(json.dumps(report), encoding="utf-8")
    return folder / "report.json"


def test_every_sound_has_the_same_bits(first: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--again", str(first / "report.json"), "--workers", "2"]) == 0
    second = first.with_name("first-again")
    for name in SOUNDS:
        assert (second / name).read_bytes() == (first / name).read_bytes(), name
        flac = name.replace("wav", "flac")
        assert (second / flac).read_bytes() == (first / flac).read_bytes(), flac
    assert (second / "groove.png").read_bytes() == (first / "groove.png").read_bytes()
    again = _report(second)["again"]
    assert again["same_files"] == list(SOUNDS)
    assert again["other_files"] == again["other_inputs"] == []
    assert again["other_versions"] == {}
    assert again["made"] == _report(first)["made"]
    assert "The same bits as then, all 4 sound files." in " ".join(capsys.readouterr().out.split())
    assert "repeats the one of" in (second / "report.html").read_text(encoding="utf-8")


def test_the_report_holds_every_setting_that_matters(first: Path) -> None:
    assert _report(first)["settings"] == {
        "rate_hz": 48_000.0,
        "characteristic_name": "columbia-78",
        "full_scale_m_s": 0.375,
        "flac": True,
        "speed": {"rpm": None, "name": "", "origin": "", "curve": None, "remove_wow": False},
    }
    # a groove is chosen of photographs alone
    left_out = {"workers", "catalogue", "device", "groove"}
    assert set(_report(first)["settings"]) | left_out == set(Settings.__dataclass_fields__)


def test_a_capture_that_was_moved_and_renamed_is_played_as_what_it_was(
    first: Path, capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(capture, tmp_path / "shelf" / "another name")
    report = _changed(first, tmp_path / "report", capture="/nowhere/capture", capture_from_here="../gone")
    assert main(["play", "--again", str(report), "--quiet"]) == 2
    said = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "say where it is now" in said
    moved = str(tmp_path / "shelf" / "another name")
    assert main(["play", moved, "--again", str(report), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    for name in SOUNDS:
        assert (tmp_path / "out" / name).read_bytes() == (first / name).read_bytes(), name


def test_report_and_capture_that_were_moved_together_find_each_other(
    first: Path, capture: Path, tmp_path: Path
) -> None:
    shutil.copytree(capture, tmp_path / "capture")
    report = _changed(first, tmp_path / "out", capture="/nowhere/capture", capture_from_here="../capture")
    assert load_again(report).capture_folder().resolve() == (tmp_path / "capture").resolve()


def test_other_frames_are_an_error_and_leave_nothing(first: Path, copy_of: Path, tmp_path: Path) -> None:
    frame = copy_of / "frames" / "g000003.tif"
    content = bytearray(frame.read_bytes())
    content[-1000] ^= 1
    frame.write_bytes(bytes(content))
    arguments = ["play", str(copy_of), "--again", str(first / "report.json"), "--out", str(tmp_path / "o"), "--quiet"]
    assert main(arguments) == 2
    assert not (tmp_path / "o").exists()
    assert main([*arguments, "--force"]) == 0
    again = _report(tmp_path / "o")["again"]
    assert again["other_inputs"] == ["the frames"]
    assert "The input is not the same: the frames." in (tmp_path / "o" / "report.html").read_text(encoding="utf-8")


def test_another_manifest_is_found_out_before_anything_is_read(
    first: Path, copy_of: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (copy_of / "capture.toml").open("a", encoding="utf-8") as file:
        file.write("\n# a word\n")
    monkeypatch.setattr("gramoscope.player.play.play", lambda *_, **__: pytest.fail("it was played"))
    arguments = ["play", str(copy_of), "--again", str(first / "report.json"), "--out", str(tmp_path / "o"), "--quiet"]
    assert main(arguments) == 2
    inputs = _report(first)["inputs"]
    with pytest.raises(CaptureError, match=r"capture\.toml differ"):
        load_again(first / "report.json").judged(
            {**_report(first), "inputs": {**inputs, "common_files": {**inputs["common_files"], "capture.toml": "0"}}}
        )


def test_other_versions_are_told_and_no_error(
    first: Path, capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    versions = {**_report(first)["versions"], "numba": "0.1"}
    report = _changed(first, tmp_path / "old", versions=versions)
    assert main(["play", str(capture), "--again", str(report), "--out", str(tmp_path / "out")]) == 0
    assert "numba was 0.1 then" in " ".join(capsys.readouterr().out.split())
    again = _report(tmp_path / "out")["again"]
    assert again["other_versions"]["numba"]["then"] == "0.1"
    assert again["same_files"] == list(SOUNDS)


def test_options_that_the_report_answers_are_refused(first: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--again", str(first / "report.json"), "--rate", "44100", "--title", "x", "--quiet"]) == 2
    assert "--again with --rate, --title" in " ".join(capsys.readouterr().err.replace("│", " ").split())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot be read"),
        ("{", "is not JSON"),
        ("[]", "format None"),
        ('{"format": "gramoscope-report/9"}', "gramoscope-report/9"),
        ('{"format": "gramoscope-report/1"}', "does not say settings"),
    ],
)
def test_what_is_no_report_is_refused(tmp_path: Path, content: str | None, said: str) -> None:
    if content is not None:
        (tmp_path / "report.json").write_text(content, encoding="utf-8")
    with pytest.raises(ArgumentError, match=said):
        load_again(tmp_path / "report.json")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"recipe": {"name": "x", "pickup": {"cartridge": "needle"}}}, "needle"),
        ({"made": "yesterday"}, "yesterday"),
        ({"catalogue": {"originator": "o" * 33}}, "33 characters"),
        ({"catalogue": {"motto": "x"}}, "motto"),
    ],
)
def test_a_report_that_was_changed_by_hand_is_refused(
    first: Path, tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(ArgumentError, match=said):
        load_again(_changed(first, tmp_path / "x", **changes))


def test_settings_of_a_later_version_are_refused(first: Path, tmp_path: Path, film: Any) -> None:
    settings = {**_report(first)["settings"], "loudness_war": True}
    again = load_again(_changed(first, tmp_path / "x", settings=settings))
    with pytest.raises(ArgumentError, match="loudness_war"):
        again.settings(film, 1)


def test_a_speed_comes_back_as_what_it_was(first: Path, capture: Path, tmp_path: Path) -> None:
    speed = Speed(name="drift.csv", curve=SpeedCurve((0.0, 12.5), (78.26, 77.92)), remove_wow=True)
    settings = json.loads(json.dumps(settings_of(Settings(speed=speed))))
    again = load_again(_changed(first, tmp_path / "x", settings=settings)).settings(open_capture(capture), 3)
    assert (again.speed, again.workers, again.device) == (speed, 3, PROCESSOR)
    assert hash(again.speed) == hash(speed), "tuples, not lists"
    settings["speed"]["curve"]["rpm"] = "fast"
    wrong = load_again(_changed(first, tmp_path / "y", settings=settings))
    with pytest.raises(ArgumentError, match=r"settings\.speed"):
        wrong.settings(open_capture(capture), 1)


def test_what_was_read_on_a_card_is_read_on_a_card_again(first: Path, capture: Path, tmp_path: Path) -> None:
    again = load_again(_changed(first, tmp_path / "x", device="abacus: wooden"))
    with pytest.raises(ArgumentError, match="device 'abacus'"):
        again.settings(open_capture(capture), 1)


def test_repairs_and_a_speed_curve_are_repeated_to_the_bit(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drift.csv").write_text("time_s,rpm\n0,78\n0.01,79\n", encoding="utf-8")
    chosen = ("--declick", "--decrackle", "--rumble-hz", "25", "--speed-curve", "drift.csv")
    assert main(["play", str(capture), "--out", "one", "--recipe", "seed-paper", "--quiet", *chosen]) == 0
    Path("drift.csv").unlink()
    assert main(["play", "--again", "one/report.json", "--quiet"]) == 0
    again = _report(Path("one-again"))["again"]
    assert again["same_files"] == [*SOUNDS, "repaired.wav", "difference.wav"]
    assert again["other_files"] == []
    assert Path("one-again/cues.json").read_bytes() == Path("one/cues.json").read_bytes()


@pytest.mark.parametrize("name", shipped_recipes())
def test_every_recipe_comes_back_from_a_report_as_it_was(first: Path, tmp_path: Path, name: str) -> None:
    said: Callable[..., Any] = recipe_of
    recipe = load_recipe(name)
    again = load_again(_changed(first, tmp_path / name, recipe=json.loads(json.dumps(said(recipe)))))
    assert recipe_of(again.recipe()) == recipe_of(recipe)
    assert again.recipe() == recipe
