"""Results go to standard output, progress and messages to standard error; machines get JSON and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import soundfile
import wavinfo

COMMAND = [sys.executable, "-m", "gramoscope"]
COMMANDS = ("demo", "film", "play", "compare", "info", "recipe", "characteristics", "pack")


@pytest.fixture(scope="session")
def heard(here: Path, capture: Path, quickly: tuple[str, ...]) -> Path:
    """The capture, played by the command."""
    from gramoscope.cli.main import main

    assert main(["play", str(capture), "--out", str(here / "heard"), "--quiet", *quickly]) == 0
    return here / "heard"


def _film(tone: Path, bench: Path, folder: Path) -> tuple[Any, ...]:
    return ("film", tone, folder, "--bench", bench, "--start", 0.03, "--seconds", 0.0012)


def test_play_tells_what_the_transfer_is_worth_and_where_it_lies(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    answer = gramoscope("play", capture, "--out", tmp_path / "o", *quickly)
    assert answer.code == 0
    for words in ("0.003 s in", "recipe seed-paper", "6 read, 0 lost; 0 frames lost", "cm/s rms", "dB below the sound"):
        assert words in answer.out
    for name in ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav", "groove.png", "report.json"):
        assert str(tmp_path / "o" / name) in answer.out
        assert (tmp_path / "o" / name).stat().st_size > 500
    assert "6/6" in answer.err, "the bar"
    assert "Playing" not in answer.out


def test_play_writes_the_archives_words_and_flac_and_tells_what_was_clipped(
    gramoscope: Callable[..., Any], capture: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    words = ("--title", "Jánošík", "--originator", "The archive", "--reference", "A/1", "--description", "Side B")
    sound = ("--flac", "--full-scale-cm-s", 1)
    answer = gramoscope("play", capture, "--out", tmp_path / "o", *words, *sound, *quickly)
    assert answer.code == 0
    assert str(tmp_path / "o" / "walls.flac") in answer.out
    told = " ".join(answer.out.split())
    assert "samples beyond full scale (1 cm/s) were clipped: " in told
    assert "the scale to try next is --full-scale-cm-s 2" in told
    bext = wavinfo.WavInfoReader(str(tmp_path / "o" / "flat.wav")).bext
    assert (bext.originator, bext.originator_ref) == ("The archive", "A/1")
    assert bext.description.startswith("Side B. ")
    with soundfile.SoundFile(tmp_path / "o" / "flat.flac") as file:
        assert file.title == "Jánošík"


def test_compare_takes_the_scale_of_each_file_into_account(
    gramoscope: Callable[..., Any], capture: Path, heard: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    played = ("play", capture, "--out", tmp_path / "o", "--full-scale-cm-s", 200, "--flac", "--quiet", *quickly)
    assert gramoscope(*played).code == 0
    for copy in ("flat.wav", "flat.flac"):
        two = (heard / "flat.wav", tmp_path / "o" / copy)
        found = json.loads(gramoscope("compare", *two, "--band", 900, 9000, "--json").out)
        assert found["gain_db"] == pytest.approx(0, abs=0.001)
        assert found["waveform_r"] == pytest.approx(1)


def test_play_names_the_groups_that_are_lost(
    gramoscope: Callable[..., Any], copy_of: Path, quickly: tuple[str, ...], tmp_path: Path
) -> None:
    (copy_of / "frames" / "g000002.tif").unlink()
    answer = gramoscope("play", copy_of, "--out", tmp_path / "o", *quickly)
    assert answer.code == 0
    assert "5 read, 1 lost (2); 4 frames lost" in answer.out
    assert "Found: group 2, frames 0 … 3" in answer.out


def test_film_tells_how_to_play_what_it_made(
    gramoscope: Callable[..., Any], tone: Path, bench: Path, tmp_path: Path
) -> None:
    answer = gramoscope(*_film(tone, bench, tmp_path / "c"))
    assert answer.code == 0
    assert "3 groups of 4" in answer.out
    assert f"gramoscope play {tmp_path / 'c'} --out" in answer.out
    assert "Filming" in answer.err


def test_of_a_long_sound_a_moment_is_filmed_and_that_is_said(
    gramoscope: Callable[..., Any], tone: Path, bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gramoscope.cli.film.LONGEST_UNASKED_S", 0.001)
    answer = gramoscope("film", tone, tmp_path / "c", "--bench", bench)
    assert answer.code == 0
    assert "Filming the first 0.001 s of 0.5 s" in answer.out
    assert "--seconds 0.5" in answer.out


def test_quiet_commands_say_nothing(
    gramoscope: Callable[..., Any],
    tone: Path,
    bench: Path,
    capture: Path,
    heard: Path,
    quickly: tuple[str, ...],
    tmp_path: Path,
) -> None:
    for command in (
        _film(tone, bench, tmp_path / "c"),
        ("play", capture, "--out", tmp_path / "o", *quickly),
        ("compare", heard / "flat.wav", heard / "flat.wav", "--band", 900, 9000),
        ("info", capture),
    ):
        answer = gramoscope(*command, "--quiet")
        assert (answer.code, answer.out, answer.err) == (0, "", ""), command[0]


def test_json_is_all_that_stands_on_standard_output(
    gramoscope: Callable[..., Any],
    tone: Path,
    bench: Path,
    capture: Path,
    heard: Path,
    quickly: tuple[str, ...],
    tmp_path: Path,
) -> None:
    filmed = json.loads(gramoscope(*_film(tone, bench, tmp_path / "c"), "--json").out)
    assert (filmed["groups"], filmed["capture"]) == (3, str(tmp_path / "c"))
    played = json.loads(gramoscope("play", capture, "--out", tmp_path / "o", "--json", "--quiet", *quickly).out)
    assert played == json.loads((tmp_path / "o" / "report.json").read_text(encoding="utf-8"))
    alike = gramoscope("compare", heard / "flat.wav", heard / "equalised.wav", "--band", 900, 9000, "--json")
    assert json.loads(alike.out)["waveform_r"] == pytest.approx(1), "a flat record: nothing to undo"
    found = json.loads(gramoscope("info", capture, "--json").out)
    assert (found["sound"], found["groups_expected"], found["layout"]) == (True, 6, "tiff")


def test_compare_of_a_sound_with_itself_finds_nothing_between_them(gramoscope: Callable[..., Any], tone: Path) -> None:
    answer = gramoscope("compare", tone, tone)
    assert answer.code == 0
    for words in ("r = 1.0000", "+0.00 dB", "+0.0 µs", "the same"):
        assert words in answer.out


def test_compare_hears_that_a_sound_is_upside_down_late_and_soft(
    gramoscope: Callable[..., Any], tone: Path, tmp_path: Path
) -> None:
    sound, rate_hz = soundfile.read(tone)
    soundfile.write(tmp_path / "copy.wav", -0.5 * sound[441:9000], rate_hz, subtype="PCM_24")
    found = json.loads(gramoscope("compare", tone, tmp_path / "copy.wav", "--start", 0.01, "--json").out)
    assert found["polarity"] == -1
    assert found["gain_db"] == pytest.approx(-6.02, abs=0.05)
    assert found["delay_s"] == pytest.approx(0, abs=1e-6)
    assert "upside down" in gramoscope("compare", tone, tmp_path / "copy.wav", "--start", 0.01).out


def test_compare_draws_a_picture(gramoscope: Callable[..., Any], tone: Path, tmp_path: Path) -> None:
    assert gramoscope("compare", tone, tone, "--picture", tmp_path / "p.png", "--quiet").code == 0
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


def test_info_of_a_sound_capture_ends_with_0_and_says_what_it_will_sound_like(
    gramoscope: Callable[..., Any], capture: Path
) -> None:
    answer = gramoscope("info", capture)
    assert answer.code == 0
    assert "24 of 24 in 6 groups" in answer.out
    assert "0.003 s from" in answer.out
    assert "96 kHz" in answer.out
    assert "Nothing wrong was found." in answer.out


@pytest.mark.parametrize("quick", [False, True])
def test_info_of_a_damaged_capture_ends_with_1_and_names_the_damage(
    gramoscope: Callable[..., Any], copy_of: Path, quick: bool
) -> None:
    (copy_of / "frames" / "g000003.tif").unlink()
    last = copy_of / "frames" / "g000005.tif"
    last.write_bytes(last.read_bytes()[:700_000])
    options = ["--quick"] if quick else []
    answer = gramoscope("info", copy_of, *options)
    assert answer.code == 1
    assert "Found:" in answer.out
    assert "g000003.tif" in answer.out
    assert "g000005.tif" in answer.out
    assert "Nothing wrong" not in answer.out
    found = gramoscope("info", copy_of, *options, "--json")
    assert found.code == 1
    assert [group["number"] for group in json.loads(found.out)["groups"]] == [3, 5]
    assert gramoscope("info", copy_of, *options, "--quiet").code == 1


def test_recipe_lists_and_prints(gramoscope: Callable[..., Any]) -> None:
    assert "seed-paper" in gramoscope("recipe").out
    printed = gramoscope("recipe", "seed-paper").out
    assert printed.startswith("#")
    assert printed.endswith("\n")
    assert "\x1b" not in printed


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_and_every_option(gramoscope: Callable[..., Any], command: str) -> None:
    answer = gramoscope(command, "--help")
    assert answer.code == 0
    assert answer.err == ""
    assert f"gramoscope {command}" in answer.out
    assert "--no-" not in answer.out, "no option says the opposite of what nobody said"
    assert "--empty-" not in answer.out
    options = [line.strip("│ ") for line in answer.out.splitlines() if line.strip("│* ").startswith("--")]
    assert all(len(line.split()) > 2 for line in options)


def test_help_and_version_come_without_a_command(gramoscope: Callable[..., Any]) -> None:
    text = gramoscope("--help").out
    assert all(command in text for command in COMMANDS)
    assert "Exit codes" in text
    assert gramoscope("--version").out.strip()


def test_the_demonstration_goes_all_the_way_round(
    gramoscope: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = gramoscope("demo", "--out", tmp_path / "d", "--seconds", 0.01, "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert found["waveform_r"] > 0.8
    assert found["polarity"] == 1
    for name in ("original.wav", "comparison.png", "played/flat.wav", "played/groove.png", "capture/truth.npz"):
        assert (tmp_path / "d" / name).is_file()


def _run(*arguments: Any, out: Any) -> subprocess.CompletedProcess[bytes]:
    command = [*COMMAND, *(str(argument) for argument in arguments)]
    environment = {**os.environ, "COLUMNS": "200"}
    return subprocess.run(command, stdout=out, stderr=subprocess.PIPE, check=False, env=environment)


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    answer = _run("recipe", "seed-paper", out=writer)
    os.close(writer)
    assert answer.returncode == 0
    assert answer.stderr == b""


def test_a_result_that_cannot_be_written_is_said() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no full device")
    with Path("/dev/full").open("wb") as full:
        answer = _run("recipe", "seed-paper", out=full)
    assert answer.returncode == 2
    assert "No space left" in answer.stderr.decode()
    assert "Traceback" not in answer.stderr.decode()
