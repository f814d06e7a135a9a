"""The outline of a sound is its peaks, window by window."""

from __future__ import annotations

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.listening.envelope import extremes, peak_envelope

SOUND = np.array([0.1, -0.7, 0.2, 0.3, np.nan, -0.4, np.nan, np.nan, np.nan, 0.5, -0.6])


def test_each_window_gives_its_largest_magnitude_and_the_last_one_what_remains() -> None:
    assert peak_envelope(SOUND, window_samples=3) == pytest.approx([0.7, 0.4, np.nan, 0.6], nan_ok=True)


def test_the_envelope_of_a_decaying_tone_is_its_decay() -> None:
    time_s = np.arange(9_600) / 48_000
    decay = np.exp(-11 * time_s)
    tone = 1.7 * decay * np.cos(2 * np.pi * 1_000 * time_s)
    assert peak_envelope(tone, window_samples=48) == pytest.approx(1.7 * decay[::48], rel=1e-9)


def test_extremes_keep_the_sign() -> None:
    lowest, highest = extremes(SOUND, window_samples=4)
    assert lowest.tolist() == [-0.7, -0.4, -0.6]
    assert highest.tolist() == [0.3, -0.4, 0.5]


def test_no_sound_has_no_outline_and_no_window_is_an_error() -> None:
    assert peak_envelope(np.empty(0), window_samples=3).size == 0
    assert extremes(np.empty(0), window_samples=3)[0].size == 0
    with pytest.raises(ArgumentError):
        peak_envelope(SOUND, window_samples=0)
