"""What the columns of the table mean: plain functions of a truth and of what was heard."""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.listening.align import Band, band_passed, least_squares_gain

LARGEST_GAIN_ERROR = 0.01
"""A gain further from 1 than this is an error of the reading, and stays in."""

SILENT_SHARE = 1e-6
"""A channel with less than this of the other's power is at rest."""


def real_error(truth: FloatArray, heard: FloatArray, *, used: BoolArray) -> FloatArray:
    """Return heard − truth where it counts, in full band, at the same sample times.

    The gain that fits best is taken out if it is within `LARGEST_GAIN_ERROR` of 1.

    Parameters
    ----------
    truth, heard : float64 arrays, shapes (sample,)
        One unit and rate, sample 0 at the same time; the longer one is cut.
    used : bool array, shape (sample of heard,)

    Returns
    -------
    float64 array
        For the samples used.
    """
    count = min(len(truth), len(heard))
    kept = used[:count]
    a, b = truth[:count][kept], heard[:count][kept]
    gain = least_squares_gain(a, b) if np.any(a) else 1.0
    return b / gain - a if abs(gain - 1) < LARGEST_GAIN_ERROR else b - a


def sigma_ratio(truth: FloatArray, heard: FloatArray, sigma: FloatArray, *, used: BoolArray) -> float:
    """Return rms(claimed sigma) ÷ rms(real error) where it counts; NaN if nothing does or no sigma is claimed."""
    count = min(len(truth), len(heard))
    kept = used & np.isfinite(sigma)
    kept[count:] = False
    error = real_error(truth, heard, used=kept)
    if error.size == 0 or not np.any(error):
        return float("nan")
    return float(np.sqrt(np.mean(sigma[kept] ** 2) / np.mean(error**2)))


def band_rms(samples: FloatArray, *, rate_hz: float, band_hz: Band) -> float:
    """Return the rms of a sound in a band."""
    return float(np.sqrt(np.mean(band_passed(samples, rate_hz=rate_hz, band_hz=band_hz) ** 2)))


def driven_channels(truth: FloatArray) -> list[int]:
    """Return the channels that hold a sound, by their power in a truth of shape (sample, channel)."""
    power = np.mean(truth**2, axis=0)
    return [int(channel) for channel in np.flatnonzero(power > SILENT_SHARE * power.max())]


def separation_db(truth: FloatArray, heard: FloatArray, *, rate_hz: float, band_hz: Band, trim_s: float = 0.0) -> float:
    """Return how far the sound of one channel lies below itself in the other, the worse of both ways round.

    With one channel driven, 10 lg of the power heard in the driven channel over that in the other: noise counts as crosstalk.
    With both driven each channel heard is fitted by both true ones, and a sound's gain in its own channel is compared with that
    in the other: noise does not count.

    Parameters
    ----------
    truth, heard : float64 arrays, shapes (sample, 2)
    rate_hz : float
        Of both.
    band_hz : (float, float)
    trim_s : float
        Left out at each end.
    """
    count = min(len(truth), len(heard))
    trim = slice(round(trim_s * rate_hz), count - round(trim_s * rate_hz))
    a, b = (_in_band(sound[:count], rate_hz, band_hz)[trim] for sound in (truth, heard))
    driven = driven_channels(truth)
    if len(driven) == 1:
        powers = np.mean(b**2, axis=0)
        return float(10 * np.log10(powers[driven[0]] / powers[1 - driven[0]]))
    gains = np.linalg.lstsq(a, b, rcond=None)[0]
    leaks = np.abs([gains[0, 1] / gains[0, 0], gains[1, 0] / gains[1, 1]])
    return float(-20 * np.log10(max(leaks.max(), 1e-15)))


def _in_band(sound: FloatArray, rate_hz: float, band_hz: Band) -> FloatArray:
    return np.stack([band_passed(channel, rate_hz=rate_hz, band_hz=band_hz) for channel in sound.T], axis=1)
