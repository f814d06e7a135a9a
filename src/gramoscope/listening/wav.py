"""Sound files that come in: whatever libsndfile reads. What goes out is written by `listening.broadcast_wave`."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import soundfile

from gramoscope.conventions import FloatArray
from gramoscope.errors import SoundError, require

_READABLE = "a sound file that libsndfile reads: WAV, FLAC, Ogg, MP3, AIFF"
_FULL_SCALE = re.compile(r"full scale = ([0-9.e+-]+) m/s")


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
