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
Q ← Q + A Q Aᵀ, A ← A² as often as needed. Doubled until A is nothing, the same gives the covariance at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numba
import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.tonearm.small_matrices import STATES

CORNER_POLES, CUTOFF_POLES, WIDE_POLES = 2, 2, 3
ORDER = CORNER_POLES + CUTOFF_POLES
"""Poles of u."""
BODY, WIDE = 1, 1 + ORDER
"""Where u and v (times Δ) stand in the state."""
assert STATES == 1 + ORDER + WIDE_POLES
SLOPE = np.zeros(STATES)
"""The slope (times Δ) is this row times the state."""
SLOPE[[BODY, WIDE]] = 1.0
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

    def bends(self, level: float) -> float:
        """Return how much the groove is believed to bend at a level, a change of slope over `BEND_M`."""
        return max(self.share * level, self.floor)

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
        drift, noise, _ = self._process(step_m)
        a, q = one_step(drift, noise)
        return a, q

    def at_rest(self, step_m: float) -> FloatArray:
        """Return the covariance of all but the place before anything was seen, shape (7, 7), for var u = 1."""
        return self._process(step_m)[2]

    def bend(self, step_m: float) -> float:
        """Return the standard deviation of (a(s + ℓ) − 2a(s) + a(s − ℓ))/ℓ, ℓ = `BEND_M`, for var u = 1."""
        drift, noise, at_rest = self._process(step_m)
        lag = BEND_M / step_m
        a, q = one_step(lag * drift, lag * noise)
        later = a[0] - 2 * np.eye(STATES)[0]
        now = (later @ a)[1:]
        variance = now @ at_rest @ now + later @ q @ later + q[0, 0]
        return float(np.sqrt(variance) / BEND_M)

    def _process(self, step_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """F, density of the noise, and covariance at rest of (u, …, u‴, v, v′, v″), in steps and for var u = 1."""
        drift, noise, resting = (np.zeros((size, size)) for size in (STATES, STATES, STATES - 1))
        drift[0] = SLOPE
        corner, cutoff, width = (k * step_m for k in (self.corner_per_m, self.cutoff_per_m, self.width_per_m))
        parts = (
            (BODY, [corner] * CORNER_POLES + [cutoff] * CUTOFF_POLES, 1.0),
            (WIDE, [width] * WIDE_POLES, self.wide_share**2),
        )
        for first, poles, power in parts:
            moving, density, rest = _coloured(np.array(poles))
            part, without_place = slice(first, first + len(poles)), slice(first - 1, first - 1 + len(poles))
            drift[part, part], resting[without_place, without_place] = moving, power * rest
            noise[part.stop - 1, part.stop - 1] = power * density
        return drift, step_m**2 * noise, step_m**2 * resting


def _coloured(poles: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """F, density of the noise and covariance at rest of (u, u′, …), white noise behind so many poles, for var u = 1."""
    # in units in which the poles lie about one, so that nothing is lost between the first and the last
    order, unit = poles.size, float(np.exp(np.log(poles).mean()))
    moving = np.diag(np.ones(order - 1), 1)
    moving[-1] = -np.poly(-poles / unit)[:0:-1]
    last = np.zeros((order, order))
    last[-1, -1] = 1.0
    resting = at_rest(moving, last)
    scale = unit ** np.arange(order)
    power = 1 / resting[0, 0]
    return (
        unit * moving * np.outer(scale, 1 / scale),
        float(power * unit * scale[-1] ** 2),
        power * resting * np.outer(scale, scale),
    )


def start(at_rest: FloatArray, sigma: float, *, place_sigma_m: float) -> FloatArray:
    """Return the covariance, shape (8, 8), of a state of which only the prior is known, at a place that is not."""
    covariance = np.zeros((STATES, STATES))
    covariance[0, 0] = place_sigma_m**2
    covariance[1:, 1:] = sigma**2 * at_rest
    return covariance


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
def _series(f, noise, a, q):  # type: ignore[no-untyped-def]
    """Write A and Q over a step that is short enough for the series to converge at once."""
    size = f.shape[0]
    power, change, one = np.eye(size), noise.copy(), np.empty((size, size))
    a[:] = power
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
def one_step(f, noise):  # type: ignore[no-untyped-def]
    """Return exp(F) and ∫₀¹ exp(Ft) W exp(Ft)ᵀ dt, W being the density of the noise."""
    largest = 0.0
    for i in range(f.shape[0]):
        largest = max(largest, np.sum(np.abs(f[i])))
    halvings = max(0, int(np.ceil(np.log2(largest))))
    share = 0.5**halvings
    a, q, one, two = np.empty_like(f), np.empty_like(f), np.empty_like(f), np.empty_like(f)
    _series(f * share, noise * share, a, q)
    for _ in range(halvings):
        _double(a, q, one, two)
    return a, q


@numba.njit(cache=True, nogil=True)
def at_rest(f, noise):  # type: ignore[no-untyped-def]
    """Return ∫₀^∞ exp(Ft) W exp(Ft)ᵀ dt of a stable F: the solution of F P + P Fᵀ + W = 0."""
    a, q = one_step(f, noise)
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
    float64 array, shape (reading, 8)
        Of u four terms of the series count, of v three.
    """
    powers = [fraction**i / factorial(i) for i in range(WIDE + 1)]
    return np.stack([*powers[:WIDE], *powers[1 : 1 + WIDE_POLES]], axis=-1)
