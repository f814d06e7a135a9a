"""Wow: a platter that does not turn evenly, or a record that does not lie in its centre.

A slow sine in the speed of the platter leaves the sound's clock behind and ahead of the groove's place,

    t(s) = τ + d sin(2πfτ + ψ) / (2πf) − d sin ψ / (2πf),       τ = nominal time of the place s,

so that time zero stays at s = 0 and the relative speed swings by ± d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require


@dataclass(frozen=True)
class Wow:
    """A sinusoidal unevenness of the recording turntable.

    Parameters
    ----------
    depth : float
        Largest relative deviation of the speed, 0 … 0.5; 0.002 is good, 0.01 can be heard by anyone.
    frequency_hz : float
        How often it comes round, positive; 1.3 Hz is once a turn at 78 rpm.
    phase_rad : float
        Where in its swing it stands at s = 0.
    """

    depth: float = 0.0
    frequency_hz: float = 1.3
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        require(0 <= self.depth <= 0.5, f"a wow of {self.depth}", "0 … 0.5 of the speed")
        require(self.frequency_hz > 0, f"a wow at {self.frequency_hz} Hz", "a positive frequency")

    def sound_time_s(self, nominal_time_s: npt.ArrayLike) -> FloatArray:
        """Return the time in the recorded sound that belongs to a place's nominal time; NaN gives NaN."""
        nominal = np.asarray(nominal_time_s, np.float64)
        angular = 2 * np.pi * self.frequency_hz
        swing = np.sin(angular * nominal + self.phase_rad) - np.sin(self.phase_rad)
        return np.asarray(nominal + self.depth / angular * swing, np.float64)

    def rate(self, nominal_time_s: npt.ArrayLike) -> FloatArray:
        """Return d(sound time)/d(nominal time), 1 + d cos(2πfτ + ψ): above 1 the sound runs fast."""
        angle = 2 * np.pi * self.frequency_hz * np.asarray(nominal_time_s, np.float64) + self.phase_rad
        return np.asarray(1 + self.depth * np.cos(angle), np.float64)
