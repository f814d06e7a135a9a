"""Rumble: what lies below the sound is taken off, without moving anything in time.

    H(f) = 1 / (1 + (f₀/f)^2n)

is the response of a Butterworth filter of n poles run forwards and backwards: no phase, ½ at the corner f₀, 0 at 0 Hz. It is
1 − L(f), and the impulse response of the low pass L is a sum of damped oscillations, one for each of its poles

    p_k = f₀ exp(iπ(2k + 1)/2n),   l(t) ∝ Re Σ −i p_k exp(2πi p_k |t|),   k = 0 … n − 1,

sampled, cut off where the slowest has fallen to 10⁻⁹, and scaled to a sum of 1.

References
----------
S. Butterworth, On the theory of filter amplifiers, Experimental Wireless 7, 1930. F. Gustafsson, Determining the initial states
in forward-backward filtering, IEEE Trans. SP 44, 1996, for the response of a filter run both ways.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.signal import fftconvolve

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.preamp.pieces import Window, windows, without_nan
from gramoscope.signal_path import Audio

CUT_OFF = 1e-9


@dataclass(frozen=True)
class RumbleFilter:
    """A high pass of zero phase.

    Parameters
    ----------
    corner_hz : float
        f₀, where the level is halved (−6 dB).
    poles : int
        n; the response falls by 12 n dB an octave.
    """

    corner_hz: float = 20.0
    poles: int = 3

    def __post_init__(self) -> None:
        require(self.corner_hz > 0, f"a corner of {self.corner_hz:g} Hz", "a positive frequency", "20 for most records")
        require(1 <= self.poles <= 8, f"{self.poles} poles", "1 to 8")

    def low_pass(self, rate_hz: float) -> FloatArray:
        """Return what is taken off, as an impulse response about its middle.

        Parameters
        ----------
        rate_hz : float

        Returns
        -------
        float64 array, shape (2 reach + 1,)
            Symmetric, sum 1.

        Raises
        ------
        ArgumentError
            If the corner is not below a quarter of the rate.
        """
        require(
            self.corner_hz < rate_hz / 4,
            f"a corner of {self.corner_hz:g} Hz at {rate_hz:g} Hz",
            "a quarter of the rate",
        )
        # the poles of 1 / (1 + x^2n) in the upper half plane; each has the residue −p/2n, and ∫ … e^iωt = 2πi Σ residues
        angle = np.pi * (2 * np.arange(self.poles) + 1) / (2 * self.poles)
        pole = np.exp(1j * angle)
        corner = 2 * np.pi * self.corner_hz / rate_hz
        reach = int(np.ceil(-np.log(CUT_OFF) / (corner * np.sin(angle[0]))))
        turn = np.exp(1j * corner * np.arange(reach + 1)[:, np.newaxis] * pole)
        half = np.real(-1j * turn @ pole)
        taps = np.concatenate([half[:0:-1], half])
        return np.asarray(taps / taps.sum(), np.float64)

    def take_off(self, pieces: Iterable[Audio]) -> Iterator[Audio]:
        """Return the pieces without their rumble.

        The groove is taken to have been at rest before the first sample and after the last.

        Parameters
        ----------
        pieces : iterable of Audio
            Following each other without gap, at one rate. A NaN counts as 0 and is flagged `INTERPOLATED`.

        Yields
        ------
        Audio
            The same samples, whatever the pieces they came in; at the most twice the reach of `low_pass` is held back. Flags
            stay. `sigma` is that of errors with a flat spectrum, smaller by what the filter takes of them: a part in
            a thousand.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it or has another rate, or if the corner is too high for the rate.
        """
        first = next(pieces := iter(pieces), None)
        if first is None:
            return
        taps = self.low_pass(first.rate_hz)
        reach = taps.size // 2
        gain = float(np.sqrt(1 - 2 * taps[reach] + np.sum(taps**2)))
        for window in windows(map(without_nan, chain([first], pieces)), block=max(reach, 4096), margin=reach):
            block = window.block
            history = (*block.history, self.history_line)
            yield replace(block, samples=_high(window, taps), sigma=block.sigma * gain, history=history)

    @property
    def history_line(self) -> str:
        """What the filter did, in words for the archive."""
        return f"high pass of zero phase, −6 dB at {self.corner_hz:g} Hz, {12 * self.poles} dB an octave"


def _high(window: Window, taps: FloatArray) -> FloatArray:
    samples, reach = window.audio.samples, taps.size // 2
    around = np.zeros(window.stop - window.start + 2 * reach)
    first = reach - window.start
    around[first : first + samples.size] = samples
    return np.asarray(samples[window.start : window.stop] - fftconvolve(around, taps, "valid"), np.float64)
