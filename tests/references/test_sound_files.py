"""Our sound files, judged by programs that we did not write: wavinfo, libsndfile, MediaInfo, FFmpeg, SoX, sha256sum.

The first two are always there (extra `dev`); a test of another is skipped, with a message, where it is not installed.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyloudnorm
import pytest
import soundfile
import wavinfo

from gramoscope.listening.broadcast_metadata import BroadcastMetadata, CodingStep, basic_umid
from gramoscope.listening.broadcast_wave import WavWriter
from gramoscope.listening.flac import write_flac
from gramoscope.listening.loudness import LoudnessMeter
from gramoscope.listening.sample_format import SampleFormat

RATE_HZ = 96_000
UMID = basic_umid("a song", channels=2)
HISTORY = (
    CodingStep("ANALOGUE", "mono", "gramophone record; 78 rpm; lateral cut"),
    CodingStep("PCM", "dual-mono", "Gramoscope; optical; flat", RATE_HZ, 24),
)
LINES = [step.line() for step in HISTORY]
METADATA = BroadcastMetadata(
    description="A song of 1931, matrix 4711-II",
    originator="The archive",
    originator_reference="XX-ARC-0000004711",
    made=datetime(2031, 2, 13, 14, 15, 16, tzinfo=UTC),
    time_reference=96_007,
    coding_history=HISTORY,
    umid=UMID,
    info={"INAM": "A song", "IART": "A singer", "ISFT": "Gramoscope", "ICMT": "both walls"},
)


def sound() -> np.ndarray:
    """Four seconds of two tones in two channels, not alike, with a swell, so that every loudness has a value."""
    time_s = np.arange(4 * RATE_HZ + 1) / RATE_HZ
    swell = 0.02 + 0.08 * time_s / 4
    left = swell * np.sin(2 * np.pi * 441 * time_s)
    return np.column_stack([left, 0.6 * left + 0.01 * np.sin(2 * np.pi * 3100 * time_s + 0.3)])


def write(path: Path, sample_format: SampleFormat = SampleFormat.PCM_24, limit_bytes: int = 2**32 - 2) -> WavWriter:
    with WavWriter(
        path,
        rate_hz=RATE_HZ,
        channels=2,
        sample_format=sample_format,
        metadata=METADATA,
        riff_limit_bytes=limit_bytes,
    ) as writer:
        for piece in np.array_split(sound(), 7):
            writer.write(piece)
    return writer


@pytest.fixture(scope="module", params=["RIFF", "RF64"])
def wav(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, WavWriter]:
    path = tmp_path_factory.mktemp("sound") / "a.wav"
    return path, write(path, limit_bytes=2**32 - 2 if request.param == "RIFF" else 100_000)


Program = Callable[..., str]


def program(name: str) -> Program:
    """What a program says, or skip."""
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")

    def run(*arguments: object) -> str:
        call = [name, *(str(argument) for argument in arguments)]
        return subprocess.run(call, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL).stdout

    return run


def test_wavinfo_reads_every_field(wav: tuple[Path, WavWriter]) -> None:
    path, writer = wav
    found, loudness = wavinfo.WavInfoReader(str(path)), writer.loudness()
    assert (found.fmt.sample_rate, found.fmt.channel_count, found.fmt.bits_per_sample) == (RATE_HZ, 2, 24)
    assert found.data.frame_count == len(sound())
    bext = found.bext
    assert (bext.description, bext.originator, bext.originator_ref) == (
        METADATA.description,
        METADATA.originator,
        METADATA.originator_reference,
    )
    assert (bext.originator_date, bext.originator_time) == ("2031-02-13", "14:15:16")
    assert (bext.time_reference, bext.version, bytes(bext.umid)) == (96_007, 2, UMID)
    assert [line.rstrip() for line in bext.coding_history.splitlines()] == LINES
    assert bext.loudness_value == pytest.approx(loudness.integrated_lufs, abs=0.0051)
    assert bext.loudness_range == pytest.approx(loudness.range_lu, abs=0.0051)
    assert bext.max_true_peak == pytest.approx(loudness.max_true_peak_dbtp, abs=0.0051)
    assert bext.max_momentary_loudness == pytest.approx(loudness.max_momentary_lufs, abs=0.0051)
    assert bext.max_shortterm_loudness == pytest.approx(loudness.max_short_term_lufs, abs=0.0051)
    assert (found.info.title, found.info.artist, found.info.software) == ("A song", "A singer", "Gramoscope")
    assert found.info.comment == "full scale = 0.5 m/s groove velocity; both walls"


def test_libsndfile_reads_samples_and_texts(wav: tuple[Path, WavWriter]) -> None:
    path, _ = wav
    with soundfile.SoundFile(path) as file:
        assert (file.samplerate, file.channels, file.subtype, file.frames) == (RATE_HZ, 2, "PCM_24", len(sound()))
        assert (file.title, file.artist, file.date) == ("A song", "A singer", "")
        assert np.abs(file.read() - sound() / 0.5).max() <= 0.5 / 2**23


def test_mediainfo_reads_the_broadcast_fields(wav: tuple[Path, WavWriter]) -> None:
    path, writer = wav
    tracks = json.loads(program("mediainfo")("--Output=JSON", path))["media"]["track"]
    general, audio = ({**track, **track.get("extra", {})} for track in tracks)
    assert general["Format"] == "Wave"
    assert general["Description"] == METADATA.description
    assert general["Producer"] == METADATA.originator
    assert general["Producer_Reference"] == METADATA.originator_reference
    assert general["Encoded_Date"].startswith("2031-02-13 14:15:16")
    assert general["Encoded_Library_Settings"].split(" / ")[0] == LINES[0]
    assert UMID[:32].hex().upper().lstrip("0") in general["UMID"]
    assert (audio["SamplingRate"], audio["BitDepth"], audio["Channels"]) == (str(RATE_HZ), "24", "2")
    assert int(audio["SamplingCount"]) == len(sound())
    assert float(audio["LoudnessValue"]) == pytest.approx(writer.loudness().integrated_lufs, abs=0.0051)


def test_ffprobe_reads_the_broadcast_fields(wav: tuple[Path, WavWriter]) -> None:
    path, _ = wav
    found = json.loads(program("ffprobe")("-v", "warning", "-of", "json", "-show_format", "-show_streams", path))
    stream, tags = found["streams"][0], found["format"]["tags"]
    assert (stream["codec_name"], stream["sample_rate"], stream["channels"]) == ("pcm_s24le", str(RATE_HZ), 2)
    assert stream["duration_ts"] == len(sound())
    # the INFO comment and the description share a name with FFmpeg: one of them is told
    assert tags["encoded_by"] == METADATA.originator
    assert tags["originator_reference"] == METADATA.originator_reference
    assert (tags["date"], tags["creation_time"], tags["time_reference"]) == ("2031-02-13", "14:15:16", "96007")
    assert tags["umid"].lower().removeprefix("0x").startswith(UMID[:32].hex())
    assert [line.rstrip() for line in tags["coding_history"].split("\r\n") if line] == LINES


@pytest.mark.parametrize("sample_format", list(SampleFormat), ids=lambda f: f.name)
def test_ffmpeg_decodes_every_format_without_a_warning(tmp_path: Path, sample_format: SampleFormat) -> None:
    run = program("ffmpeg")
    write(tmp_path / "a.wav", sample_format)
    said = run("-v", "warning", "-xerror", "-i", tmp_path / "a.wav", "-f", "f64le", "-y", tmp_path / "a.raw")
    assert said == ""
    heard = np.fromfile(tmp_path / "a.raw").reshape(-1, 2)
    assert np.abs(heard - sound() / 0.5).max() <= 2.0 ** -min(sample_format.bits, 24)


def test_sox_reads_the_samples(wav: tuple[Path, WavWriter]) -> None:
    path, _ = wav
    run = program("sox")
    assert run("--i", "-s", path).strip() == str(len(sound()))
    assert (run("--i", "-r", path).strip(), run("--i", "-b", path).strip()) == (str(RATE_HZ), "24")


@pytest.mark.parametrize("rate_hz", [48_000, 96_000])
def test_loudness_agrees_with_ffmpeg(tmp_path: Path, rate_hz: int) -> None:
    """FFmpeg brings everything to 48 kHz first and measures true peak there."""
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    samples = _speechlike(rate_hz)
    soundfile.write(tmp_path / "a.wav", samples, rate_hz, subtype="FLOAT")
    call = [
        "ffmpeg",
        "-hide_banner",
        "-nostats",
        "-i",
        str(tmp_path / "a.wav"),
        "-af",
        "ebur128=peak=true",
        "-f",
        "null",
        "-",
    ]
    said = subprocess.run(call, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL).stderr
    summary = said[said.rindex("Summary:") :]
    integrated, loudness_range, peak = (
        float(re.search(rf"{name}:\s+(\S+) ", summary)[1])  # type: ignore[index]
        for name in ("I", "LRA", "Peak")
    )
    found = _measured(samples, rate_hz)
    assert found.integrated_lufs == pytest.approx(integrated, abs=0.1)
    assert found.range_lu == pytest.approx(loudness_range, abs=0.2)
    assert found.max_true_peak_dbtp == pytest.approx(peak, abs=0.2)


@pytest.mark.parametrize("rate_hz", [44_100, 48_000, 96_000])
def test_loudness_agrees_with_pyloudnorm(rate_hz: int) -> None:
    samples = _speechlike(rate_hz)
    theirs = pyloudnorm.Meter(rate_hz).integrated_loudness(samples)
    assert _measured(samples, rate_hz).integrated_lufs == pytest.approx(theirs, abs=0.1)


def _speechlike(rate_hz: int) -> np.ndarray:
    """Thirty seconds of pink-ish noise that comes and goes between −50 and −15 dB."""
    rng, count = np.random.default_rng(8), 30 * rate_hz
    spectrum = np.fft.rfft(rng.normal(size=(count, 2)), axis=0)
    frequency = np.fft.rfftfreq(count, 1 / rate_hz)
    spectrum *= ((frequency > 50) & (frequency < 12_000))[:, None] / np.sqrt(np.maximum(frequency, 50))[:, None]
    noise = np.fft.irfft(spectrum, axis=0)
    level_db = np.interp(np.arange(count) / rate_hz, np.arange(31), rng.uniform(-50, -15, 31))
    return np.asarray(noise / noise.std() * 10 ** (level_db / 20)[:, None])


def _measured(samples: np.ndarray, rate_hz: int):  # type: ignore[no-untyped-def]
    meter = LoudnessMeter(rate_hz, samples.shape[1])
    meter.hear(samples)
    return meter.measured()


def test_flac_holds_the_same_samples_and_words(wav: tuple[Path, WavWriter], tmp_path: Path) -> None:
    path, _ = wav
    (tmp_path / "a.flac").touch()
    write_flac(path, tmp_path / "a.flac", METADATA)
    with soundfile.SoundFile(tmp_path / "a.flac") as file:
        assert (file.format, file.subtype, file.samplerate, file.channels) == ("FLAC", "PCM_24", RATE_HZ, 2)
        assert (file.title, file.artist, file.date) == ("A song", "A singer", "2031-02-13")
        assert METADATA.description in file.comment
        assert METADATA.originator_reference in file.comment
        flac = file.read(dtype="int32")
    np.testing.assert_array_equal(flac, soundfile.read(path, dtype="int32")[0])


def test_ffmpeg_decodes_the_flac_to_the_same_samples(tmp_path: Path) -> None:
    run = program("ffmpeg")
    write(tmp_path / "a.wav")
    (tmp_path / "a.flac").touch()
    write_flac(tmp_path / "a.wav", tmp_path / "a.flac", METADATA)
    sums = [
        run("-v", "error", "-i", tmp_path / name, "-c:a", "pcm_s24le", "-f", "md5", "-") for name in ("a.wav", "a.flac")
    ]
    assert sums[0] == sums[1] != ""
