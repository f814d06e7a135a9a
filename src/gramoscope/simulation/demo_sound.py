"""A short piece of music out of nothing, for the demonstration: a singer over a few bells.

The voice is a sum of harmonics under the formants of two vowels, with vibrato; a bell is a handful of inharmonic partials
that die away, the high ones first. All of it lies between 150 Hz and 6 kHz, where the paper's method can hear it.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.errors import require

RATE_HZ = 48_000.0
LOWEST_HZ, HIGHEST_HZ = 150.0, 6000.0

MELODY_HZ = (523.25, 659.26, 587.33, 783.99, 698.46, 659.26, 587.33, 523.25)
NOTE_S = 0.125
VIBRATO_HZ, VIBRATO_DEPTH = 6.0, 0.012

FORMANTS_HZ = {"a": (800.0, 1150.0, 2900.0), "i": (300.0, 2300.0, 3100.0)}
"""The first three formants of a soprano's vowels, rounded, after the tables in the Csound manual, appendix D."""
FORMANT_GAINS = (1.0, 0.6, 0.25)
FORMANT_WIDTH_HZ = 160.0

BELL_PARTIALS = (0.5, 1.0, 1.2, 1.5, 2.0, 2.5, 2.67, 3.0, 4.0)
"""Hum, prime, tierce, quint, nominal and above, of a well-tuned bell."""


def demo_sound(*, seconds: float = 0.5) -> tuple[FloatArray, float]:
    """Return the demonstration's sound, always the same.

    Parameters
    ----------
    seconds : float
        Length, positive; the melody comes round again after a second.

    Returns
    -------
    samples : float64 array, shape (sample,)
        Largest value 1.
    rate_hz : float
    """
    require(seconds > 0, f"a sound of {seconds} s", "a positive length")
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    samples = np.zeros(len(time_s))
    for note in range(int(np.ceil(seconds / NOTE_S))):
        since_s = time_s - note * NOTE_S
        pitch_hz = MELODY_HZ[note % len(MELODY_HZ)]
        samples += _sung(since_s, pitch_hz, vowel="ai"[note % 2])
        if note % 2 == 0:
            samples += 0.5 * _bell(since_s, pitch_hz)
    return samples / np.abs(samples).max(), RATE_HZ


def _sung(since_s: FloatArray, pitch_hz: float, *, vowel: str) -> FloatArray:
    singing = (since_s >= 0) & (since_s < NOTE_S)
    swell = np.where(singing, np.sin(np.pi * np.clip(since_s / NOTE_S, 0, 1)) ** 0.6, 0.0)
    swing = VIBRATO_DEPTH / VIBRATO_HZ * np.sin(2 * np.pi * VIBRATO_HZ * since_s)
    phase = 2 * np.pi * pitch_hz * (since_s + swing / (2 * np.pi))
    harmonics = np.arange(1, int(HIGHEST_HZ / (pitch_hz * (1 + VIBRATO_DEPTH))) + 1)
    gains = _formant_gain(harmonics.astype(np.float64) * pitch_hz, FORMANTS_HZ[vowel])
    return np.asarray(swell * sum(gain * np.sin(n * phase) for n, gain in zip(harmonics, gains, strict=True)))


def _formant_gain(frequency_hz: FloatArray, formants_hz: tuple[float, ...]) -> FloatArray:
    gain = 0.05 * np.ones_like(frequency_hz, dtype=np.float64)
    for formant_hz, strength in zip(formants_hz, FORMANT_GAINS, strict=True):
        gain += strength / (1 + ((frequency_hz - formant_hz) / FORMANT_WIDTH_HZ) ** 2)
    return gain


def _bell(since_s: FloatArray, pitch_hz: float) -> FloatArray:
    rung = np.maximum(since_s, 0)
    struck = np.where(since_s >= 0, 1 - np.exp(-rung / 1e-3), 0.0)
    partials = [ratio for ratio in BELL_PARTIALS if LOWEST_HZ < ratio * pitch_hz < HIGHEST_HZ]
    return np.asarray(
        struck * sum(np.sin(2 * np.pi * r * pitch_hz * rung) * np.exp(-rung * r / 0.15) / (1 + r) for r in partials)
    )
