"""A transfer with repairs: nothing is lost, everything adds up, and what was done is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from gramoscope.cli.main import main
from gramoscope.errors import ArgumentError
from gramoscope.player.provenance import recipe_of
from gramoscope.player.recipe import recipe_of_table, table_of_recipe, with_repairs
from gramoscope.preamp.declick import Declicker
from gramoscope.preamp.decrackle import Decrackler
from gramoscope.preamp.repair import Repair
from gramoscope.preamp.rumble import RumbleFilter

REPAIR_FILES = {"repaired.wav", "difference.wav", "cues.json", "labels.txt"}


def _steps(path: Path) -> Any:
    return soundfile.read(path, dtype="int32")[0] >> 8


@pytest.fixture(scope="module")
def mended(capture: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("mended")
    command = ["play", str(capture), "--out", str(out), "--recipe", "seed-paper", "--declick", "--decrackle"]
    assert main([*command, "--rumble-hz", "150", "--quiet"]) == 0
    return out


def test_repaired_and_difference_add_up_to_the_flat_transfer_bit_for_bit(mended: Path, transfer: Any) -> None:
    flat, repaired, difference = (_steps(mended / name) for name in ("flat.wav", "repaired.wav", "difference.wav"))
    np.testing.assert_array_equal(repaired + difference, flat)
    assert np.any(difference)
    # the flat transfer is that of a transfer without repairs
    np.testing.assert_array_equal(flat, _steps(transfer.folder / "flat.wav"))


def test_the_equalised_sound_is_made_of_the_repaired_one(mended: Path, transfer: Any) -> None:
    assert np.any(_steps(mended / "equalised.wav") != _steps(transfer.folder / "equalised.wav"))
    report = json.loads((mended / "report.json").read_text("utf-8"))
    assert report["files"]["equalised.wav"]["made_of"] == "repaired.wav"
    assert report["repair"]["spans"]["rumble"] == 1
    assert "150 Hz" in report["repair"]["history"][2]
    assert set(report["files"]) > {"repaired.wav", "difference.wav"}
    assert (report["repair"]["cues"]["name"], report["repair"]["cues"]["labels"]) == ("cues.json", "labels.txt")
    assert (mended / "repaired.wav.sha256").is_file()
    assert report["recipe"]["preamp"]["rumble"] == {"corner_hz": 150.0, "poles": 3}


def test_the_lists_cover_the_whole_passage(mended: Path) -> None:
    cues = json.loads((mended / "cues.json").read_text("utf-8"))["cues"]
    labels = (mended / "labels.txt").read_text("utf-8").splitlines()
    assert len(cues) == len(labels)
    (rumble,) = (cue for cue in cues if cue["kind"] == "rumble")
    assert (rumble["start_sample"], rumble["stop_sample"]) == (0, _steps(mended / "flat.wav").size)


def test_without_repairs_none_of_their_files_is_left(capture: Path, transfer: Any, played: Any, tmp_path: Path) -> None:
    assert not REPAIR_FILES & {path.name for path in transfer.folder.iterdir()}
    assert transfer.report["repair"] is None
    for name in REPAIR_FILES:
        (tmp_path / name).write_text("of an older transfer")
    played(capture, tmp_path)
    assert not REPAIR_FILES & {path.name for path in tmp_path.iterdir()}


def test_a_table_in_the_recipe_asks_for_a_repair_and_none_leaves_it_out() -> None:
    assert not recipe_of_table({}).repair.asked
    recipe = recipe_of_table({"preamp": {"declick": {}, "rumble": {"corner_hz": 35.0}}})
    assert recipe.repair == Repair(declick=Declicker(), rumble=RumbleFilter(35.0))
    assert recipe_of_table(table_of_recipe(recipe)).repair == recipe.repair
    assert recipe_of(recipe)["sha256"] != recipe_of(recipe_of_table({}))["sha256"]


def test_the_command_line_adds_to_the_recipe() -> None:
    recipe = recipe_of_table({"preamp": {"declick": {"threshold": 7.0}, "rumble": {"poles": 2}}})
    more = with_repairs(recipe, declick=True, decrackle=True, rumble_hz=30.0)
    assert more.repair == Repair(Declicker(threshold=7.0), Decrackler(), RumbleFilter(30.0, poles=2))
    assert with_repairs(recipe, declick=False, decrackle=False, rumble_hz=None) == recipe


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"declick": {"thresh": 3.0}}, r"\[preamp\.declick\] has an unknown key"),
        ({"decrackle": {"probability": 2.0}}, r"\[preamp\.decrackle\]"),
        ({"rumble": {"corner_hz": 0.0}}, r"\[preamp\.rumble\]"),
        ({"rumble": 20.0}, "a table"),
    ],
)
def test_an_impossible_repair_is_named_with_its_table(table: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        recipe_of_table({"preamp": table})


def test_what_a_transfer_consists_of_stands_in_the_documents(mended: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "transfer-files.md").read_text(encoding="utf-8")
    rows = " ".join(line.split("|")[1] for line in page.splitlines() if line.startswith("| `"))
    for path in mended.iterdir():
        name = "NAME.wav.sha256" if path.suffix == ".sha256" else path.name
        assert f"`{name}`" in rows, name


def test_the_terminal_tells_of_repairs_and_not_of_what_the_reading_bridged(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["play", str(capture), "--out", str(tmp_path / "out"), "--recipe", "seed-paper", "--rumble-hz", "25"]
    assert main(command) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "repaired 1 span by rumble" in told
    assert "by interpolated" not in told
