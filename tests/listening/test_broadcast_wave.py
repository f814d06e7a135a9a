"""Sound files that go out are exact, whole or absent, valid at any moment, and of the size that their header says."""

from __future__ import annotations

import resource
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import soundfile

from gramoscope.errors import ArgumentError, OutputError
from gramoscope.listening.broadcast_wave import WavWriter
from gramoscope.listening.sample_format import SampleFormat
from gramoscope.listening.wav import full_scale_of, read_sound

RATE_HZ = 22_050
ALL_FORMATS = pytest.mark.parametrize("sample_format", list(SampleFormat), ids=lambda f: f.name)
TWO_FORMATS = pytest.mark.parametrize(
    "sample_format", [SampleFormat.PCM_24, SampleFormat.FLOAT_32], ids=lambda f: f.name
)


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


def _write_often(path: Path, *, sample_format: SampleFormat) -> None:
    with WavWriter(path, rate_hz=RATE_HZ, sample_format=sample_format) as writer:
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
    with WavWriter(
        tmp_path / "a.wav", rate_hz=RATE_HZ, sample_format=SampleFormat.FLOAT_32, full_scale_m_s=0.1
    ) as writer:
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
    assert full_scale_of(tmp_path / "a.wav") == 0.5


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


@TWO_FORMATS
def test_the_bytes_do_not_depend_on_the_pieces(tmp_path: Path, sample_format: SampleFormat) -> None:
    velocity = _sound(channels=2)
    with WavWriter(tmp_path / "whole.wav", rate_hz=RATE_HZ, channels=2, sample_format=sample_format) as writer:
        writer.write(velocity)
    with WavWriter(tmp_path / "pieces.wav", rate_hz=RATE_HZ, channels=2, sample_format=sample_format) as writer:
        for piece in np.split(velocity, [1, 700, 701, 3_000]):
            writer.write(piece)
    assert (tmp_path / "whole.wav").read_bytes() == (tmp_path / "pieces.wav").read_bytes()
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
@TWO_FORMATS
def test_a_full_disk_is_an_output_error_that_leaves_nothing(
    tmp_path: Path, size_bytes: int, sample_format: SampleFormat
) -> None:
    with (
        _disk_of(size_bytes),
        pytest.raises(OutputError, match=r"(?s)a\.wav cannot be written.*Try: free some space"),
    ):
        _write_often(tmp_path / "a.wav", sample_format=sample_format)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_and_a_folder_of_that_name_are_output_errors(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="create the folder"):
        WavWriter(tmp_path / "nowhere" / "a.wav", rate_hz=RATE_HZ)
    with pytest.raises(OutputError, match="a folder has that one"):
        WavWriter(tmp_path, rate_hz=RATE_HZ)


@pytest.mark.parametrize(
    "wrong",
    [{"rate_hz": 0}, {"rate_hz": 44_100.5}, {"channels": 0}, {"riff_limit_bytes": 2**33}, {"full_scale_m_s": 0.0}],
)
def test_impossible_formats_are_argument_errors(tmp_path: Path, wrong: dict[str, object]) -> None:
    with pytest.raises(ArgumentError):
        WavWriter(tmp_path / "a.wav", **{"rate_hz": RATE_HZ, **wrong})  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_number_of_channels_is_an_argument_error(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="channel"), WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ) as writer:
        writer.write(_sound(channels=2))


def chunks_of(content: bytes) -> dict[bytes, bytes]:
    """The chunks of a file as the standards lay them out, to the byte; an error wherever it is not as they say.

    Bytes after the end that the file states are allowed: they were written and not yet owned to.
    """
    form, size, kind = struct.unpack_from("<4sI4s", content)
    assert kind == b"WAVE"
    assert form in (b"RIFF", b"RF64")
    sizes: dict[bytes, int] = {}
    if form == b"RF64":
        assert content[12:20] == b"ds64" + struct.pack("<I", 28)
        assert size == 2**32 - 1
        size, sizes[b"data"], frames, table = struct.unpack_from("<QQQI", content, 20)
        assert table == 0
    found: dict[bytes, bytes] = {}
    place, end = 12, 8 + size
    assert end <= len(content), "the file says that it is longer than it is"
    while place < end:
        name, length = struct.unpack_from("<4sI", content, place)
        length = sizes.get(name, 0) if length == 2**32 - 1 else length
        assert name not in found
        found[name] = content[place + 8 : place + 8 + length]
        assert len(found[name]) == length
        place += 8 + length + length % 2
    assert place == end
    if form == b"RF64":
        align = struct.unpack_from("<H", found[b"fmt "], 12)[0]
        assert len(found[b"data"]) == frames * align
    return found


