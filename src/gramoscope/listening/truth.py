"""What a film was made of: the true velocity of the groove that lies beside a simulated capture, as sound.

`truth.npz` holds the velocity at each *place*; a comparison needs it at each *time*, t = ∫ ds / V from s = 0, which the
groove speed V gives.
"""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import Literal

import numpy as np
import soxr

from gramoscope.conventions import MICROMETRES_PER_METRE, FloatArray, stereo_of_motion
from gramoscope.disc.formats import Cut
from gramoscope.errors import SoundError, require
from gramoscope.listening.wav import full_scale_of, read_sound

TRUTH_RATE_HZ = 96_000.0
_KEYS = ("arc_um", "lateral_um_s", "vertical_um_s", "speed_um_s")


def load_for_comparison(
    path: str | os.PathLike[str], *, rate_hz: float = TRUTH_RATE_HZ, cut: Cut | Literal["stronger"] = "stronger"
) -> tuple[FloatArray, float]:
    """Read a sound file, or the truth of a simulated capture.

    Parameters
    ----------
    path : path
        A sound file, or an `.npz` file as in `truth_sound`.
    rate_hz : float
        Rate to turn a truth into; sound files keep their own.
    cut : {"stronger", "lateral", "vertical", "stereo"}
        Which velocity of a truth; "stronger" takes the lateral or the vertical one, whichever has more power.

    Returns
    -------
    samples : float64 array, shape (sample, channel)
        Metres a second for a truth, and for a file that says what its full scale is, as ours do; parts of full scale for
        others.
    rate_hz : float

    Raises
    ------
    SoundError
        If the file cannot be read, or is of no use.
    """
    if Path(path).suffix.lower() == ".npz":
        samples = truth_sound(path, rate_hz=rate_hz, cut=cut)
        return samples if samples.ndim == 2 else samples[:, np.newaxis], float(rate_hz)
    sound, file_rate_hz = read_sound(path)
    return sound * (full_scale_of(path) or 1.0), float(file_rate_hz)


def truth_sound(
    npz_path: str | os.PathLike[str], *, rate_hz: float, cut: Cut | Literal["stronger"] = "lateral"
) -> FloatArray:
    """Return the true velocity of the groove as a sound whose sample 0 is s = 0.

    Parameters
    ----------
    npz_path : path
        With `arc_um` (rising), `lateral_um_s`, `vertical_um_s` and `speed_um_s` (a number, or one for each place).
    rate_hz : float
        Samples a second.
    cut : {"lateral", "vertical", "stereo", "stronger"}
        Which velocity; see `load_for_comparison`.

    Returns
    -------
    float64 array, shape (sample,), or (sample, 2) for stereo with the left channel first
        Metres a second, towards +l or +z.

    Raises
    ------
    ArgumentError
        If `rate_hz` or `cut` is impossible.
    SoundError
        If the file is missing, lacks a key or holds no usable numbers.
    """
    require(rate_hz > 0, f"a rate of {rate_hz} Hz", "a positive rate")
    require(cut in ("lateral", "vertical", "stereo", "stronger"), f"the cut {cut!r}", "lateral, vertical or stereo")
    truth = _read_truth(Path(npz_path))
    velocity = _velocity_m_s(truth, cut=cut)
    return _in_time(velocity, _time_s(truth), rate_hz=rate_hz)


def _read_truth(path: Path) -> dict[str, FloatArray]:
    needed = f"a truth.npz with {', '.join(_KEYS)}"
    remedy = "give the truth.npz of a simulated capture, or a sound file"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            missing = [key for key in _KEYS if key not in stored]
            truth = {key: np.asarray(stored[key], np.float64) for key in _KEYS if key not in missing}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise SoundError(f"{path} cannot be read: {error}", needed, remedy) from error
    if missing:
        raise SoundError(f"{path} lacks {', '.join(missing)}", needed, remedy)
    _require_usable(truth, path=path)
    return truth


def _require_usable(truth: dict[str, FloatArray], *, path: Path) -> None:
    arc = truth["arc_um"]
    usable = (
        arc.ndim == 1
        and arc.size >= 2
        and truth["lateral_um_s"].shape == truth["vertical_um_s"].shape == arc.shape
        and truth["speed_um_s"].size in (1, arc.size)
        and all(bool(np.isfinite(values).all()) for values in truth.values())
        and bool(np.all(np.diff(arc) > 0))
        and bool(np.all(truth["speed_um_s"] > 0))
    )
    if not usable:
        raise SoundError(
            f"the numbers in {path} are no passage of groove",
            "finite velocities at rising places, and positive speeds",
            "check how it was made",
        )


def _velocity_m_s(truth: dict[str, FloatArray], *, cut: Cut | Literal["stronger"]) -> FloatArray:
    lateral = truth["lateral_um_s"] / MICROMETRES_PER_METRE
    vertical = truth["vertical_um_s"] / MICROMETRES_PER_METRE
    if cut == "stereo":
        return np.asarray(np.stack(stereo_of_motion(lateral, vertical), axis=1), np.float64)
    if cut == "stronger":
        cut = "lateral" if np.sum(lateral**2) >= np.sum(vertical**2) else "vertical"
    return lateral if cut == "lateral" else vertical


def _time_s(truth: dict[str, FloatArray]) -> FloatArray:
    """Time of each place; groove speed between two places is their mean, and before the first it is the first."""
    arc, speed = truth["arc_um"], np.broadcast_to(truth["speed_um_s"], truth["arc_um"].shape)
    passed = np.diff(arc) * 2 / (speed[1:] + speed[:-1])
    return np.asarray(arc[0] / speed[0] + np.concatenate([[0.0], np.cumsum(passed)]), np.float64)


def _in_time(velocity: FloatArray, time_s: FloatArray, *, rate_hz: float) -> FloatArray:
    """Put values at uneven times on an even grid from t = 0, as dense as they come, and resample that."""
    dense_hz = (len(time_s) - 1) / float(time_s[-1] - time_s[0])
    grid_s = np.arange(0, round(float(time_s[-1]) * dense_hz) + 1) / dense_hz
    channels = velocity.reshape(len(velocity), -1).T
    dense = np.stack([np.interp(grid_s, time_s, channel) for channel in channels], axis=1)
    # beyond the ends the resampler hears silence and would ring: a straight line from end to end goes round it
    slope = (dense[-1] - dense[0]) / max(len(dense) - 1, 1)
    bent = dense - (dense[0] + slope * np.arange(len(dense))[:, None])
    resampled = np.asarray(soxr.resample(bent, dense_hz, rate_hz, quality="VHQ"), np.float64)
    resampled += dense[0] + slope * (np.arange(len(resampled)) * dense_hz / rate_hz)[:, None]
    return resampled if velocity.ndim == 2 else resampled.reshape(-1)
