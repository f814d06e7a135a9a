"""What is believed of a groove before it is seen: its slope is coloured noise, its place the integral of that.

The slope da/ds = u + v is taken for the sum of two stationary Gaussian processes, a *body* u and a weaker, *wide* v:

    S_u(k) = q_u / ((k² + λ²)² (k² + μ²)²),     S_v(k) = q_v / (k² + ν²)³.

The body is flat up to the corner λ, then falls by 12 dB an octave, and by 24 dB an octave beyond the cut-off μ, as everything
does that a cutter has cut. How steeply it falls matters more than its shape where the groove is well seen, for above the
frequency where the readings drown in their own noise the prior has the word. Errors of places that are white make errors of
velocity that rise as k², cut off where S falls below them; a smoother that believes S ~ k^(−2p) there while nothing is there
claims errors √(n/(n−1)) too large, n = (2p + 2)/3: by 1.41 for Matérn's process of order 3/2, by 1.20 for the body, by 1.26 for
what is wide. And a groove rougher than the prior gets errors that are claimed too small: consonants, cymbals and surface lie
30 … 45 dB below the music's strongest octaves, reach far beyond them, and where they drown their power belongs into the error
bar. They are what v is for. With λ far below μ the body is nearly Matérn's process of order 3/2, with both together that of
order 7/2, and the capture chooses.

The state is (a, u, …, u‴, v, v′, v″), each derivative times the power of the grid's step Δ that makes it a length: it means
the same whatever the prior is, and its parts are of like size. Over one step it moves by A = exp(F) with noise of covariance
Q = ∫₀¹ exp(Ft) W exp(Ft)ᵀ dt: Taylor's series over a short step (dQ/dt = FQ + QFᵀ + W), then doubled by
Q ← Q + A Q Aᵀ, A ← A² as often as needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.tonearm.vector_rows import PARTS, STATES, multiply, transpose

ORDER, WIDE_POLES = 4, 3
"""Poles of u, two at λ and two at μ, and of v."""
BODY, WIDE = 1, 1 + ORDER
"""Where u and v (times Δ) stand in the state."""
assert (range(BODY, WIDE), range(WIDE, WIDE + WIDE_POLES)) == PARTS
SLOPE = np.zeros(STATES)
"""The slope (times Δ) is this row times the state."""
SLOPE[[BODY, WIDE]] = 1.0
BEND_M = 50e-6
"""ℓ, over which a bend is measured."""
TERMS = 32
"""Of the series over a short step: Q of the place begins with the eleventh."""


@dataclass(frozen=True)
class GroovePrior:
    """What is believed of the groove in one direction.

    Attributes
    ----------
    corner_per_m, cutoff_per_m, width_per_m : float
        λ, μ and ν.
    wide_share : float
        √(var v / var u).
    share : float
        How much the groove bends, standard deviation, for each unit of the *level* by which loud and soft are told
        (`tonearm.level`); about one.
    floor : float
        How much it bends at the least.
    """

    corner_per_m: float
    cutoff_per_m: float
    width_per_m: float
    wide_share: float
    share: float = 1.0
    floor: float = 0.0

    def bends(self, level: FloatArray | float) -> FloatArray:
        """Return how much the groove is believed to bend at levels, a change of slope over `BEND_M`."""
        return np.maximum(self.share * np.asarray(level), self.floor)

    def slope_density(self, wavenumber_per_m: FloatArray) -> FloatArray:
        """Return S_u + S_v in metres, two-sided, for var u = 1: its integral over dk/2π from −∞ to ∞ is 1 + `wide_share`²."""
        k2 = np.asarray(wavenumber_per_m, np.float64) ** 2
        one, other, width = self.corner_per_m, self.cutoff_per_m, self.width_per_m
        product, both = one * other, one + other
        body = 4 * (product * both) ** 3 / (both**2 + product) / ((k2 + one**2) * (k2 + other**2)) ** 2
        wide = self.wide_share**2 * 16 / 3 * width**5 / (k2 + width**2) ** 3
        return np.asarray(body + wide)

    def steps(self, step_m: float) -> tuple[FloatArray, FloatArray]:
        """Return A and Q for one step of the grid, shape (8, 8) each, the state in metres and var u = 1."""
        a, q = steps(self._shape, step_m)
        return a, q

    def at_rest(self, step_m: float) -> FloatArray:
        """Return the covariance of all but the place before anything was seen, shape (7, 7), for var u = 1."""
        resting: FloatArray = process(self._shape, step_m)[2]
        return resting

    def bend(self, step_m: float) -> float:
        """Return the standard deviation of (a(s + ℓ) − 2a(s) + a(s − ℓ))/ℓ, ℓ = `BEND_M`, for var u = 1."""
        return float(bend(self._shape, step_m))

    @property
    def _shape(self) -> tuple[float, float, float, float]:
        return self.corner_per_m, self.cutoff_per_m, self.width_per_m, self.wide_share


@numba.njit(cache=True, nogil=True)
def process(shape, step_m):  # type: ignore[no-untyped-def]
    """F, density of the noise, and covariance at rest of (u, …, u‴, v, v′, v″), in steps and for var u = 1.

    With x the derivatives of a stationary process, E[x⁽ⁱ⁾x⁽ʲ⁾] = ± r_{(i+j)/2} for even i + j, else 0. Multiplied with each
    of them its equation x⁗ + c₃x‴ + … = w gives what follows.
    """
    one, other, width = shape[0] * step_m, shape[1] * step_m, shape[2] * step_m
    product, both = one * other, one + other
    drift, noise, resting = np.zeros((STATES, STATES)), np.zeros((STATES, STATES)), np.zeros((STATES - 1, STATES - 1))
    drift[0] = SLOPE
    _companion(drift, BODY, (product**2, 2 * product * both, both**2 + 2 * product, 2 * both))
    spread = both**2 + product
    _stationary(resting, BODY - 1, (1.0, product**2 / spread, product**3 / spread, product**3), 1.0)
    noise[WIDE - 1, WIDE - 1] = 4 * (product * both) ** 3 / spread
    _companion(drift, WIDE, (width**3, 3 * width**2, 3 * width))
    _stationary(resting, WIDE - 1, (1.0, width**2 / 3, width**4), shape[3] ** 2)
    noise[-1, -1] = shape[3] ** 2 * 16 / 3 * width**5
    return drift, step_m**2 * noise, step_m**2 * resting


@numba.njit(cache=True, nogil=True)
def _companion(drift, first, coefficients):  # type: ignore[no-untyped-def]
    """Write F of a process whose highest derivative follows from the others."""
    last = first + len(coefficients) - 1
    for i in range(len(coefficients)):
        if first + i < last:
            drift[first + i, first + i + 1] = 1.0
        drift[last, first + i] = -coefficients[i]


@numba.njit(cache=True, nogil=True)
def _stationary(resting, first, powers, scale):  # type: ignore[no-untyped-def]
    """Write the covariance at rest of a process and its derivatives, whose variances are given."""
    for i in range(len(powers)):
        for j in range(i % 2, len(powers), 2):
            sign = 1.0 if (i - j) % 4 == 0 else -1.0
            resting[first + i, first + j] = scale * sign * powers[(i + j) // 2]


@numba.njit(cache=True, nogil=True)
def steps(shape, step_m):  # type: ignore[no-untyped-def]
    """Return what `GroovePrior.steps` does."""
    drift, noise, _ = process(shape, step_m)
    return _one_step(drift, noise)


@numba.njit(cache=True, nogil=True)
def bend(shape, step_m):  # type: ignore[no-untyped-def]
    """Return what `GroovePrior.bend` does."""
    drift, noise, resting = process(shape, step_m)
    lag = BEND_M / step_m
    a, q = _one_step(lag * drift, lag * noise)
    later = a[0].copy()
    later[0] -= 2.0
    now = (later @ a)[1:]
    return np.sqrt(now @ resting @ now + later @ q @ later + q[0, 0]) / BEND_M


def start(at_rest: FloatArray, sigma: float, *, place_sigma_m: float) -> FloatArray:
    """Return the covariance, shape (8, 8), of a state of which only the prior is known, at a place that is not."""
    covariance = np.zeros((STATES, STATES))
    covariance[0, 0] = place_sigma_m**2
    covariance[1:, 1:] = sigma**2 * at_rest
    return covariance


@numba.njit(cache=True, nogil=True)
def _series(f, noise, a, q):  # type: ignore[no-untyped-def]
    """Write A and Q over a step that is short enough for the series to converge at once."""
    power, change, one, two = np.eye(STATES), noise.copy(), np.empty_like(f), np.empty_like(f)
    a[:] = power
    q[:] = change
    for n in range(1, TERMS):
        multiply(f, 0, 0, power, 0, 0, one, 0, 0)
        multiply(f, 0, 0, change, 0, 0, two, 0, 0)
        for i in range(STATES):
            for j in range(STATES):
                power[i, j] = one[i, j] / n
                a[i, j] += power[i, j]
                change[i, j] = (two[i, j] + two[j, i]) / (n + 1)
                q[i, j] += change[i, j]


@numba.njit(cache=True, nogil=True)
def _one_step(f, noise):  # type: ignore[no-untyped-def]
    """Return exp(F) and ∫₀¹ exp(Ft) W exp(Ft)ᵀ dt, W being the density of the noise."""
    largest = 0.0
    for i in range(STATES):
        largest = max(largest, np.sum(np.abs(f[i])))
    halvings = max(0, int(np.ceil(np.log2(largest))))
    share = 0.5**halvings
    a, q, one, two = np.empty_like(f), np.empty_like(f), np.empty_like(f), np.empty_like(f)
    _series(f * share, noise * share, a, q)
    for _ in range(halvings):
        multiply(a, 0, 0, q, 0, 0, one, 0, 0)
        transpose(a, 0, 0, two, 0, 0)
        multiply(one, 0, 0, two, 0, 0, one, 0, 0)
        q += one
        multiply(a, 0, 0, a, 0, 0, two, 0, 0)
        a[:] = two
    return a, q


@numba.njit(cache=True, nogil=True)
def taylor(fraction):  # type: ignore[no-untyped-def]
    """Return the rows that take the state to the place a fraction of a step away.

    Parameters
    ----------
    fraction : float64 array, shape (reading,)
        −½ … ½ of a step. What the noise of the process adds over half a step is far below a reading's error.

    Returns
    -------
    float64 array, shape (reading, 8)
        Of u four terms of the series count, of v three.
    """
    out = np.zeros((fraction.size, STATES))
    for j in range(fraction.size):
        power = 1.0
        for i in range(WIDE):
            out[j, i] = power
            if 0 < i <= WIDE_POLES:
                out[j, ORDER + i] = power
            power *= fraction[j] / (i + 1)
    return out
