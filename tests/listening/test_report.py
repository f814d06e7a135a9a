"""Reports are JSON that any program reads, and appear whole or not at all."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.errors import OutputError
from gramoscope.listening.report import write_json
from gramoscope.listening.whole_file import written_whole


def test_numpy_values_come_back_as_numbers_and_what_is_no_number_as_null(tmp_path: Path) -> None:
    report = {
        "count": np.int64(3),
        "share": np.float32(0.5),
        "noise": float("nan"),
        "ratios": np.array([1.5, np.inf, -2.0]),
        "measured": np.bool_(True),
        "folder": Path("a") / "b",
        "groove": {"radius": (1, 2), "title": "Für Elise", "none": None},
    }
    write_json(tmp_path / "report.json", report)
    text = (tmp_path / "report.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=lambda name: pytest.fail(name)) == {
        "count": 3,
        "share": 0.5,
        "noise": None,
        "ratios": [1.5, None, -2.0],
        "measured": True,
        "folder": "a/b",
        "groove": {"radius": [1, 2], "title": "Für Elise", "none": None},
    }
    assert "Für Elise" in text
    assert text.endswith("}\n")


def test_a_value_that_json_does_not_know_leaves_the_older_report_alone(tmp_path: Path) -> None:
    write_json(tmp_path / "report.json", {"older": 1})
    with pytest.raises(TypeError, match="complex"):
        write_json(tmp_path / "report.json", {"bad": 1j})
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]
    assert "older" in (tmp_path / "report.json").read_text()


def test_an_interrupted_file_vanishes(tmp_path: Path) -> None:
    def interrupt() -> None:
        with written_whole(tmp_path / "report.json") as temporary:
            temporary.write_text("half a rep")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("moment", ["touch", "replace"])
def test_ctrl_c_just_when_a_file_is_made_or_put_in_place_leaves_no_half_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    really = getattr(Path, moment)

    def pressed(path: Path, *arguments: Any) -> None:
        if moment == "touch":
            really(path)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(Path, moment, pressed)
    with pytest.raises(KeyboardInterrupt):
        write_json(tmp_path / "report.json", {"a": 1})
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="create the folder"):
        write_json(tmp_path / "nowhere" / "report.json", {})
