"""Sound files are exact, whole or absent, and bad ones are named."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import soundfile

from gramoscope.errors import ArgumentError, OutputError, SoundError
from gramoscope.listening.wav import Subtype, WavWriter, read_sound

RATE_HZ = 22_050


def _sound(count: int = 4_321, *, channels: int = 1) -> np.ndarray:
    return np.random.default_rng(5).uniform(-0.3, 0.41, (count, channels))


@contextmanager
def _disk_of(size_bytes: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _write_and_fail(path: Path, failure: BaseException) -> None:
    with WavWriter(path, rate_hz=RATE_HZ) as writer:
        writer.write(_sound())
        raise failure


def _write_often(path: Path, *, subtype: Subtype) -> None:
    with WavWriter(path, rate_hz=RATE_HZ, subtype=subtype) as writer:
        for _ in range(9):
            writer.write(_sound())


def test_a_velocity_of_full_scale_becomes_one_and_24_bits_round_to_half_a_step(tmp_path: Path) -> None:
    velocity = _sound()
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ, full_scale_m_s=0.7) as writer:
        writer.write(velocity)
    samples, rate_hz = read_sound(tmp_path / "a.wav")
    assert rate_hz == RATE_HZ
    assert np.max(np.abs(samples - velocity / 0.7)) <= 0.5 / 2**23
    assert soundfile.info(tmp_path / "a.wav").subtype == "PCM_24"


def test_float_files_keep_what_lies_beyond_full_scale(tmp_path: Path) -> None:
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ, subtype="FLOAT", full_scale_m_s=0.1) as writer:
        writer.write(_sound())
    samples, _ = read_sound(tmp_path / "a.wav")
    assert samples == pytest.approx(_sound() / 0.1, rel=1e-7)
    assert writer.clipped_samples == 0


def test_the_default_scale_is_half_a_metre_a_second_and_stands_in_the_file(tmp_path: Path) -> None:
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ) as writer:
        writer.write([0.125, -0.0625])
    assert read_sound(tmp_path / "a.wav")[0][:, 0].tolist() == [0.25, -0.125]
    with soundfile.SoundFile(tmp_path / "a.wav") as file:
        assert file.comment == "full scale = 0.5 m/s groove velocity"


def test_clipped_samples_are_held_at_the_rails_and_counted(tmp_path: Path) -> None:
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ, full_scale_m_s=1.0) as writer:
        writer.write([0.5, 1.5, -7.0, -1.0])
        writer.write([1.0, 3.0])
    samples = read_sound(tmp_path / "a.wav")[0][:, 0]
    assert samples.tolist() == [0.5, 1 - 2**-23, -1.0, -1.0, 1 - 2**-23, 1 - 2**-23]
    assert writer.clipped_samples == 3


def test_what_is_no_number_becomes_silence_and_is_counted(tmp_path: Path) -> None:
    given = np.array([0.1, np.nan, np.inf, -0.2])
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ) as writer:
        writer.write(given)
    assert read_sound(tmp_path / "a.wav")[0][1:3].tolist() == [[0.0], [0.0]]
    assert writer.silenced_samples == 2
    assert np.isnan(given[1]), "the input was modified"


@pytest.mark.parametrize("subtype", ["PCM_24", "FLOAT"])
def test_the_bytes_do_not_depend_on_the_pieces_nor_on_the_hour(tmp_path: Path, subtype: Subtype) -> None:
    velocity = _sound(channels=2)
    with WavWriter(tmp_path / "whole.wav", rate_hz=RATE_HZ, channels=2, subtype=subtype) as writer:
        writer.write(velocity)
    with WavWriter(tmp_path / "pieces.wav", rate_hz=RATE_HZ, channels=2, subtype=subtype) as writer:
        for piece in np.split(velocity, [1, 700, 701, 3_000]):
            writer.write(piece)
    assert (tmp_path / "whole.wav").read_bytes() == (tmp_path / "pieces.wav").read_bytes()
    content = (tmp_path / "whole.wav").read_bytes()
    peak = content.find(b"PEAK")
    assert (peak > 0) == (subtype == "FLOAT")
    assert peak < 0 or content[peak + 12 : peak + 16] == bytes(4)
    assert writer.samples_written == len(velocity)


@pytest.mark.parametrize("failure", [RuntimeError("in the middle"), KeyboardInterrupt()])
def test_nothing_remains_of_a_file_that_was_not_finished(tmp_path: Path, failure: BaseException) -> None:
    with pytest.raises(type(failure)):
        _write_and_fail(tmp_path / "a.wav", failure)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_file_leaves_the_older_one_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(b"older")
    with pytest.raises(RuntimeError):
        _write_and_fail(tmp_path / "a.wav", RuntimeError())
    assert (tmp_path / "a.wav").read_bytes() == b"older"


def test_files_that_belong_together_appear_only_when_each_is_committed(tmp_path: Path) -> None:
    writers = [WavWriter(tmp_path / name, rate_hz=RATE_HZ) for name in ("a.wav", "b.wav")]
    for writer in writers:
        writer.write(_sound())
        writer.finish()
    assert not (tmp_path / "a.wav").exists()
    writers[0].commit()
    writers[1].discard()
    assert [path.name for path in tmp_path.iterdir()] == ["a.wav"]
    writers[0].discard()
    assert (tmp_path / "a.wav").exists(), "discarding a committed file must not remove it"


def test_a_finished_file_takes_no_more_and_a_discarded_one_cannot_be_committed(tmp_path: Path) -> None:
    writer = WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ)
    writer.finish()
    with pytest.raises(ArgumentError, match="finished"):
        writer.write([0.1])
    writer.discard()
    with pytest.raises(ArgumentError, match="discarded"):
        writer.commit()


@pytest.mark.parametrize("size_bytes", [20, 30_000])
@pytest.mark.parametrize("subtype", ["PCM_24", "FLOAT"])
def test_a_full_disk_is_an_output_error_that_leaves_nothing(tmp_path: Path, size_bytes: int, subtype: Subtype) -> None:
    with (
        _disk_of(size_bytes),
        pytest.raises(OutputError, match=r"(?s)a\.wav cannot be written.*Try: free some space"),
    ):
        _write_often(tmp_path / "a.wav", subtype=subtype)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_and_a_folder_of_that_name_are_output_errors(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="create the folder"):
        WavWriter(tmp_path / "nowhere" / "a.wav", rate_hz=RATE_HZ)
    with pytest.raises(OutputError, match="a folder has that one"):
        WavWriter(tmp_path, rate_hz=RATE_HZ)


@pytest.mark.parametrize(
    "wrong", [{"rate_hz": 0}, {"rate_hz": 44_100.5}, {"channels": 0}, {"subtype": "PCM_U8"}, {"full_scale_m_s": 0.0}]
)
def test_impossible_formats_are_argument_errors(tmp_path: Path, wrong: dict[str, object]) -> None:
    with pytest.raises(ArgumentError):
        WavWriter(tmp_path / "a.wav", **{"rate_hz": RATE_HZ, **wrong})  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_number_of_channels_is_an_argument_error(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="channel"), WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ) as writer:
        writer.write(_sound(channels=2))


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
