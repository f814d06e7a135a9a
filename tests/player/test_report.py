"""The report says from what, with what and how a transfer was made, and what it is worth."""

from __future__ import annotations

import hashlib
import platform
import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.player.provenance import recipe_of
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import Quality

RATE_HZ = 96_000


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_every_file_that_was_read_can_be_checked(capture: Path, transfer: Any) -> None:
    inputs = transfer.report["inputs"]
    assert inputs["common_files"] == {name: _sha256(capture / name) for name in ("capture.toml", "frames.csv")}
    files = sorted((capture / "frames").iterdir())
    lines = "".join(f"{_sha256(file)}  {file.relative_to(capture).as_posix()}\n" for file in files)
    assert inputs["group_files"] == {
        "count": 8,
        "sha256_of_sha256sum_lines": hashlib.sha256(lines.encode()).hexdigest(),
    }


def test_a_byte_changed_on_disk_changes_the_sum(copy_of: Path, transfer: Any, played: Any, tmp_path: Path) -> None:
    file = copy_of / "frames" / "g000003.tif"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(bytes(content))
    other = played(copy_of, tmp_path / "out").report["inputs"]
    assert other["common_files"] == transfer.report["inputs"]["common_files"]
    assert other["group_files"] != transfer.report["inputs"]["group_files"]


def test_the_recipe_stands_there_with_every_parameter(transfer: Any) -> None:
    recipe = transfer.report["recipe"]
    assert recipe["name"] == "seed-paper"
    assert recipe["sha256"] == recipe_of(load_recipe("seed-paper"))["sha256"]
    assert recipe["pickup"]["flow"]["method"] == "groove-horn-schunck"
    assert recipe["tonearm"]["smoother"]["corner_limits_hz"] == [1000.0, 12000.0]


def test_the_apparatus_stands_there_in_si_units(film: Any, transfer: Any) -> None:
    bench, said = film.scene.bench, transfer.report["bench"]
    assert said["sensor"]["pixel_pitch_m"] == bench.sensor.pixel_pitch_m
    assert said["rotation"] == {"rpm": 78.0, "radius_m": 0.115, "pitch_m": 0.0}
    assert said["sequence"]["groups"] == 8
    assert said["stripe_rows"] == pytest.approx(bench.stripe_rows())
    assert said["focus_through_glass_m"] == pytest.approx(bench.focus_through_glass_m)


def test_the_versions_are_those_that_are_installed(transfer: Any) -> None:
    versions = transfer.report["versions"]
    for name in ("gramoscope", "numpy", "scipy", "numba", "soxr"):
        assert versions[name] == version(name)
    assert versions["python"] == platform.python_version()


def test_the_figures_are_those_of_the_sound(film: Any, transfer: Any) -> None:
    report, flat_m_s = transfer.report, transfer["flat.wav"] * transfer.report["files"]["flat.wav"]["full_scale_m_s"]
    assert report["rate_hz"] == RATE_HZ
    assert report["seconds"] == pytest.approx(flat_m_s.size / RATE_HZ)
    assert report["level"]["rms_cm_s"] == pytest.approx(100 * np.sqrt(np.mean(flat_m_s**2)), rel=1e-4)
    assert report["level"]["peak_cm_s"] == pytest.approx(100 * np.abs(flat_m_s).max(), rel=1e-4)
    assert report["groups"] == {"read": 8, "lost": 0}
    assert report["share"]["measured"] + report["share"]["interpolated"] == pytest.approx(1)
    assert report["share"]["measured"] > 0.95
    assert report["frame_step"]["measured_mean_um"] == pytest.approx(0.8, abs=0.01)
    assert report["files"]["flat.wav"]["clipped_samples"] == 0
    assert report["problems"] == []


def test_the_claimed_noise_is_of_the_size_of_the_error(film: Any, transfer: Any) -> None:
    heard = transfer["flat.wav"] * 0.5
    error_m_s = np.std((heard - film.sound_m_s(RATE_HZ)[: heard.size])[24:-24])
    # four milliseconds teach the smoother little: it errs on the safe side
    assert 0.25 < 100 * error_m_s / transfer.report["noise_estimate"]["sigma_rms_cm_s"] < 1.5


def test_every_flag_is_explained_and_counted(transfer: Any) -> None:
    names = {str(flag.name).lower() for flag in Quality}
    assert set(transfer.report["flags"]) == names
    for key in ("flagged_samples", "flagged_pickup_samples"):
        assert set(transfer.report[key]) == names - {"declicked", "decrackled", "silence"}, "a reading repairs nothing"
    assert transfer.report["flagged_samples"]["edge"] > 0


def test_a_listener_is_told_that_one_wall_alone_was_read(transfer: Any) -> None:
    assert len(transfer.report["walls_read"]) == 1
    assert "vertical motion" in transfer.report["remarks"][0]


def _keys(value: Any, of: str = "") -> set[str]:
    if isinstance(value, dict):
        free = (
            "recipe",
            "bench",
            "flags",
            "versions",
            "files",
            "flagged_samples",
            "flagged_pickup_samples",
            "common_files",
        )
        below = set() if of in free else {key for name, inner in value.items() for key in _keys(inner, name)}
        return below | (set() if of in free else set(value))
    return {key for inner in value for key in _keys(inner, of)} if isinstance(value, list) else set()


def test_every_key_is_documented(transfer: Any) -> None:
    document = (Path(__file__).parents[2] / "docs" / "reference" / "report.md").read_text(encoding="utf-8")
    keys = _keys(transfer.report)
    assert {"wall_agreement", "sha256_of_sha256sum_lines", "worst_groups", "at_s"} <= keys
    named = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`\n]+)`", document))))
    assert sorted(keys - named) == []


def test_shares_are_of_the_whole_and_add_up(transfer: Any) -> None:
    share = transfer.report["share"]
    assert share["bridged"] + share["missing"] == pytest.approx(share["interpolated"])
    along = transfer.report["quality"]["along_time"]
    assert np.mean(along["measured"]) == pytest.approx(share["measured"], abs=0.01)
    assert len(along["measured"]) <= 241


def test_the_bands_add_up_to_the_sound_and_to_the_error_bars(transfer: Any) -> None:
    spectrum = transfer.report["quality"]["spectrum"]
    error = np.array(spectrum["octaves"]["error_rms_cm_s"], np.float64)
    rms_cm_s = transfer.report["noise_estimate"]["sigma_rms_cm_s"]
    assert np.sqrt(np.nansum(error**2)) == pytest.approx(rms_cm_s, rel=0.1)
    assert spectrum["error_bars_over_model"] == pytest.approx(1.0, abs=0.35)
    sound = np.array(spectrum["octaves"]["sound_rms_cm_s"], np.float64)
    # of four milliseconds the octaves below 1.4 kHz cannot be told, and with them the tone of 910 Hz
    share = np.sqrt(np.nansum(sound**2)) / transfer.report["level"]["rms_cm_s"]
    assert 0.44 < share < 0.75


def test_numbers_of_a_table_stand_in_one_line(transfer: Any) -> None:
    text = (transfer.folder / "report.json").read_text(encoding="utf-8")
    assert re.search(r'"measured": \[[\d., ]+\]', text)
    assert len(text.splitlines()) < 700
