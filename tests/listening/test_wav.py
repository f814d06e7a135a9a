"""Sound files that come in are read as they are, and bad ones are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from gramoscope.errors import ArgumentError, SoundError
from gramoscope.listening.wav import read_sound

RATE_HZ = 22_050


def _sound(count: int = 4_321, *, channels: int = 1) -> np.ndarray:
    return np.random.default_rng(5).uniform(-0.3, 0.41, (count, channels))


def test_a_part_of_a_sound_is_that_part(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.flac", _sound(channels=2), RATE_HZ)
    whole, _ = read_sound(tmp_path / "a.flac")
    part, rate_hz = read_sound(tmp_path / "a.flac", start_s=1_000 / RATE_HZ, seconds=77 / RATE_HZ)
    assert part.tolist() == whole[1_000:1_077].tolist()
    assert rate_hz == RATE_HZ
    rest, _ = read_sound(tmp_path / "a.flac", start_s=4_000 / RATE_HZ, seconds=99.0)
    assert rest.tolist() == whole[4_000:].tolist()


@pytest.mark.parametrize("suffix", ["wav", "flac", "ogg", "mp3", "aiff"])
def test_whatever_libsndfile_reads_is_read(tmp_path: Path, suffix: str) -> None:
    time_s = np.arange(RATE_HZ // 2) / RATE_HZ
    tone = 0.3 * np.sin(2 * np.pi * 431 * time_s)
    soundfile.write(tmp_path / f"a.{suffix}", tone, RATE_HZ)
    samples, rate_hz = read_sound(tmp_path / f"a.{suffix}")
    assert (samples.shape[1], rate_hz, samples.dtype) == (1, RATE_HZ, np.float64)
    assert samples.std() == pytest.approx(tone.std(), rel=0.02)


def test_what_is_no_sound_is_a_sound_error_that_says_so(tmp_path: Path) -> None:
    (tmp_path / "text.wav").write_text("not a sound")
    (tmp_path / "blank.wav").touch()
    (tmp_path / "headless.raw").write_bytes(bytes(64))
    soundfile.write(tmp_path / "none.wav", np.empty(0), RATE_HZ)
    soundfile.write(tmp_path / "nan.wav", np.array([0.1, np.nan]), RATE_HZ, subtype="FLOAT")
    for name, words in {
        "missing.wav": "no file",
        "text.wav": "cannot be read as sound",
        "blank.wav": "cannot be read as sound",
        "headless.raw": "no header",
        "none.wav": "no sound",
        "nan.wav": "no numbers",
    }.items():
        with pytest.raises(SoundError, match=words) as caught:
            read_sound(tmp_path / name)
        assert name in caught.value.found
        assert caught.value.remedy


def test_a_start_beyond_the_end_is_a_sound_error_and_a_negative_one_an_argument_error(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.wav", _sound(), RATE_HZ)
    with pytest.raises(SoundError, match=r"lasts 0\.196 s"):
        read_sound(tmp_path / "a.wav", start_s=0.2)
    with pytest.raises(ArgumentError):
        read_sound(tmp_path / "a.wav", start_s=-0.1)
    with pytest.raises(ArgumentError):
        read_sound(tmp_path / "a.wav", seconds=0)