@ALL_FORMATS
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("limit_bytes", [2**32 - 2, 4_000], ids=["RIFF", "RF64"])
def test_each_format_is_laid_out_as_the_standards_say_and_read_back(
    tmp_path: Path, sample_format: SampleFormat, channels: int, limit_bytes: int
) -> None:
    velocity = _sound(1_237, channels=channels)
    with WavWriter(
        tmp_path / "a.wav",
        rate_hz=RATE_HZ,
        channels=channels,
        sample_format=sample_format,
        riff_limit_bytes=limit_bytes,
    ) as writer:
        writer.write(velocity)
    content = (tmp_path / "a.wav").read_bytes()
    found = chunks_of(content)
    big, floats = limit_bytes == 4_000 and len(content) > 4_008, sample_format.is_float
    expected = ["ds64" if big else "JUNK", "bext", "fmt ", *(["fact"] if floats else []), "LIST", "data"]
    assert [name.decode() for name in found] == expected
    assert len(found[b"data"]) == 1_237 * channels * sample_format.bits // 8
    step = 2.0**-24 if floats else 2.0 ** (1 - sample_format.bits)
    assert np.abs(read_sound(tmp_path / "a.wav")[0] - velocity / 0.5).max() <= 0.5 * step * 1.001


def test_a_file_becomes_rf64_with_the_byte_that_passes_the_limit(tmp_path: Path) -> None:
    sizes = {}
    for count in (500, 502, 504):
        with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ, riff_limit_bytes=2_246) as writer:
            writer.write(_sound(count))
        content = (tmp_path / "a.wav").read_bytes()
        sizes[len(content) - 8] = content[:4]
        assert len(chunks_of(content)[b"data"]) == 3 * count
    assert [name for size, name in sorted(sizes.items()) if size <= 2_246] != []
    assert all(name == (b"RIFF" if size <= 2_246 else b"RF64") for size, name in sizes.items()), sizes
    assert len(set(sizes.values())) == 2, sizes


def test_sizes_beyond_4_gb_are_written_in_64_bits_and_read(tmp_path: Path) -> None:
    """A sparse file: the header is ours, and so is the last sample; nobody wrote what lies between."""
    frames = 1_500_000_001
    with WavWriter(tmp_path / "a.wav", rate_hz=RATE_HZ) as writer:
        writer.write([0.1])
    header = writer._header.written(frames)
    with (tmp_path / "big.wav").open("wb") as file:
        file.write(header)
        file.seek(len(header) + 3 * (frames - 1))
        file.write(b"\x00\x00\x40\x00")
    assert (header[:4], len(header)) == (b"RF64", len(writer._header.written(1)))
    with soundfile.SoundFile(tmp_path / "big.wav") as file:
        assert file.frames == frames
        file.seek(frames - 1)
        assert file.read(1).tolist() == [0.5]


class _Watched(WavWriter):
    """Keeps what lies on disk after every single write."""

    def __init__(self, *arguments: object, **options: object) -> None:
        self.seen: list[bytes] = []
        super().__init__(*arguments, **options)  # type: ignore[arg-type]

    def _write_all(self, content: bytes) -> None:
        super()._write_all(content)
        self.seen.append(self.temporary.read_bytes())


@pytest.mark.parametrize("limit_bytes", [2**32 - 2, 5_000], ids=["RIFF", "RF64"])
@pytest.mark.parametrize("channels", [1, 2])
def test_whenever_the_writer_is_killed_the_file_is_valid_and_holds_what_it_owns_to(
    tmp_path: Path, channels: int, limit_bytes: int
) -> None:
    velocity = _sound(2_345, channels=channels)
    with _Watched(tmp_path / "a.wav", rate_hz=RATE_HZ, channels=channels, riff_limit_bytes=limit_bytes) as writer:
        for piece in np.split(velocity, [1, 2, 702, 1_403]):
            writer.write(piece)
    whole = chunks_of((tmp_path / "a.wav").read_bytes())[b"data"]
    lengths = []
    for content in writer.seen:
        found = chunks_of(content)
        assert whole.startswith(found[b"data"])
        lengths.append(len(found[b"data"]))
        (tmp_path / "killed.wav").write_bytes(content)
        assert soundfile.info(tmp_path / "killed.wav").frames == len(found[b"data"]) // (3 * channels)
    assert lengths == sorted(lengths)
    assert len(set(lengths)) > 3
    assert lengths[-1] == len(whole)


def test_dither_makes_the_error_of_16_bits_independent_of_the_sound_and_comes_again(tmp_path: Path) -> None:
    """A sound of a third of a step: rounding makes silence of it, dither keeps it in the mean."""
    velocity = np.full(40_000, 0.3 * 2**-15)

    def written(seed: int | None) -> np.ndarray:
        dither = None if seed is None else np.random.default_rng(seed)
        with WavWriter(
            tmp_path / "a.wav", rate_hz=RATE_HZ, sample_format=SampleFormat.PCM_16, full_scale_m_s=1.0, dither=dither
        ) as writer:
            for piece in np.split(velocity, [1, 13_000]):
                writer.write(piece)
        return read_sound(tmp_path / "a.wav")[0][:, 0] * 2**15

    assert not written(None).any()
    assert written(3).mean() == pytest.approx(0.3, abs=0.02)
    # a quarter of a square step: a twelfth of the rounding, two twelfths of the dither
    assert written(3).var() == pytest.approx(0.25, rel=0.03)
    np.testing.assert_array_equal(written(3), written(3))
    assert np.any(written(3) != written(4))
