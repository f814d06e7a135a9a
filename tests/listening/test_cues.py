"""Cue lists, read back as a machine and as Audacity would."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from gramoscope.errors import ArgumentError, OutputError
from gramoscope.listening.broadcast_wave import WavWriter
from gramoscope.listening.cues import CueWriter
from gramoscope.listening.reversible import reversible
from gramoscope.signal_path import Cue

RATE_HZ = 96_000.0
CUES = [
    Cue("declick", 4801, 4830, RATE_HZ, 0.031, 0.012, -3.5, "21.3 standard errors, flagged sparse"),
    Cue("rumble", 0, 96_000, RATE_HZ, 1e-3, 2e-4, float("nan"), "tab\there"),
]


def written(folder: Path, cues: list[Cue]) -> tuple[Path, Path]:
    paths = folder / "cues.json", folder / "labels.txt"
    writer = CueWriter(*paths, rate_hz=RATE_HZ)
    for cue in cues:
        writer.write(cue)
    assert not any(path.exists() for path in paths)
    writer.commit()
    return paths


@pytest.mark.parametrize("cues", [CUES, []])
def test_both_lists_come_back(tmp_path: Path, cues: list[Cue]) -> None:
    json_path, labels_path = written(tmp_path, cues)
    read = json.loads(json_path.read_text("utf-8"))
    assert (read["format"], read["rate_hz"]) == ("gramoscope-cues/1", RATE_HZ)
    assert [(c["kind"], c["start_sample"], c["stop_sample"]) for c in read["cues"]] == [
        (c.kind, c.start_sample, c.stop_sample) for c in cues
    ]
    labels = [line.split("\t") for line in labels_path.read_text("utf-8").splitlines()]
    assert all(len(label) == 3 for label in labels)
    for (start, stop, text), cue in zip(labels, cues, strict=True):
        assert round(float(start) * RATE_HZ) == cue.start_sample
        assert round(float(stop) * RATE_HZ) == cue.stop_sample
        assert len(start.split(".")[1]) == 6
        assert text.startswith(f"{cue.kind}: ")


def test_what_is_not_known_is_null(tmp_path: Path) -> None:
    json_path, _ = written(tmp_path, CUES)
    first, second = json.loads(json_path.read_text("utf-8"))["cues"]
    assert first["change_db"] == -3.5
    assert second["change_db"] is None
    assert first["start_s"] == pytest.approx(4801 / 96_000, abs=1e-12)


def test_a_discarded_list_leaves_the_old_one_and_nothing_else(tmp_path: Path) -> None:
    json_path, labels_path = written(tmp_path, CUES)
    before = json_path.read_bytes(), labels_path.read_bytes()
    writer = CueWriter(json_path, labels_path, rate_hz=RATE_HZ)
    writer.write(CUES[0])
    writer.discard()
    assert (json_path.read_bytes(), labels_path.read_bytes()) == before
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(ArgumentError, match="discarded"):
        writer.write(CUES[0])


def test_a_missing_folder_and_another_rate_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        CueWriter(tmp_path / "no" / "a.json", tmp_path / "no" / "b.txt", rate_hz=RATE_HZ)
    writer = CueWriter(tmp_path / "a.json", tmp_path / "b.txt", rate_hz=48_000.0)
    with pytest.raises(ArgumentError, match="96000 Hz"):
        writer.write(CUES[0])
    writer.discard()
    assert list(tmp_path.iterdir()) == []


def test_repaired_and_difference_add_up_to_the_raw_file_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    raw = 0.05 * rng.standard_normal(5000)
    repaired = raw + 0.01 * rng.standard_normal(5000)
    raw[10:13], repaired[10:13] = [0.7, -0.8, np.nan], [0.1, 0.6, 0.02]  # beyond full scale, and not a number
    for full_scale_m_s in (0.5, 0.37):
        left, taken = reversible(raw, repaired, full_scale_m_s=full_scale_m_s)
        whole = []
        for name, sound in (("raw", raw), ("left", left), ("taken", taken)):
            with WavWriter(tmp_path / f"{name}.wav", rate_hz=RATE_HZ, full_scale_m_s=full_scale_m_s) as file:
                file.write(sound)
            whole.append(soundfile.read(tmp_path / f"{name}.wav", dtype="int32")[0] >> 8)
        np.testing.assert_array_equal(whole[1] + whole[2], whole[0])
        inside = np.abs(repaired) < full_scale_m_s
        inside[10:13] = False
        np.testing.assert_allclose(left[inside], repaired[inside], atol=full_scale_m_s * 2**-24 * 1.001)


def test_what_is_still_beyond_full_scale_after_repair_is_clipped_and_counted_by_the_file(tmp_path: Path) -> None:
    raw, repaired = np.array([0.9, -0.9, 0.9, 0.2]), np.array([0.7, -0.6, 0.1, 0.2])
    left, taken = reversible(raw, repaired, full_scale_m_s=0.5)
    whole = []
    for name, sound, clipped in (("raw", raw, 3), ("left", left, 2), ("taken", taken, 0)):
        with WavWriter(tmp_path / f"{name}.wav", rate_hz=RATE_HZ, full_scale_m_s=0.5) as file:
            file.write(sound)
        assert file.clipped_samples == clipped, name
        whole.append(soundfile.read(tmp_path / f"{name}.wav", dtype="int32")[0] >> 8)
    np.testing.assert_array_equal(whole[1] + whole[2], whole[0])
