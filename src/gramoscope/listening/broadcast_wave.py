"""Broadcast Wave files that grow piece by piece: RIFF, beyond 4 GB RF64, with `bext` version 2 and its loudness.

A WAV file holds numbers between −1 and 1; the sound of a groove is a velocity in metres a second. `full_scale_m_s` joins
the two and is written into the file's comment. The default, 0.5 m/s, is a guess that leaves room above loud
grooves (some tens of centimetres a second), so that clipping means that something is wrong. What lies beyond full scale
is clipped and counted; what is not a number becomes silence and is counted too.

Samples are written first and the header over itself after each piece, so that a file whose writer was killed at any moment is
a valid one that ends with an earlier piece. It has a temporary name then; its own it gets when it is whole, and on the disk.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import OutputError, require
from gramoscope.listening.broadcast_metadata import BroadcastMetadata
from gramoscope.listening.loudness import Loudness, LoudnessMeter
from gramoscope.listening.sample_format import SampleFormat, packed, rounded
from gramoscope.listening.wave_header import RIFF_LIMIT_BYTES, WaveHeader
from gramoscope.listening.whole_file import create_temporary, output_error, put_in_place

FULL_SCALE_M_S = 0.5


def full_scale_comment(full_scale_m_s: float) -> str:
    """Return the words by which a file says its scale; `listening.wav.full_scale_of` reads them."""
    return f"full scale = {full_scale_m_s:g} m/s groove velocity"


class WavWriter:
    """A WAV file that grows piece by piece and appears under its name only when it is whole.

    As a context manager it commits at the end of the block, and discards when the block fails. Whoever writes several
    files that belong together calls `finish` on each, and only when all have succeeded `commit` on each; `discard` is
    always safe.

    Parameters
    ----------
    path : path
        Where the file will be; the folder must exist.
    rate_hz : float
        Samples a second, a whole number.
    channels : int
    sample_format : SampleFormat
    full_scale_m_s : float
        The velocity that becomes ±1.
    metadata : BroadcastMetadata
        What the file says of itself; the scale is put before its comment (``ICMT``).
    dither : Generator, optional
        Adds dither, see `listening.sample_format`; without it samples are rounded. 24 bits need none: decision 10.
    riff_limit_bytes : int
        See `WaveHeader`.

    Attributes
    ----------
    samples_written : int
        Of each channel.
    clipped_samples, silenced_samples : int
        Of all channels.

    Raises
    ------
    ArgumentError
        If a number is impossible.
    OutputError
        If the file cannot be created or, later, written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        rate_hz: float,
        channels: int = 1,
        sample_format: SampleFormat = SampleFormat.PCM_24,
        full_scale_m_s: float = FULL_SCALE_M_S,
        metadata: BroadcastMetadata | None = None,
        dither: np.random.Generator | None = None,
        riff_limit_bytes: int = RIFF_LIMIT_BYTES,
    ) -> None:
        require(
            rate_hz > 0 and rate_hz == round(rate_hz), f"a rate of {rate_hz} Hz", "a whole number of samples a second"
        )
        require(full_scale_m_s > 0, f"a full scale of {full_scale_m_s} m/s", "a positive velocity")
        self.path = Path(path)
        self.full_scale_m_s = full_scale_m_s
        self.samples_written = 0
        self.clipped_samples = 0
        self.silenced_samples = 0
        self._dither = dither
        said = _with_scale(metadata or BroadcastMetadata(), full_scale_m_s)
        self._header = WaveHeader(round(rate_hz), channels, sample_format, said, riff_limit_bytes)
        self._meter = LoudnessMeter(rate_hz, channels)
        self._state: Literal["open", "finished", "committed", "discarded"] = "open"
        self._temporary = create_temporary(self.path)
        self._open()

    @property
    def rate_hz(self) -> int:
        """Samples a second."""
        return self._header.rate_hz

    @property
    def channels(self) -> int:
        """How many channels there are."""
        return self._header.channels

    @property
    def sample_format(self) -> SampleFormat:
        """How samples are stored."""
        return self._header.sample_format

    @property
    def metadata(self) -> BroadcastMetadata:
        """What the file says of itself."""
        return self._header.metadata

    @property
    def temporary(self) -> Path:
        """Where the file lies until it is committed."""
        return self._temporary

    def loudness(self) -> Loudness:
        """Return the loudness of what was written so far, against full scale."""
        return self._meter.measured()

    def write(self, samples: npt.ArrayLike) -> None:
        """Append a piece.

        Parameters
        ----------
        samples : array_like, shape (sample,) or (sample, channel)
            Velocity in metres a second; NaN and infinities are written as silence and counted in `silenced_samples`.

        Raises
        ------
        ArgumentError
            If the number of channels is not the file's, or if the file was finished.
        OutputError
            If the disk is full.
        """
        require(self._state == "open", f"{self.path} is {self._state}", "an open file")
        stored, heard = self._stored(self._scaled(np.asarray(samples, np.float64)))
        self._meter.hear(heard)
        try:
            self._append(stored)
            self.samples_written += len(heard)
            # a padding byte is written only at the very end: until then the file owns to an even number of bytes
            odd = self.samples_written * self._header.frame_bytes % 2
            self._write_header(self.samples_written - odd)
        except OSError as error:
            raise self._failure(error) from error

    def finish(self) -> None:
        """Complete the file under its temporary name; nothing more can be written. Does nothing the second time.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        if self._state != "open":
            return
        self._state = "finished"
        try:
            self._append(bytes(self.samples_written * self._header.frame_bytes % 2))
            self._write_header(self.samples_written, self.loudness())
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._failure(error) from error

    def commit(self) -> None:
        """Complete the file and put it in its place. Does nothing the second time.

        Raises
        ------
        ArgumentError
            If the file was discarded.
        OutputError
            If the system refuses.
        """
        if self._state == "committed":
            return
        require(self._state != "discarded", f"{self.path} was discarded", "a file that was not")
        self.finish()
        put_in_place(self._temporary, self.path)
        self._state = "committed"

    def discard(self) -> None:
        """Remove every trace of a file that was not committed; what was there before remains."""
        if self._state in ("committed", "discarded"):
            return
        self._state = "discarded"
        self._file.close()
        self._temporary.unlink(missing_ok=True)

    def _open(self) -> None:
        # without a buffer: what was written is with the system, and lives on when we are killed
        self._file = self._temporary.open("r+b", buffering=0)
        try:
            self._file.truncate()
            self._write_header(0)
        except OSError as error:
            raise self._failure(error) from error

    def _append(self, content: bytes) -> None:
        self._file.seek(0, os.SEEK_END)
        self._write_all(content)

    def _write_header(self, frames: int, loudness: Loudness | None = None) -> None:
        self._file.seek(0)
        self._write_all(self._header.written(frames, loudness))

    def _write_all(self, content: bytes) -> None:
        left = memoryview(content)
        while left:
            left = left[self._file.write(left) :]

    def _scaled(self, samples: FloatArray) -> FloatArray:
        piece = samples[:, np.newaxis] if samples.ndim == 1 else samples
        require(
            piece.ndim == 2 and piece.shape[1] == self.channels,
            f"samples of shape {samples.shape}",
            f"{self.channels} channel(s)",
        )
        scaled = piece / self.full_scale_m_s
        finite = np.isfinite(scaled)
        self.silenced_samples += int(np.count_nonzero(~finite))
        return np.where(finite, scaled, 0.0)

    def _stored(self, scaled: FloatArray) -> tuple[bytes, FloatArray]:
        """The bytes of scaled samples, and what they sound like."""
        if self.sample_format.is_float:
            floats = scaled.astype("<f4")
            return floats.tobytes(), floats.astype(np.float64)
        self.clipped_samples += int(np.count_nonzero(np.abs(scaled) > 1))
        bits = self.sample_format.bits
        steps = rounded(scaled, bits=bits, dither=self._dither)
        return packed(steps, bits=bits), steps / 2.0 ** (bits - 1)

    def _failure(self, error: OSError) -> OutputError:
        self.discard()
        return output_error(self.path, (error.strerror or str(error)).strip(". "), number=error.errno)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is not None:
            self.discard()
            return
        try:
            self.commit()
        finally:
            self.discard()


def _with_scale(metadata: BroadcastMetadata, full_scale_m_s: float) -> BroadcastMetadata:
    comment = metadata.info.get("ICMT")
    scale = full_scale_comment(full_scale_m_s)
    return replace(metadata, info={**metadata.info, "ICMT": f"{scale}; {comment}" if comment else scale})
