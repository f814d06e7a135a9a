"""What is believed of a groove before it is seen: its slope is coloured noise, its place the integral of that.

The slope u = da/ds is taken for a stationary Gaussian process with the spectral density

    S(k) = q / ((k² + λ²)² (k² + μ²)³),        q such that var u = σ²:

flat up to the corner λ, then falling by 12 dB an octave, and by 30 dB an octave beyond the cut-off μ, as everything does that
a cutter has cut. It obeys (d/ds + λ)² (d/ds + μ)³ u = white noise of density q.

How steeply S falls matters more than its shape where the groove is well seen, for above the frequency where the readings
drown in their own noise the prior has the word. Errors of places that are white make errors of velocity that rise as k²,
cut off where S falls below them; a smoother that believes S ~ k^(−2p) there while nothing is there claims errors √(n/(n−1))
too large, n = (2p + 2)/3: by 1.41 for Matérn's process of order 3/2, by 1.15 for this one. And a groove rougher than the
prior gets errors that are claimed too small. With λ far below μ this process is nearly that of Matérn of order 3/2, with both
together that of order 9/2, and the capture chooses.

The state is (a, u, u′, …, u⁗), each derivative times the power of the grid's step Δ that makes it a length: it means the
same whatever the prior is, and its parts are of like size. Over one step it moves by A = exp(F) with noise of covariance
Q = ∫₀¹ exp(Ft) L q Lᵀ exp(Ft)ᵀ dt: Taylor's series over a short step (dQ/dt = FQ + QFᵀ + L q Lᵀ), then doubled by
Q ← Q + A Q Aᵀ, A ← A² as often as needed. Doubled until A is nothing, the same gives the covariance at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, factorial

import numba
import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.tonearm.small_matrices import STATES

ORDER = STATES - 1
"""Poles of the slope: five."""
CORNER_POLES = 2
CUTOFF_POLES = ORDER - CORNER_POLES
SLOPE = 1
"""Where the slope (times Δ) stands in the state."""
BEND_M = 50e-6
"""ℓ, over which a bend is measured."""
TERMS = 32
"""Of the series over a short step: Q of the place begins with the eleventh."""
NOTHING = 1e-20
"""What is smaller has been forgotten."""


@dataclass(frozen=True)
class GroovePrior:
    """What is believed of the groove in one direction.

    Attributes
    ----------
    corner_per_m, cutoff_per_m : float
        λ and μ.
    share : float
        How much the groove bends, standard deviation, for each unit of the *level* by which loud and soft are told
        (`tonearm.level`); about one.
    floor : float
        How much it bends at the least.
    """

    corner_per_m: float
    cutoff_per_m: float
    share: float = 1.0
    floor: float = 0.0

    def bends(self, level: float) -> float:
        """Return how much the groove is believed to bend at a level, a change of slope over `BEND_M`."""
        return max(self.share * level, self.floor)

    def steps(self, step_m: float) -> tuple[FloatArray, FloatArray]:
        """Return A and Q for one step of the grid, shape (6, 6) each, the state in metres and σ = 1."""
        drift, density, _ = self._process(step_m)
        a, q = one_step(drift)
        return a, density * q

    def at_rest(self, step_m: float) -> FloatArray:
        """Return the covariance of slope and its derivatives before anything was seen, shape (5, 5), for σ = 1."""
        return self._process(step_m)[2]

    def bend(self, step_m: float) -> float:
        """Return the standard deviation of (a(s + ℓ) − 2a(s) + a(s − ℓ))/ℓ, ℓ = `BEND_M`, for σ = 1."""
        drift, density, at_rest = self._process(step_m)
        lag = BEND_M / step_m
        a, q = one_step(lag * drift)
        q = density * lag * q
        later = a[0] - 2 * np.eye(STATES)[0]
        now = (later @ a)[1:]
        variance = now @ at_rest @ now + later @ q @ later + q[0, 0]
        return float(np.sqrt(variance) / BEND_M)

    def _process(self, step_m: float) -> tuple[FloatArray, float, FloatArray]:
        """F, density of the noise, and covariance at rest of (u, u′, …, u⁗), in steps and for σ = 1."""
        corner, cutoff = self.corner_per_m * step_m, self.cutoff_per_m * step_m
        # in units in which the poles lie about one, so that nothing is lost between u and u⁗
        unit = (corner**CORNER_POLES * cutoff**CUTOFF_POLES) ** (1 / ORDER)
        moving = np.diag(np.ones(ORDER - 1), 1)
        moving[-1] = _friction(corner / unit, cutoff / unit)
        resting = at_rest(moving)
        power = step_m**2 / resting[0, 0]
        scale = unit ** np.arange(ORDER)
        drift = np.diag(np.ones(ORDER), 1)
        drift[1:, 1:] = unit * moving * np.outer(scale, 1 / scale)
        return drift, float(power * unit * scale[-1] ** 2), power * resting * np.outer(scale, scale)


def start(at_rest: FloatArray, sigma: float, *, place_sigma_m: float) -> FloatArray:
    """Return the covariance, shape (6, 6), of a state of which only the prior is known, at a place that is not."""
    covariance = np.zeros((STATES, STATES))
    covariance[0, 0] = place_sigma_m**2
    covariance[1:, 1:] = sigma**2 * at_rest
    return covariance


def _friction(corner: float, cutoff: float) -> FloatArray:
    """Minus the coefficients of (s + λ)² (s + μ)³ below the highest, lowest first."""
    slow = np.array([comb(CORNER_POLES, i) * corner ** (CORNER_POLES - i) for i in range(CORNER_POLES + 1)])
    fast = np.array([comb(CUTOFF_POLES, i) * cutoff ** (CUTOFF_POLES - i) for i in range(CUTOFF_POLES + 1)])
    return -np.asarray(np.convolve(slow, fast)[:-1], np.float64)


@numba.njit(cache=True, nogil=True)
def _product(a, b, out):  # type: ignore[no-untyped-def]
    size = a.shape[0]
    for i in range(size):
        for j in range(size):
            total = 0.0
            for k in range(size):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@numba.njit(cache=True, nogil=True)
def _series(f, a, q):  # type: ignore[no-untyped-def]
    """Write A and Q over a step that is short enough for the series to converge at once."""
    size = f.shape[0]
    power, change, one = np.eye(size), np.zeros((size, size)), np.empty((size, size))
    a[:] = power
    change[-1, -1] = 1.0
    q[:] = change
    for n in range(1, TERMS):
        _product(f, power, one)
        power[:] = one / n
        a += power
        _product(f, change, one)
        change[:] = (one + one.T) / (n + 1)
        q += change


@numba.njit(cache=True, nogil=True)
def _double(a, q, one, two):  # type: ignore[no-untyped-def]
    _product(a, q, one)
    _product(one, a.T, two)
    q += two
    _product(a, a, one)
    a[:] = one


@numba.njit(cache=True, nogil=True)
def one_step(f):  # type: ignore[no-untyped-def]
    """Return exp(F) and ∫₀¹ exp(Ft) L Lᵀ exp(Ft)ᵀ dt, L being the last unit vector."""
    largest = 0.0
    for i in range(f.shape[0]):
        largest = max(largest, np.sum(np.abs(f[i])))
    halvings = max(0, int(np.ceil(np.log2(largest))))
    share = 0.5**halvings
    a, q, one, two = np.empty_like(f), np.empty_like(f), np.empty_like(f), np.empty_like(f)
    _series(f * share, a, q)
    q *= share
    for _ in range(halvings):
        _double(a, q, one, two)
    return a, q


@numba.njit(cache=True, nogil=True)
def at_rest(f):  # type: ignore[no-untyped-def]
    """Return ∫₀^∞ exp(Ft) L Lᵀ exp(Ft)ᵀ dt of a stable F: the solution of F P + P Fᵀ + L Lᵀ = 0."""
    a, q = one_step(f)
    one, two = np.empty_like(f), np.empty_like(f)
    while np.max(np.abs(a)) > NOTHING:
        _double(a, q, one, two)
    return q


def taylor(fraction: FloatArray) -> FloatArray:
    """Return the rows that take the state to the place a fraction of a step away.

    Parameters
    ----------
    fraction : float64 array, shape (reading,)
        −½ … ½ of a step. What the noise of the process adds over half a step is far below a reading's error.

    Returns
    -------
    float64 array, shape (reading, 6)
    """
    return np.stack([fraction**i / factorial(i) for i in range(STATES)], axis=-1)
