"""How an orchestra on a record is tuned: another clock in the groove, if its A was 440 Hz.

Partials that last (strong peaks of Hann windows of 0.3 s, met again in the next window within some cents) are measured in cents
from the nearest note of equal temperament about A = 440 Hz. As a circle of 100 cents has no beginning they are added as
vectors; the direction of the sum is the tuning. Fifth and seventh partials are not notes of the scale, singers are not
tempered, and pitch was not 440 everywhere: it is a hint, and its sigma is that of chance alone, the scatter over the passage.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.fft

from gramoscope.conventions import FloatArray
from gramoscope.listening.windows import TimeBlocks, Windows, jackknife_sigma
from gramoscope.signal_path import Audio

CONCERT_PITCH_HZ = 440.0
WINDOW_S, HOP_S = 0.3, 0.15
LOWEST_HZ, HIGHEST_HZ = 220.0, 1760.0
LEAST_WINDOWS = 64
ABOVE_MEDIAN, BELOW_STRONGEST = 100.0, 1e-3
"""A partial has so many times the median power of the band, and so much of that of the strongest one, at the least."""
SUSTAINED_CENTS = 15.0
LEAST_RESULTANT = 0.25
LARGEST_SIGMA_CENTS = 8.0


@dataclass(frozen=True)
class TuningFinding:
    """How far the notes lie from A = 440 Hz.

    Attributes
    ----------
    cents, sigma_cents : float
        −50 … 50, positive for sharp; NaN when nothing is said.
    partials : int
        How many were measured.
    reason : str or None
        Why nothing is said; None when something is.
    """

    cents: float = float("nan")
    sigma_cents: float = float("nan")
    partials: int = 0
    reason: str | None = None

    @property
    def a_hz(self) -> float:
        """The A that goes with it."""
        return CONCERT_PITCH_HZ * self.factor

    @property
    def factor(self) -> float:
        """How much higher everything is than with A = 440 Hz."""
        return float(2 ** (self.cents / 1200))


@dataclass
class TuningListener:
    """Listens for the tuning of sound that passes by.

    Parameters
    ----------
    rate_hz : float
        At least 3600 Hz for anything to be heard.
    """

    rate_hz: float
    _vectors: TimeBlocks = field(default_factory=lambda: TimeBlocks(24))
    _before: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        self._windows = Windows(round(WINDOW_S * self.rate_hz), round(HOP_S * self.rate_hz))
        self._hann = np.hanning(self._windows.length + 1)[:-1]

    def hear(self, piece: Audio) -> None:
        """Take in the next piece."""
        for samples in self._windows.of(piece):
            cents, weight = self._partials(samples)
            nearest = np.abs(cents[:, None] - self._before[None, :]).min(axis=1, initial=np.inf)
            lasts = nearest < SUSTAINED_CENTS
            angle, weight = 2 * np.pi * cents[lasts] / 100, weight[lasts]
            self._vectors.add(
                np.array([np.sum(weight * np.cos(angle)), np.sum(weight * np.sin(angle)), weight.sum(), lasts.sum()])
            )
            self._before = cents

    def finding(self) -> TuningFinding:
        """Return what was heard by now."""
        if self._vectors.count < LEAST_WINDOWS:
            return TuningFinding(reason=f"too short: {WINDOW_S + HOP_S * (LEAST_WINDOWS - 1):.2g} s are needed")
        x, y, weight, partials = self._vectors.sums().sum(axis=0)
        if not np.hypot(x, y) > LEAST_RESULTANT * weight:
            return TuningFinding(partials=int(partials), reason="the partials that last agree on no tuning")
        angle = np.arctan2(y, x)
        without = self._vectors.without_neighbours()
        beside = np.angle((without[:, 0] + 1j * without[:, 1]) * np.exp(-1j * angle))
        sigma = jackknife_sigma(beside * 50 / np.pi)
        if not sigma < LARGEST_SIGMA_CENTS:
            return TuningFinding(partials=int(partials), reason=f"the tuning is known to {sigma:.2g} cents only")
        return TuningFinding(float(angle * 50 / np.pi), sigma, int(partials))

    def _partials(self, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cents of each partial from A = 440 Hz, and its weight: its amplitude over that of the strongest one."""
        # twice as long with zeros: a parabola then finds a peak without bias
        spectrum = scipy.fft.rfft(samples * self._hann, 2 * samples.size)
        power = np.abs(spectrum) ** 2 + np.finfo(np.float64).tiny
        bin_hz = self.rate_hz / (2 * samples.size)
        band = np.arange(round(LOWEST_HZ / bin_hz), min(round(HIGHEST_HZ / bin_hz), power.size - 1))
        if band.size < 3:
            return np.empty(0), np.empty(0)
        here = power[band]
        strong = (here > ABOVE_MEDIAN * np.median(here)) & (here > BELOW_STRONGEST * here.max())
        peak = band[strong & (here > power[band - 1]) & (here >= power[band + 1])]
        before, top, after = (np.log(power[peak + shift]) for shift in (-1, 0, 1))
        frequency = (peak + (before - after) / (2 * np.minimum(before - 2 * top + after, -1e-9))) * bin_hz
        return 1200 * np.log2(frequency / CONCERT_PITCH_HZ), np.sqrt(power[peak] / here.max())
