"""The power spectrum of a sound that streams by, by Welch's method (IEEE Trans. Audio Electroacoust. 15, 1967).

Segments lie at fixed samples, so nothing depends on how the sound was cut into pieces; one segment is held.
"""

from __future__ import annotations

import numpy as np
from scipy.signal.windows import hann

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.errors import require

LONGEST_SEGMENT, SHORTEST_SEGMENT = 8192, 64
LEAST_MEASURED = 0.9
"""A segment of which less was measured does not count."""


def segment_for(samples: float) -> int:
    """Return a length of segments for a sound of so many samples: a power of two, two of them at the least if it can be."""
    fitting = 2 ** int(np.log2(max(samples / 2, SHORTEST_SEGMENT)))
    return int(np.clip(fitting, SHORTEST_SEGMENT, LONGEST_SEGMENT))


class SpectrumMeter:
    """Adds up periodograms.

    Parameters
    ----------
    rate_hz : float
    segment_samples : int
        Even; segments overlap by half, each without its mean and under a Hann window.

    Attributes
    ----------
    segments, left_out : int
        How many count, and how many do not because too little of them was measured.
    """

    def __init__(self, rate_hz: float, segment_samples: int) -> None:
        require(
            segment_samples >= 2 and segment_samples % 2 == 0,
            f"segments of {segment_samples} samples",
            "an even number",
        )
        self.rate_hz = rate_hz
        self.segments = self.left_out = 0
        self._window = hann(segment_samples, sym=False)
        self._sum = np.zeros(segment_samples // 2 + 1)
        self._held = np.empty((2, 0))

    def add(self, samples: FloatArray, measured: BoolArray) -> None:
        """Take in the next piece; `measured` says which samples were."""
        held = np.concatenate([self._held, [samples, measured]], axis=1)
        size = self._window.size
        while held.shape[1] >= size:
            self._add_segment(held[0, :size], float(held[1, :size].mean()))
            held = held[:, size // 2 :]
        self._held = held

    def _add_segment(self, samples: FloatArray, measured: float) -> None:
        if measured < LEAST_MEASURED:
            self.left_out += 1
            return
        self.segments += 1
        self._sum += np.abs(np.fft.rfft((samples - samples.mean()) * self._window)) ** 2

    @property
    def step_hz(self) -> float:
        """From one frequency to the next."""
        return self.rate_hz / self._window.size

    def density(self) -> tuple[FloatArray, FloatArray]:
        """Return frequencies, Hz, and the one-sided density there, unit²/Hz; NaN before any segment counted."""
        scale = 2 / (self.rate_hz * float(np.sum(self._window**2)))
        density = self._sum * scale / self.segments if self.segments else np.full(self._sum.size, np.nan)
        density[[0, -1]] /= 2
        frequency_hz: FloatArray = np.arange(self._sum.size, dtype=np.float64) * self.step_hz
        return frequency_hz, np.asarray(density, np.float64)
