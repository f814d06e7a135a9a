"""What is believed of a groove before it is seen: its slope is coloured noise, its place the integral of that.

The slope u = da/ds is taken for a stationary Gaussian process with the spectral density

    S(k) = q / ((k² + λ²)(k² + μ²)³),        q such that var u = σ²:

flat up to the corner λ, then falling by 6 dB an octave as music does, and by 24 dB an octave beyond the cut-off μ, as
everything does that a cutter has cut. It obeys (d/ds + λ)(d/ds + μ)³ u = white noise of density q.

How steeply S falls matters more than its shape where the groove is well seen, for above the frequency where the readings
drown in their own noise the prior has the word. Errors of places that are white make errors of velocity that rise as k²,
cut off where S falls below them; a smoother that believes S ~ k^(−2p) there while nothing is there claims errors √(n/(n−1))
too large, n = (2p + 2)/3: by 1.41 for Matérn's process of order 3/2, by 1.20 for this one. And a groove rougher than the
prior gets errors that are claimed too small: with λ and μ apart the process is one of Ornstein and Uhlenbeck, with both
together that of Matérn of order 7/2, and the capture chooses.

The state is (a, u, u′, u″, u‴), each derivative times the power of the grid's step Δ that makes it a length: it means the
same whatever the prior is, and its parts are of like size. Over one step it moves by A = exp(F) with noise of covariance
Q = ∫₀¹ exp(Ft) L q Lᵀ exp(Ft)ᵀ dt, both from one exponential of a matrix (Van Loan, *Computing integrals involving the
matrix exponential*, IEEE Trans. AC-23, 1978).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy import linalg

from gramoscope.conventions import FloatArray

ORDER = 4
"""Poles of the slope."""
STATES = ORDER + 1
SLOPE = 1
"""Where the slope (times Δ) stands in the state."""


@dataclass(frozen=True)
class GroovePrior:
    """What is believed of the groove in one direction.

    Attributes
    ----------
    sigma : float
        σ, standard deviation of the slope.
    corner_per_m, cutoff_per_m : float
        λ and μ.
    """

    sigma: float
    corner_per_m: float
    cutoff_per_m: float

    def steps(self, step_m: float) -> tuple[FloatArray, FloatArray]:
        """Return A and Q for one step of the grid, shape (5, 5) each, the state in metres."""
        drift, density, _ = self._process(step_m)
        driven = np.zeros((STATES, STATES))
        driven[-1, -1] = 1.0
        both = linalg.expm(np.block([[-drift, driven], [np.zeros((STATES, STATES)), drift.T]]))
        a = np.ascontiguousarray(both[STATES:, STATES:].T)
        q = a @ both[:STATES, STATES:]
        return a, density * (q + q.T) / 2

    def rest(self, step_m: float, *, place_sigma_m: float) -> FloatArray:
        """Return the covariance, shape (5, 5), of the state before anything was seen: a slope at rest, anywhere."""
        covariance = np.zeros((STATES, STATES))
        covariance[0, 0] = place_sigma_m**2
        covariance[1:, 1:] = self._process(step_m)[2]
        return covariance

    def _process(self, step_m: float) -> tuple[FloatArray, float, FloatArray]:
        """F, density of the noise, and stationary covariance of (u, u′, u″, u‴), in steps."""
        corner, cutoff = self.corner_per_m * step_m, self.cutoff_per_m * step_m
        # solved in units in which the poles lie about one, so that nothing is lost between u and u‴
        unit = (corner * cutoff**3) ** (1 / ORDER)
        moving = np.diag(np.ones(ORDER - 1), 1)
        moving[-1] = -np.poly([-corner / unit, *3 * [-cutoff / unit]])[:0:-1]
        driven = np.zeros((ORDER, ORDER))
        driven[-1, -1] = -1.0
        resting = linalg.solve_continuous_lyapunov(moving, driven)
        power = (self.sigma * step_m) ** 2 / resting[0, 0]
        scale = unit ** np.arange(ORDER)
        drift = np.diag(np.ones(ORDER), 1)
        drift[1:, 1:] = unit * moving * np.outer(scale, 1 / scale)
        return drift, float(power * unit * scale[-1] ** 2), power * resting * np.outer(scale, scale)


def taylor(fraction: FloatArray) -> FloatArray:
    """Return the rows that take the state to the place a fraction of a step away.

    Parameters
    ----------
    fraction : float64 array, shape (reading,)
        −½ … ½ of a step. What the noise of the process adds over half a step is far below a reading's error.

    Returns
    -------
    float64 array, shape (reading, 5)
    """
    return np.stack([fraction**i / factorial(i) for i in range(STATES)], axis=-1)
