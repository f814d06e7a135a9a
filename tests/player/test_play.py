"""A capture played: the same sound whoever reads it and however it is stored, and the right one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from gramoscope.apparatus.capture import open_capture
from gramoscope.cli.main import main
from gramoscope.errors import ArgumentError
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe

RATE_HZ = 96_000
FULL_SCALE_M_S = 0.5
SOUNDS = ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav")


def test_the_film_sounds_as_the_groove_moves(film: Any, transfer: Any) -> None:
    truth, heard = film.sound_m_s(RATE_HZ), transfer["flat.wav"] * FULL_SCALE_M_S
    inside = slice(48, -48)
    assert np.corrcoef(truth[: heard.size][inside], heard[inside])[0, 1] > 0.95
    assert np.std(heard[inside]) == pytest.approx(np.std(truth[inside]), rel=0.1)


def test_sample_zero_is_the_first_column_of_the_film(film: Any, transfer: Any) -> None:
    truth, heard = film.sound_m_s(RATE_HZ), transfer["flat.wav"] * FULL_SCALE_M_S
    shifted = [np.corrcoef(truth[100 + k : 280 + k], heard[100:280])[0, 1] for k in range(-12, 13)]
    assert int(np.argmax(shifted)) - 12 == 0


def test_the_sound_is_as_long_as_the_film(film: Any, transfer: Any) -> None:
    bench = film.scene.bench
    seconds = float(bench.rotation.time_of_arc_s(bench.passage_length_m))
    for name in SOUNDS:
        file = soundfile.info(transfer.folder / name)
        channels = 2 if name == "walls.wav" else 1
        assert (file.samplerate, file.channels, file.subtype) == (RATE_HZ, channels, "PCM_24")
        assert abs(file.frames - seconds * RATE_HZ) < 0.01 * RATE_HZ * seconds
    assert transfer.report["seconds"] == pytest.approx(soundfile.info(transfer.folder / "flat.wav").duration)


@pytest.mark.parametrize("workers", [2, 3])
def test_the_bits_do_not_depend_on_the_number_of_workers(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path, workers: int
) -> None:
    other = played(capture, tmp_path / "out", workers=workers)
    for name in (*SOUNDS, *(f"{name}.sha256" for name in SOUNDS), "groove.png"):
        assert other.bits(name) == transfer.bits(name), name


def test_the_folder_holds_every_sound_its_sum_the_picture_and_the_report(transfer: Any) -> None:
    names = {*SOUNDS, *(f"{name}.sha256" for name in SOUNDS), "groove.png", "report.html", "report.json"}
    assert {path.name for path in transfer.folder.iterdir()} == names
    assert tuple(transfer.report["files"]) == SOUNDS


def test_of_one_wall_the_other_channel_is_silent_and_that_is_said(film: Any, transfer: Any) -> None:
    (read,) = transfer.report["walls_read"]
    channels = dict(zip(("outer", "inner"), transfer["walls.wav"].T, strict=True))
    flat = transfer["flat.wav"]
    assert np.abs(channels[read] - flat / np.sqrt(2)).max() < 1.5 * 2**-23
    silent = "inner" if read == "outer" else "outer"
    assert not channels[silent].any()
    assert not transfer["vertical.wav"].any()
    missing = transfer.report["files"]["walls.wav"]["interpolated_samples"]
    assert missing[silent] == flat.size
    assert missing[read] < 0.05 * flat.size
    assert transfer.report["files"]["vertical.wav"]["interpolated_samples"] == {"groove": flat.size}
    assert f"the {silent} wall is silent" in transfer.report["remarks"][0]


def test_another_full_scale_is_the_same_sound_and_what_does_not_fit_is_told(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    small = played(capture, tmp_path / "out", full_scale_m_s=0.02)
    flat, softer = transfer["flat.wav"] * FULL_SCALE_M_S / 0.02, small["flat.wav"]
    np.testing.assert_allclose(softer, np.clip(flat, -1, 1), atol=1e-5)
    clipped = int(np.count_nonzero(np.abs(flat) > 1))
    assert small.report["files"]["flat.wav"]["clipped_samples"] == clipped > 0
    (remark,) = (remark for remark in small.report["remarks"] if "clipped" in remark)
    assert f"{clipped} in flat.wav" in remark
    assert "--full-scale-cm-s 4" in remark
    assert not any("clipped" in remark for remark in transfer.report["remarks"])


def test_flac_comes_beside_each_sound_when_asked_for(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    other = played(capture, tmp_path / "out", flac=True)
    for name in SOUNDS:
        assert other.bits(name) == transfer.bits(name)
        flac = name.replace(".wav", ".flac")
        np.testing.assert_array_equal(other[flac], transfer[name])
        assert other.report["files"][name]["flac"]["name"] == flac


CAMERAS = [
    ("png", {}),
    ("zarr", {"colour": "rgb"}),
    ("video", {"colour": "rgb"}),
    ("tiff", {"colour": "rgb", "rows": "outward"}),
    ("tiff", {"columns": "backward"}),
    ("zarr", {"columns": "backward", "rows": "outward"}),
]


@pytest.mark.parametrize(("layout", "sensor"), CAMERAS, ids=[f"{a} {' '.join(b.values())}" for a, b in CAMERAS])
def test_the_bits_do_not_depend_on_how_the_film_is_kept(
    film: Any, transfer: Any, played: Callable[..., Any], tmp_path: Path, layout: str, sensor: dict[str, str]
) -> None:
    if layout == "video":
        pytest.importorskip("av")
    folder = film.write(tmp_path / "capture", layout=layout, **sensor)
    other = played(folder, tmp_path / "out", workers=2)
    assert other.bits("flat.wav") == transfer.bits("flat.wav")
    assert other.report["share"] == transfer.report["share"]


def _riaa_db(frequency_hz: float) -> float:
    """Playback by the time constants of IEC 60098, any reference."""
    bass, middle, treble = (1j * 2 * np.pi * frequency_hz * constant_s for constant_s in (3180e-6, 318e-6, 75e-6))
    return float(20 * np.log10(abs((1 + middle) / (1 + bass) / (1 + treble))))


def test_the_equalised_sound_is_the_flat_one_with_the_characteristic_undone(transfer: Any) -> None:
    flat, equalised = transfer["flat.wav"], transfer["equalised.wav"]
    window = np.hanning(flat.size)
    time_s = np.arange(flat.size) / RATE_HZ

    def level_db(sound: Any, frequency_hz: float) -> float:
        return float(20 * np.log10(abs(np.sum(sound * window * np.exp(-2j * np.pi * frequency_hz * time_s)))))

    for frequency_hz in (910.0, 2370.0):
        change_db = level_db(equalised, frequency_hz) - level_db(flat, frequency_hz)
        assert change_db == pytest.approx(_riaa_db(frequency_hz) - _riaa_db(1000.0), abs=0.3)
    assert transfer.report["files"]["equalised.wav"]["characteristic"] == "riaa"


def test_the_shipped_recipe_read_from_a_file_gives_the_same_sound_whatever_is_undone(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recipe", "seed-paper"]) == 0
    (tmp_path / "x.toml").write_text(capsys.readouterr().out, encoding="utf-8")
    other = played(capture, tmp_path / "out", recipe=str(tmp_path / "x.toml"), characteristic_name="flat")
    assert other.bits("flat.wav") == transfer.bits("flat.wav")
    assert other.report["recipe"] == transfer.report["recipe"]
    np.testing.assert_allclose(other["equalised.wav"], other["flat.wav"], atol=2**-22)


def test_another_rate_is_the_same_sound(
    film: Any, capture: Path, played: Callable[..., Any], transfer: Any, tmp_path: Path
) -> None:
    slow = played(capture, tmp_path / "out", rate_hz=48_000.0)["flat.wav"]
    fast = transfer["flat.wav"][::2]
    inside = slice(20, min(slow.size, fast.size) - 20)
    # what is lost is the noise between 22 and 44 kHz
    assert np.corrcoef(slow[inside], fast[inside])[0, 1] > 0.99


@pytest.mark.parametrize("rate_hz", [0.0, 7.0, -96_000.0, 44_100.5, float("nan"), float("inf"), 2e6])
def test_an_impossible_rate_is_refused_before_anything_is_read(rate_hz: float) -> None:
    with pytest.raises(ArgumentError, match="rate"):
        Settings(rate_hz=rate_hz)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"workers": 0}, "0 workers"),
        ({"full_scale_m_s": 0.0}, "full scale"),
        ({"full_scale_m_s": float("nan")}, "full scale"),
        ({"flac": True, "rate_hz": 700_000.0}, "FLAC"),
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        Settings(**wrong)


def test_progress_is_told_after_every_group(capture: Path, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    play(
        open_capture(capture),
        load_recipe("seed-paper"),
        tmp_path / "out",
        Settings(workers=2),
        progress=lambda done, total, what: told.append((done, total)),
    )
    assert told == [(number, 8) for number in range(1, 9)]
