"""Loudness: how loud a sound is to people, by ITU-R BS.1770-4 and EBU R128.

The sound is weighted like a head hears (K-weighting: a shelf of +4 dB above 2 kHz, a high-pass at 38 Hz) and squared; the
channels' powers are added. Loudness in LUFS is −0.691 + 10 lg of the mean power: over 400 ms *momentary*, over 3 s
*short-term*. The *integrated* loudness is the mean over blocks of 400 ms, ten a second, above −70 LUFS and above 10 LU below
their own mean. The loudness *range* is what lies between the 10th and the 95th percentile of the short-term loudness above
−70 LUFS and above 20 LU below their mean (EBU Tech 3342).

The filters are given for 48 kHz; for other rates they are taken back to their analogue prototypes, by the bilinear transform
that made them, and brought to that rate: their responses agree within 0.01 dB from 32 kHz up, 0.03 dB at 22.05 and 0.12 dB
at 12 kHz.

The meter keeps the last three seconds of power, and histograms in steps of 0.01 LU instead of all blocks; each step remembers
the sum of its blocks' powers, so that nothing but the place of the relative gates is rounded. What does not fill a block is
not measured: a sound under 400 ms has no loudness, one under 3 s no short-term loudness and no range.

All channels count alike (weight 1), as left, right and centre do.

References
----------
ITU-R BS.1770-4 (2015). EBU Tech 3341 v3 (2016), loudness metering; EBU Tech 3342 v3 (2016), loudness range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.listening.true_peak import TruePeakMeter

OFFSET_DB = -0.691
"""Makes a tone of 997 Hz at full scale in one channel −3.01 LUFS."""
STEPS_A_SECOND = 100
"""Powers are added up over hundredths of a second, so that the loudest window is found to 5 ms: 0.06 LU."""
MOMENTARY, SHORT_TERM, BLOCK = 40, 300, 10
"""Windows, and from one gating block to the next, in steps."""
ABSOLUTE_GATE_LUFS = -70.0
INTEGRATED_GATE_LU, RANGE_GATE_LU = -10.0, -20.0
RANGE_PERCENTILES = (10, 95)
_LOUDEST_LUFS, _BINS_A_LU = 30.0, 100

LOWEST_RATE_HZ = 4000
"""Below it the shelf's corner nears half the rate: no loudness is measured."""
_SHELF_HZ, _SHELF_Q, _SHELF_DB, _SHELF_MIDDLE = (
    1681.974450955533,
    0.7071752369554196,
    3.999843853973347,
    0.4996667741545416,
)
_HIGH_PASS_HZ, _HIGH_PASS_Q = 38.13547087602444, 0.5003270373238773


@dataclass(frozen=True)
class Loudness:
    """What a meter found; NaN where a sound is too short or too soft.

    Attributes
    ----------
    integrated_lufs, range_lu : float
    max_true_peak_dbtp : float
        Against full scale; −∞ for silence.
    max_momentary_lufs, max_short_term_lufs : float
    """

    integrated_lufs: float
    range_lu: float
    max_true_peak_dbtp: float
    max_momentary_lufs: float
    max_short_term_lufs: float

    def in_order(self) -> tuple[float, float, float, float, float]:
        """Return the values in the order of the `bext` chunk."""
        return (
            self.integrated_lufs,
            self.range_lu,
            self.max_true_peak_dbtp,
            self.max_momentary_lufs,
            self.max_short_term_lufs,
        )


def k_weighting(rate_hz: float) -> FloatArray:
    """Return the K-weighting filter as two second-order sections, for `scipy.signal.sosfilt`.

    At 48 kHz the coefficients are those printed in BS.1770. The high-pass printed there has a gain of 1.005 at high
    frequencies, and so has ours at every rate.
    """
    k = np.tan(np.pi * _SHELF_HZ / rate_hz)
    top = 10 ** (_SHELF_DB / 20)
    middle = top**_SHELF_MIDDLE
    a0 = 1 + k / _SHELF_Q + k * k
    shelf = [
        (top + middle * k / _SHELF_Q + k * k) / a0,
        2 * (k * k - top) / a0,
        (top - middle * k / _SHELF_Q + k * k) / a0,
        1.0,
        2 * (k * k - 1) / a0,
        (1 - k / _SHELF_Q + k * k) / a0,
    ]
    gain = _high_pass_denominator(48_000.0)[0] / _high_pass_denominator(rate_hz)[0]
    b0, b1, b2 = _high_pass_denominator(rate_hz)
    return np.array([shelf, [gain, -2 * gain, gain, 1.0, b1 / b0, b2 / b0]])


def _high_pass_denominator(rate_hz: float) -> tuple[float, float, float]:
    k = float(np.tan(np.pi * _HIGH_PASS_HZ / rate_hz))
    return 1 + k / _HIGH_PASS_Q + k * k, 2 * (k * k - 1), 1 - k / _HIGH_PASS_Q + k * k


