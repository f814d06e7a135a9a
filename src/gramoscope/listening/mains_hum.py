"""Mains hum that was recorded with the sound: a clock of 50 or 60 Hz in the groove.

Early amplifiers hum at the mains and their multiples. Played at the right speed that line lies at 50 or 60 Hz; a record played
at n turns a minute that shows it at f should turn at n · 60/f (or n · 50/f). Hum is steady where music is not, so that what is
averaged is the *logarithm* of the power (Hann windows of 4 s), and a line must stand out in most windows: a bass note that
comes and goes does not. Lines at f, 2f, 3f and 4f speak for one f together.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.fft
from scipy.ndimage import maximum_filter1d, median_filter

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.listening.windows import TimeBlocks, Windows, jackknife_sigma
from gramoscope.signal_path import Audio

WINDOW_S = 4.0
LEAST_WINDOWS = 4
LOWEST_HZ, HIGHEST_HZ = 42.5, 69.0
"""Mains of 50 and 60 Hz, 15 % slow or fast."""
MAINS_HZ = (50.0, 60.0)
HARMONICS = np.arange(1, 5)
SURROUNDINGS_HZ = 6.0
LEAST_STRENGTH, SUPPORTING_STRENGTH, MOST_STRENGTH = 8.0, 5.0, 20.0
"""In standard deviations of the log spectrum about its running median: a line that is believed, one that helps to place it, and
more than that does not count."""
PRESENT = 2.0
"""A line is there in a window when it is e² times its surroundings: noise is in 5 windows of 100, within half a hertz."""
STEADY = 0.75
"""It must be there in such a share of them."""
LOG_POWER_SIGMA = np.pi / np.sqrt(6)
"""Standard deviation of the logarithm of an exponentially distributed power."""


@dataclass(frozen=True)
class HumFinding:
    """A steady line near the mains.

    Attributes
    ----------
    line_hz, sigma_hz : float
        Its fundamental, as the sound plays; NaN when there is none.
    harmonics : tuple of int
        Which multiples are seen.
    above_surroundings_db : float
        The strongest of them.
    reason : str or None
        Why nothing is said; None when there is a line.
    """

    line_hz: float = float("nan")
    sigma_hz: float = float("nan")
    harmonics: tuple[int, ...] = ()
    above_surroundings_db: float = float("nan")
    reason: str | None = None

    def mains_hz(self) -> tuple[float, ...]:
        """Return the mains that it could have been, 15 % off at the most, the nearest first."""
        possible = [mains for mains in MAINS_HZ if abs(self.line_hz / mains - 1) <= 0.15]
        return tuple(sorted(possible, key=lambda mains: abs(self.line_hz / mains - 1)))


@dataclass
class HumListener:
    """Listens for mains hum in sound that passes by.

    Parameters
    ----------
    rate_hz : float
    """

    rate_hz: float
    _spectra: TimeBlocks = field(default_factory=lambda: TimeBlocks(8))

    def __post_init__(self) -> None:
        self._windows = Windows(round(WINDOW_S * self.rate_hz), round(WINDOW_S * self.rate_hz))
        self._hann = np.hanning(self._windows.length + 1)[:-1]
        self._bin_hz = self.rate_hz / (2 * self._windows.length)
        self._reach = round(0.5 / self._bin_hz)
        self._first = int((LOWEST_HZ - SURROUNDINGS_HZ) / self._bin_hz)
        self._stop = int((HARMONICS[-1] * HIGHEST_HZ + SURROUNDINGS_HZ) / self._bin_hz)

    def hear(self, piece: Audio) -> None:
        """Take in the next piece."""
        for samples in self._windows.of(piece):
            # twice as long with zeros: a parabola then finds a peak without bias
            spectrum = scipy.fft.rfft((samples - samples.mean()) * self._hann, 2 * samples.size)
            power = np.abs(spectrum[self._first : self._stop]) ** 2
            log_power = np.log(np.maximum(power, np.finfo(np.float64).tiny))
            present = maximum_filter1d(self._excess(log_power), 2 * self._reach + 1) > PRESENT
            self._spectra.add(np.stack([log_power, present]))

    def finding(self) -> HumFinding:
        """Return what was heard by now."""
        count = self._spectra.count
        if count < LEAST_WINDOWS:
            return HumFinding(reason=f"too short: {WINDOW_S * LEAST_WINDOWS:g} s are needed")
        mean, present = self._spectra.sums().sum(axis=0) / count
        excess = self._excess(mean)
        strength = excess / max(1.4826 * float(np.median(np.abs(excess))), LOG_POWER_SIGMA / np.sqrt(count))
        rough_hz = self._rough_hz(strength)
        peaks = [self._peak(strength, order * rough_hz) for order in HARMONICS]
        heights = strength[peaks]
        loudest = peaks[int(np.argmax(heights[:2]))]
        if strength[loudest] < LEAST_STRENGTH or present[loudest] < STEADY:
            return HumFinding(reason="no steady line near 50 or 60 Hz stands out")
        seen = np.flatnonzero(heights >= SUPPORTING_STRENGTH)
        orders, bins = HARMONICS[seen], np.array(peaks)[seen]
        without = np.array(
            [self._placed_hz(one, orders, bins, excess) for one, _ in self._spectra.without_neighbours()]
        )
        return HumFinding(
            line_hz=self._placed_hz(mean, orders, bins, excess),
            sigma_hz=jackknife_sigma(without),
            harmonics=tuple(int(order) for order in orders),
            above_surroundings_db=float(10 * np.log10(np.e) * excess[bins].max()),
        )

    def _excess(self, log_power: FloatArray) -> FloatArray:
        """By how much a logarithmic spectrum is above its surroundings."""
        size = 2 * round(SURROUNDINGS_HZ / self._bin_hz) + 1
        return np.asarray(log_power - median_filter(log_power, size=size, mode="nearest"), np.float64)

    def _rough_hz(self, strength: FloatArray) -> float:
        """The fundamental that all multiples together like best."""
        fundamental = np.arange(LOWEST_HZ, HIGHEST_HZ, self._bin_hz / 4)
        bins = HARMONICS[:, None] * fundamental / self._bin_hz - self._first
        likes = np.interp(bins, np.arange(strength.size), np.clip(strength, 0, MOST_STRENGTH)).sum(axis=0)
        return float(fundamental[int(np.argmax(likes))])

    def _peak(self, strength: FloatArray, frequency_hz: float) -> int:
        middle = round(frequency_hz / self._bin_hz) - self._first
        first, stop = max(middle - self._reach, 1), min(middle + self._reach + 1, strength.size - 1)
        return first + int(np.argmax(strength[first:stop]))

    def _placed_hz(self, log_power: FloatArray, orders: IntArray, bins: IntArray, excess: FloatArray) -> float:
        """The fundamental by the peaks of its multiples in a spectrum, each the more, the higher and the stronger it is."""
        before, here, after = log_power[bins - 1], log_power[bins], log_power[bins + 1]
        beyond = np.clip((before - after) / (2 * np.minimum(before - 2 * here + after, -1e-9)), -1, 1)
        frequency = (bins + beyond + self._first) * self._bin_hz
        weight = np.expm1(np.minimum(excess[bins], 10.0))
        return float(np.sum(weight * orders * frequency) / np.sum(weight * orders**2))
