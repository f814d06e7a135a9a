"""Whatever cannot work as given ends in one message, exit code 2, and nothing half written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from gramoscope.player.recipe import recipe_text


def _tree(folder: Path) -> dict[str, int]:
    return {str(path.relative_to(folder)): path.stat().st_size for path in folder.rglob("*")}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with all kinds of things that are not what they seem."""
    (tmp_path / "text.wav").write_text("a song")
    (tmp_path / "empty.wav").write_bytes(b"")
    soundfile.write(tmp_path / "silent.wav", np.zeros(4410), 44_100)
    soundfile.write(tmp_path / "short.wav", np.full(1, 0.5), 44_100)
    soundfile.write(tmp_path / "nan.wav", np.full(500, np.nan), 44_100, subtype="FLOAT")
    soundfile.write(tmp_path / "sound.wav", np.sin(np.arange(9000) * 0.1), 44_100)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.txt").write_text("mine")
    (tmp_path / "wrong.toml").write_text(recipe_text("seed-paper").replace("gate =", "gait ="))
    return tmp_path


@pytest.fixture
def refused(gramoscope: Callable[..., Any], place: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Run a command that must be refused, in that folder; return what it said."""
    monkeypatch.chdir(place)

    def run(*arguments: Any) -> str:
        before = _tree(place)
        answer = gramoscope(*arguments)
        assert answer.code == 2, answer
        assert answer.out == ""
        assert "Traceback" not in answer.err
        assert answer.err.count("╭") == 1, "one message, and no bar that stands still"
        assert "━" not in answer.err
        assert _tree(place) == before, "nothing written, nothing lost"
        return " ".join(answer.err.replace("│", " ").split())

    return run


FILM_REFUSED = [
    (("nothing.wav", "c"), "there is no file nothing.wav"),
    (("text.wav", "c"), "cannot be read as sound"),
    (("empty.wav", "c"), "cannot be read as sound"),
    (("folder", "c"), "there is no file folder"),
    (("silent.wav", "c"), "silent"),
    (("short.wav", "c"), "1 sample"),
    (("nan.wav", "c"), "no numbers"),
    (("sound.wav", "c", "--start", "99"), "lasts 0.204 s"),
    (("sound.wav", "c", "--start", "-1"), "a start at -1.0 s"),
    (("sound.wav", "c", "--seconds", "0"), "0.0 seconds"),
    (("sound.wav", "c", "--seconds", "nan"), "a finite number"),
    (("sound.wav", "c", "--start", "inf"), "a finite number"),
    (("sound.wav", "c", "--level-cm-s", "-1"), "-0.01 m/s"),
    (("sound.wav", "c", "--level-cm-s", "nan"), "a finite number"),
    (("sound.wav", "c", "--characteristic", "riia"), "did you mean riaa"),
    (("sound.wav", "c", "--workers", "0"), "at least 1"),
    (("sound.wav", "c", "--seed", "-1"), "the seed is -1"),
    (("sound.wav", "c", "--bits", "0"), "the camera has 0 bits"),
    (("sound.wav", "c", "--bits", "17"), "the camera has 17 bits"),
    (("sound.wav", "c", "--frames-per-group", "0"), "0 frames in a group"),
    (("sound.wav", "c", "--texture", "wood"), '"powder", "shellac", "polished"'),
    (("sound.wav", "c", "--bench", "nothing.toml"), "there is no file nothing.toml"),
    (("sound.wav", "c", "--bench", "text.wav"), "text.wav is not TOML"),
    (("sound.wav", "c", "--sped", "3"), "Unknown option"),
    (("sound.wav", "file"), "in use and is no capture"),
    (("sound.wav", "folder"), "in use and is no capture"),
    (("sound.wav", "folder", "--overwrite"), "in use and is no capture"),
    (("sound.wav", "file/c"), "cannot be written"),
    (("sound.wav",), "CAPTURE requires an argument"),
]


@pytest.mark.parametrize(("arguments", "said"), FILM_REFUSED, ids=[" ".join(words) for words, _ in FILM_REFUSED])
def test_film_refuses(refused: Callable[..., str], arguments: tuple[str, ...], said: str) -> None:
    short = () if "--seconds" in arguments else ("--seconds", "0.002")
    assert said in refused("film", *arguments, *short)


PLAY_REFUSED = [
    (("--out", "o", "--recipe", "sed-paper"), "there is no recipe 'sed-paper'"),
    (("--out", "o", "--recipe", "wrong.toml"), "write 'gate'"),
    (("--out", "o", "--rate", "0"), "a rate of 0 Hz"),
    (("--out", "o", "--rate", "7"), "a rate of 7 Hz"),
    (("--out", "o", "--rate", "fast"), "--rate"),
    (("--out", "o", "--rate", "700000", "--flac"), "FLAC at 700000 Hz"),
    (("--out", "o", "--full-scale-cm-s", "0"), "a full scale of 0 cm/s"),
    (("--out", "o", "--full-scale-cm-s", "nan"), "a finite number"),
    (("--out", "o", "--originator", "o" * 33), "the originator has 33 characters"),
    (("--out", "o", "--reference", "r" * 33), "the originator's reference has 33 characters"),
    (("--out", "o", "--description", "d" * 257), "the description has 257 characters"),
    (("--out", "o", "--workers", "0"), "at least 1"),
    (("--out", "o", "--characteristic", "riia"), "did you mean riaa"),
    (("--out", "o", "--characteristic", "500-16"), "500N-16"),
    (("--out", "file"), "the folder file cannot be made"),
    (("--out", "file/deeper"), "the folder file/deeper cannot be made"),
    (("--out", "/proc/gramoscope"), "the folder /proc/gramoscope cannot be made"),
    (("--out", "o", "--sped", "3"), "Unknown option"),
    (("--out", "o", "another"), "another"),
    ((), "--out requires an argument"),
]


@pytest.mark.parametrize(("arguments", "said"), PLAY_REFUSED, ids=[" ".join(words) for words, _ in PLAY_REFUSED])
def test_play_refuses(refused: Callable[..., str], capture: Path, arguments: tuple[str, ...], said: str) -> None:
    assert said in refused("play", capture, *arguments)


def _edited(copy: Path, old: str, new: str) -> Path:
    manifest = copy / "capture.toml"
    text = manifest.read_text(encoding="utf-8")
    assert old in text
    manifest.write_text(text.replace(old, new), encoding="utf-8")
    return copy


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rpm = 78.0\n", "", "missing key [disc] rpm"),
        ("rpm = 78.0", "rmp = 78.0", "rpm"),
        ("rpm = 78.0", "rpm = -78.0", "rpm"),
        ("rpm = 78.0", 'rpm = "fast"', "rpm"),
        ("groups = 6", "groups = 0", "groups"),
        ("[camera]", "[camera", "is not TOML"),
        ('g{group:06d}.tif"', '../../g{group:06d}.tif"', "frames"),
    ],
)
@pytest.mark.parametrize("command", ["play", "info"])
def test_a_wrong_manifest_is_refused(
    refused: Callable[..., str], copy_of: Path, command: str, old: str, new: str, said: str
) -> None:
    folder = _edited(copy_of, old, new)
    assert said in refused(command, folder, *(["--out", "o"] if command == "play" else []))


@pytest.mark.parametrize("command", ["play", "info"])
def test_a_capture_that_is_not_there_is_refused(refused: Callable[..., str], command: str) -> None:
    out = ["--out", "o"] if command == "play" else []
    assert "there is no folder nothing" in refused(command, "nothing", *out)
    assert "there is no capture.toml in folder" in refused(command, "folder", *out)


@pytest.mark.parametrize("command", ["play", "info"])
def test_a_capture_without_a_single_frame_is_refused(refused: Callable[..., str], copy_of: Path, command: str) -> None:
    for file in (copy_of / "frames").iterdir():
        file.unlink()
    out = ["--out", "o"] if command == "play" else []
    assert "there is not one frame" in refused(command, copy_of, *out)


def test_a_capture_in_which_no_groove_is_seen_is_refused_after_it_was_read(
    gramoscope: Callable[..., Any], copy_of: Path, tmp_path: Path
) -> None:
    for file in (copy_of / "frames").iterdir():
        file.write_bytes(b"II*\0 not a picture")
    for recipe in ("best", "seed-paper"):
        answer = gramoscope("play", copy_of, "--out", tmp_path / "o", "--recipe", recipe)
        assert answer.code == 2
        assert "the groove was not found in any of 6 groups" in answer.err
        assert "Needed:" in answer.err
        assert "Try:" in answer.err
        assert not (tmp_path / "o").exists()


def test_a_film_too_short_to_learn_from_is_refused_and_told_what_reads_it(
    refused: Callable[..., str], capture: Path, tmp_path: Path
) -> None:
    said = refused("play", capture, "--out", tmp_path / "o", "--recipe", "best")
    assert "too little of the stripes is seen to learn their texture" in said
    assert "seed-paper" in said


COMPARE_REFUSED = [
    (("nothing.wav", "sound.wav"), "there is no file nothing.wav"),
    (("sound.wav", "text.wav"), "cannot be read as sound"),
    (("sound.wav", "silent.wav"), "silent"),
    (("short.wav", "short.wav"), "0.02 ms of sound"),
    (("sound.wav", "sound.wav", "--start", "9"), "ends before 9 s"),
    (("sound.wav", "sound.wav", "--start", "-1"), "--start -1"),
    (("sound.wav", "sound.wav", "--trim-ms", "-2"), "--trim-ms -2"),
    (("sound.wav", "sound.wav", "--max-delay-ms", "inf"), "a finite number"),
    (("sound.wav", "sound.wav", "--band", "9000", "200"), "two rising frequencies"),
    (("sound.wav", "sound.wav", "--band", "nan", "200"), "a finite number"),
    (("sound.wav", "sound.wav", "--picture", "folder"), "folder cannot be written"),
    (("sound.wav",), "B requires an argument"),
]


@pytest.mark.parametrize(("arguments", "said"), COMPARE_REFUSED, ids=[" ".join(words) for words, _ in COMPARE_REFUSED])
def test_compare_refuses(refused: Callable[..., str], arguments: tuple[str, ...], said: str) -> None:
    assert said in refused("compare", *arguments)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("pley",), 'Did you mean "play"?'),
        (("--nonsense",), "Unknown"),
        (("recipe", "sed-paper"), "there is no recipe"),
        (("recipe", "wrong.toml"), "write 'gate'"),
        (("demo", "--seconds", "0"), "0 seconds"),
        (("demo", "--seconds", "nan"), "a finite number"),
        (("demo", "--workers", "-2"), "at least 1"),
    ],
)
def test_other_commands_refuse(refused: Callable[..., str], arguments: tuple[str, ...], said: str) -> None:
    assert said in refused(*arguments)


def test_a_capture_is_only_replaced_when_asked(
    gramoscope: Callable[..., Any], copy_of: Path, tone: Path, bench: Path
) -> None:
    before = _tree(copy_of)
    command = ("film", tone, copy_of, "--bench", bench, "--seconds", 0.0012, "--start", 0.1)
    answer = gramoscope(*command)
    assert answer.code == 2
    assert "there is a capture in" in answer.err
    assert _tree(copy_of) == before
    assert gramoscope(*command, "--overwrite").code == 0
    assert len(list((copy_of / "frames").iterdir())) == 3
    assert {path.name for path in copy_of.parent.iterdir()} == {"spoilt"}
