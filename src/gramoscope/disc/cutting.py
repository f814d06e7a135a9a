"""How sound is cut into a record: velocity in, a winding groove out.

A cutting head turns the signal into *velocity* of the stylus. Over the place s the groove therefore has the slope
da/ds = v(t(s)) · dt/ds, and its displacement is the integral of the velocity over time, a(s) = ∫ v dt. Between the samples
of the sound the velocity is a cubic spline through its fourfold band-limited oversampling, and the displacement is that
spline's exact antiderivative: slope and displacement agree to rounding, and can be asked for at any place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import soxr
from scipy.interpolate import CubicSpline, PPoly
from scipy.signal import butter, sosfiltfilt

from gramoscope.conventions import FloatArray, motion_of_stereo
from gramoscope.disc.formats import Cut
from gramoscope.errors import require

OVERSAMPLING = 4
LOWEST_HZ = 20.0
"""No cutting head follows slower movements; without this limit the groove would wander off with any offset of the sound."""
FADE_S = 2e-3
SETTLING_S = 0.1
"""How long the head swings before and after the sound: the limit at `LOWEST_HZ` works without delay, both ways in time."""


@dataclass(frozen=True, eq=False)
class Cutting:
    """The stylus's path in time: velocity and displacement, lateral and vertical, at rest before and after.

    Attributes
    ----------
    start_s, stop_s : float
        When the stylus begins and ceases to move; the sound itself begins at time 0.
    velocity_m_s, displacement_m : pair of piecewise polynomials of time
        Lateral first. `cut_sound` makes them.
    """

    start_s: float
    stop_s: float
    velocity_m_s: tuple[PPoly, PPoly]
    displacement_m: tuple[PPoly, PPoly]

    def velocity_at(self, time_s: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return lateral and vertical velocity, m/s; zero while the stylus is at rest."""
        time = np.asarray(time_s, np.float64)
        moving = (time >= self.start_s) & (time <= self.stop_s)
        lateral, vertical = (np.where(moving, spline(time), 0.0) for spline in self.velocity_m_s)
        return lateral, vertical

    def displacement_at(self, time_s: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return lateral and vertical displacement, metres; constant while the stylus is at rest."""
        time = np.clip(np.asarray(time_s, np.float64), self.start_s, self.stop_s)
        lateral, vertical = (np.asarray(spline(time)) for spline in self.displacement_m)
        return lateral, vertical


def cut_sound(sound: FloatArray, *, rate_hz: float, level_m_s: float, cut: Cut) -> Cutting:
    """Cut a sound.

    Parameters
    ----------
    sound : float array, shape (sample,) or (sample, 2)
        The wanted velocity of the groove, in any unit (recording characteristic already applied). Two columns are the left
        and right channel; a cut that is not stereo takes their mean.
    rate_hz : float
        Samples a second.
    level_m_s : float
        Velocity of the groove, rms over the whole sound and along the direction of its movement, to which the sound is
        scaled; 0.03 is an ordinary 78.
    cut : {"lateral", "vertical", "stereo"}

    Returns
    -------
    Cutting

    Raises
    ------
    ArgumentError
        If the sound is too short or silent, or a sample is not finite.
    """
    sound = np.asarray(sound, np.float64)
    _check_sound(sound, rate_hz=rate_hz, level_m_s=level_m_s)
    lateral, vertical = _motion(sound, cut=cut)
    fine_rate_hz = rate_hz * OVERSAMPLING
    fine = soxr.resample(np.stack([lateral, vertical], axis=1), rate_hz, fine_rate_hz, quality="VHQ")
    length = len(fine)
    room = int(SETTLING_S * fine_rate_hz)
    fine = np.pad(_fade(fine, rate_hz=fine_rate_hz), ((room, room), (0, 0)))
    fine = _without_wander(fine, rate_hz=fine_rate_hz)
    strength = float(np.sqrt(np.sum(fine**2) / length))
    require(strength > 0, "the sound has nothing above 20 Hz", "a sound with some signal")
    return _path(fine * (level_m_s / strength), rate_hz=fine_rate_hz, start_s=-room / fine_rate_hz)


def _check_sound(sound: FloatArray, *, rate_hz: float, level_m_s: float) -> None:
    stereo = sound.ndim == 2 and sound.shape[1] == 2
    require(sound.ndim == 1 or stereo, f"a sound of shape {sound.shape}", "(sample,) or (sample, 2)")
    require(rate_hz > 0, f"a rate of {rate_hz} Hz", "a positive rate")
    require(level_m_s >= 0, f"a level of {level_m_s} m/s", "zero or more")
    require(len(sound) >= 16, f"a sound of {len(sound)} samples", "at least 16")
    require(bool(np.all(np.isfinite(sound))), "a sound with NaN or infinite samples", "finite samples")
    require(bool(np.any(sound)), "a silent sound", "a sound with some signal")


def _motion(sound: FloatArray, *, cut: Cut) -> tuple[FloatArray, FloatArray]:
    """Return the lateral and vertical velocity, in the sound's own unit."""
    if cut == "stereo":
        left, right = (sound, sound) if sound.ndim == 1 else (sound[:, 0], sound[:, 1])
        return motion_of_stereo(left, right)
    mono = sound if sound.ndim == 1 else sound.mean(axis=1)
    still = np.zeros_like(mono)
    return (mono, still) if cut == "lateral" else (still, mono)


def _without_wander(motion: FloatArray, *, rate_hz: float) -> FloatArray:
    high_pass = butter(2, LOWEST_HZ, "highpass", fs=rate_hz, output="sos")
    return np.asarray(sosfiltfilt(high_pass, motion, axis=0, padtype=None), np.float64)


def _fade(motion: FloatArray, *, rate_hz: float) -> FloatArray:
    """Let the sound begin and end at rest, by raised cosines of `FADE_S` or a quarter of the sound."""
    count = max(2, min(int(FADE_S * rate_hz), len(motion) // 4))
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(count) / count)
    window = np.ones(len(motion))
    window[:count] = rise
    window[-count:] = rise[::-1]
    return np.asarray(motion * window[:, None], np.float64)


def _path(velocity_m_s: FloatArray, *, rate_hz: float, start_s: float) -> Cutting:
    time_s = start_s + np.arange(len(velocity_m_s)) / rate_hz
    lateral, vertical = (CubicSpline(time_s, velocity_m_s[:, axis]) for axis in (0, 1))
    return Cutting(
        start_s=float(time_s[0]),
        stop_s=float(time_s[-1]),
        velocity_m_s=(lateral, vertical),
        displacement_m=(lateral.antiderivative(), vertical.antiderivative()),
    )