def _lufs(power: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(OFFSET_DB + 10 * np.log10(power), np.float64)


class _Histogram:
    """Powers of blocks above the absolute gate, by their loudness."""

    def __init__(self) -> None:
        bins = round((_LOUDEST_LUFS - ABSOLUTE_GATE_LUFS) * _BINS_A_LU)
        self.blocks = np.zeros(bins, np.int64)
        self.power = np.zeros(bins)

    def add(self, power: FloatArray) -> None:
        loud = power[_lufs(power) > ABSOLUTE_GATE_LUFS]
        place = ((_lufs(loud) - ABSOLUTE_GATE_LUFS) * _BINS_A_LU).astype(np.intp).clip(0, self.blocks.size - 1)
        np.add.at(self.blocks, place, 1)
        np.add.at(self.power, place, loud)

    def mean_lufs(self, first: int = 0) -> float:
        """Loudness of the mean power of all blocks from a bin on; NaN for none."""
        blocks = int(self.blocks[first:].sum())
        return float(_lufs(self.power[first:].sum() / blocks)) if blocks else float("nan")

    def gate(self, below_mean_lu: float) -> int:
        """The first bin that is not below a gate, which is counted from the mean of all."""
        if not self.blocks.any():
            return 0
        place = (self.mean_lufs() + below_mean_lu - ABSOLUTE_GATE_LUFS) * _BINS_A_LU
        return max(int(np.ceil(place)), 0)

    def percentiles_lufs(self, shares_percent: tuple[int, int], first: int) -> tuple[float, float]:
        """The loudness that so many per cent of the blocks from a bin on do not exceed; NaN for none."""
        upto = np.cumsum(self.blocks[first:])
        if upto.size == 0 or upto[-1] == 0:
            return float("nan"), float("nan")
        ranks = [round((int(upto[-1]) - 1) * share / 100) for share in shares_percent]
        bins = first + np.searchsorted(upto, ranks, side="right")
        low, high = (ABSOLUTE_GATE_LUFS + (float(bin_) + 0.5) / _BINS_A_LU for bin_ in bins)
        return low, high


class LoudnessMeter:
    """Hears a sound piece by piece, and says how loud it was; nothing depends on how it was cut.

    Parameters
    ----------
    rate_hz : float
        Below `LOWEST_RATE_HZ` only the true peak is measured.
    channels : int
    """

    def __init__(self, rate_hz: float, channels: int) -> None:
        require(rate_hz > 0, f"a rate of {rate_hz} Hz", "a positive one")
        require(channels >= 1, f"{channels} channels", "at least one")
        self._deaf = rate_hz < LOWEST_RATE_HZ
        self._step = max(round(rate_hz / STEPS_A_SECOND), 1)
        self._filter = k_weighting(max(rate_hz, LOWEST_RATE_HZ))
        self._state = np.zeros((2, 2, channels))
        self._rest = np.empty((0, channels))
        self._powers = np.empty(0)
        self._steps = 0
        self._momentary, self._short_term = -np.inf, -np.inf
        self._blocks, self._ranges = _Histogram(), _Histogram()
        self._true_peak = TruePeakMeter(channels)

    def hear(self, samples: FloatArray) -> None:
        """Take in a piece, shape (sample, channel), full scale ±1, finite."""
        self._true_peak.hear(samples)
        if self._deaf:
            return
        heard = np.concatenate([self._rest, samples])
        whole = len(heard) // self._step * self._step
        self._rest = heard[whole:]
        if whole:
            weighted, self._state = signal.sosfilt(self._filter, heard[:whole], axis=0, zi=self._state)
            squares = (weighted**2).reshape(-1, self._step, heard.shape[1])
            self._take_in(squares.sum(axis=1).sum(axis=1) / self._step)

    def _take_in(self, fresh: FloatArray) -> None:
        """Take in the powers of whole steps."""
        powers = np.concatenate([self._powers, fresh])
        first = self._steps - self._powers.size
        self._steps += fresh.size
        momentary = _windows(powers, first, MOMENTARY, since=self._steps - fresh.size)
        short_term = _windows(powers, first, SHORT_TERM, since=self._steps - fresh.size)
        self._momentary = max(self._momentary, float(momentary.power.max(initial=-np.inf)))
        self._short_term = max(self._short_term, float(short_term.power.max(initial=-np.inf)))
        self._blocks.add(momentary.every(BLOCK))
        self._ranges.add(short_term.every(BLOCK))
        self._powers = powers[-(SHORT_TERM - 1) :]

    def measured(self) -> Loudness:
        """Return what was heard so far."""
        low, high = self._ranges.percentiles_lufs(RANGE_PERCENTILES, self._ranges.gate(RANGE_GATE_LU))
        peak = self._true_peak.peak()
        return Loudness(
            integrated_lufs=self._blocks.mean_lufs(self._blocks.gate(INTEGRATED_GATE_LU)),
            range_lu=high - low,
            max_true_peak_dbtp=float(20 * np.log10(peak)) if peak > 0 else -np.inf,
            max_momentary_lufs=_loudest_lufs(self._momentary),
            max_short_term_lufs=_loudest_lufs(self._short_term),
        )


def _loudest_lufs(power: float) -> float:
    return float(_lufs(np.asarray(power))) if power >= 0 else float("nan")


@dataclass(frozen=True, eq=False)
class _Windows:
    """Mean powers of windows; the first one starts at a step."""

    start: int
    power: FloatArray

    def every(self, steps: int) -> FloatArray:
        """Those that start at a multiple of so many steps."""
        return self.power[-self.start % steps :: steps]


def _windows(powers: FloatArray, first: int, length: int, *, since: int) -> _Windows:
    """All windows over powers that end after the step `since`; the powers start at the step `first`."""
    start = max(since - length + 1, 0)
    own = powers[start - first :]
    if own.size < length:
        return _Windows(start, np.empty(0))
    return _Windows(start, np.lib.stride_tricks.sliding_window_view(own, length).mean(axis=1))
