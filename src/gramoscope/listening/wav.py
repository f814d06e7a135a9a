"""Sound files: whatever libsndfile reads comes in, WAV goes out, piece by piece.

A WAV file holds numbers between −1 and 1; the sound of a groove is a velocity in metres a second. `full_scale_m_s` joins
the two and is written into the file's comment. The default, 0.5 m/s, is a guess that leaves room above loud
grooves (some tens of centimetres a second), so that clipping means that something is wrong.

24-bit samples are rounded to the nearest of 2²³ steps a side, 0.06 µm/s at the default scale. What lies beyond full scale
is clipped and counted; what is not a number becomes silence and is counted too.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
import soundfile

from gramoscope.conventions import FloatArray
from gramoscope.errors import OutputError, SoundError, require
from gramoscope.listening.whole_file import create_temporary, output_error, put_in_place

Subtype = Literal["PCM_24", "FLOAT"]

FULL_SCALE_M_S = 0.5
_STEPS = 2**23
_READABLE = "a sound file that libsndfile reads: WAV, FLAC, Ogg, MP3, AIFF"


_FULL_SCALE = re.compile(r"full scale = ([0-9.e+-]+) m/s")


def quantise(samples: FloatArray) -> npt.NDArray[np.int32]:
    """Round samples to 24 bits, clipped to −1 … 1 − 2⁻²³, in the upper bits of 32-bit integers (NaN is not allowed)."""
    steps = np.clip(np.rint(samples * _STEPS), -_STEPS, _STEPS - 1)
    return steps.astype(np.int32) << 8


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
    subtype : {"PCM_24", "FLOAT"}
        24-bit integers, or 32-bit floats, which clip nothing.
    full_scale_m_s : float
        The velocity that becomes ±1.

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
        subtype: Subtype = "PCM_24",
        full_scale_m_s: float = FULL_SCALE_M_S,
    ) -> None:
        require(
            rate_hz > 0 and rate_hz == round(rate_hz), f"a rate of {rate_hz} Hz", "a whole number of samples a second"
        )
        require(channels >= 1, f"{channels} channels", "at least one")
        require(subtype in ("PCM_24", "FLOAT"), f"the subtype {subtype!r}", '"PCM_24" or "FLOAT"')
        require(full_scale_m_s > 0, f"a full scale of {full_scale_m_s} m/s", "a positive velocity")
        self.path = Path(path)
        self.rate_hz = rate_hz
        self.channels = channels
        self.subtype = subtype
        self.full_scale_m_s = full_scale_m_s
        self.samples_written = 0
        self.clipped_samples = 0
        self.silenced_samples = 0
        self._temporary = create_temporary(self.path)
        self._state: Literal["open", "finished", "committed", "discarded"] = "open"
        self._file = self._open()

    def _open(self) -> soundfile.SoundFile:
        try:
            file = soundfile.SoundFile(
                self._temporary,
                "w",
                samplerate=round(self.rate_hz),
                channels=self.channels,
                subtype=self.subtype,
                format="WAV",
            )
            file.comment = f"full scale = {self.full_scale_m_s:g} m/s groove velocity"
        except soundfile.LibsndfileError as error:
            self._temporary.unlink(missing_ok=True)
            raise output_error(self.path, error.error_string) from error
        return file

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
        piece = self._scaled(np.asarray(samples, np.float64))
        stored = quantise(piece) if self.subtype == "PCM_24" else piece.astype(np.float32)
        try:
            self._file.write(stored)
        except (soundfile.LibsndfileError, AssertionError) as error:
            # soundfile asserts that as many samples were written as were given
            raise self._failure(error) from error
        self.samples_written += len(piece)

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
        scaled = np.where(finite, scaled, 0.0)
        if self.subtype == "PCM_24":
            self.clipped_samples += int(np.count_nonzero(np.abs(scaled) > 1))
        return scaled

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
            self._file.close()
            if self.subtype == "FLOAT":
                _forget_the_hour(self._temporary)
        except (soundfile.LibsndfileError, OSError) as error:
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
        try:
            self._file.close()
        except soundfile.LibsndfileError:
            pass  # its last block may not fit the disk either, and it goes away in the next line
        finally:
            self._temporary.unlink(missing_ok=True)

    def _failure(self, error: BaseException) -> OutputError:
        self.discard()
        reason = getattr(error, "error_string", "") or getattr(error, "strerror", "") or "a short write"
        return output_error(self.path, str(reason).strip(". "))

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


def _forget_the_hour(path: Path) -> None:
    """Zero the time of writing that libsndfile puts into the PEAK chunk, so that equal sound is equal bytes."""
    with path.open("r+b") as file:
        place = file.read(4096).find(b"PEAK")
        if place >= 0:
            file.seek(place + 12)
            file.write(bytes(4))


def read_sound(
    path: str | os.PathLike[str], *, start_s: float | None = None, seconds: float | None = None
) -> tuple[FloatArray, int]:
    """Read a sound file, or a part of one.

    Parameters
    ----------
    path : path
        Anything libsndfile reads.
    start_s : float, optional
        Where to begin, from 0.
    seconds : float, optional
        How much to read; more than there is means to the end.

    Returns
    -------
    samples : float64 array, shape (sample, channel)
        Full scale is ±1.
    rate_hz : int

    Raises
    ------
    ArgumentError
        If `start_s` is negative or `seconds` is not positive.
    SoundError
        If the file is missing, is no sound, is empty or damaged, holds NaN or infinities, or ends before `start_s`.
    """
    require(start_s is None or start_s >= 0, f"a start at {start_s} s", "zero or more seconds")
    require(seconds is None or seconds > 0, f"{seconds} seconds of sound", "more than zero seconds")
    place = Path(path)
    if not place.is_file():
        raise SoundError(f"there is no file {place}", _READABLE, "check the name")
    samples, rate_hz = _read_span(place, start_s=start_s or 0.0, seconds=seconds)
    if len(samples) == 0:
        raise SoundError(f"{place} holds no sound", "at least one sample", "check how it was made")
    if not np.isfinite(samples).all():
        raise SoundError(
            f"{place} holds samples that are no numbers", "finite samples", "export it again as 24-bit WAV"
        )
    return samples, rate_hz


def full_scale_of(path: str | os.PathLike[str]) -> float | None:
    """Return the velocity (m/s) that is full scale in a file written by `WavWriter`, None for other sound files."""
    try:
        with soundfile.SoundFile(path) as file:
            found = _FULL_SCALE.match(file.comment or "")
    except (soundfile.LibsndfileError, TypeError):
        return None
    return float(found.group(1)) if found else None


def _read_span(path: Path, *, start_s: float, seconds: float | None) -> tuple[FloatArray, int]:
    try:
        with soundfile.SoundFile(path) as file:
            rate_hz = int(file.samplerate)
            first = round(start_s * rate_hz)
            if first > 0:
                _require_start(path, first, frames=file.frames, rate_hz=rate_hz)
                file.seek(first)
            count = -1 if seconds is None else max(1, round(seconds * rate_hz))
            samples: FloatArray = file.read(count, dtype="float64", always_2d=True)
    except (soundfile.LibsndfileError, TypeError) as error:
        # a TypeError is soundfile's answer to the name of a headerless format
        reason = getattr(error, "error_string", "it has no header")
        raise SoundError(f"{path} cannot be read as sound: {reason}", _READABLE, "convert it to WAV") from error
    return samples, rate_hz


def _require_start(path: Path, first: int, *, frames: int, rate_hz: int) -> None:
    if first >= frames:
        raise SoundError(
            f"{path} lasts {frames / rate_hz:.3f} s and was to be read from {first / rate_hz:.3f} s on",
            "a start before the end",
            "choose an earlier start",
        )
