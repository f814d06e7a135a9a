"""How likely regular readings of a place are, and nothing else: what the learning of a prior asks a thousand times.

The same recursion as `linear_gaussian.forward` for one process and readings of the place alone, kept short by what it comes to:
where readings follow each other bin by bin with one and the same variance the covariance settles within a few dozen of them,
and from there on only the mean has to be carried along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.tonearm.small_matrices import STATES, add_products, block_sandwich, block_vector

SETTLED = 4e-6
"""Relative change of the spread of a reading from bin to bin that counts as none, and the square of that of the gain."""
CALM = 6
"""So many times one after the other, for on its way it swings."""
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class PlaceReadings:
    """Readings of a place along several stretches, one after the other.

    Attributes
    ----------
    begin : int64 array, shape (stretch + 1,)
        Where each begins; the last entry is where the last one ends.
    bin : int64 array, shape (reading,)
        Rising within each stretch, from 0 on.
    value, variance : float64 arrays, shape (reading,)
    """

    begin: IntArray
    bin: IntArray
    value: FloatArray
    variance: FloatArray


def one_after_the_other(stretches: Sequence[tuple[IntArray, FloatArray, FloatArray]]) -> PlaceReadings:
    """Return the bins, values and variances of several stretches as one."""
    begin = np.cumsum([0, *(bins.size for bins, _, _ in stretches)])
    bins, value, variance = (np.concatenate(parts) for parts in zip(*stretches, strict=True))
    return PlaceReadings(begin, bins, value, variance)


@numba.njit(cache=True, nogil=True)
def _of_one(a, at, q, p, bin_, value, variance, width):  # type: ignore[no-untyped-def]
    m, m_next, gain, less = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    p_next, half = np.empty_like(p), np.empty_like(p)
    total, spread, log_spread, settled, calm = 0.0, 1.0, 0.0, False, 0
    for k in range(bin_.size):
        usual = k > 0 and bin_[k] == bin_[k - 1] + 1 and variance[k] == variance[k - 1]
        settled = settled and usual
        if not settled:
            spread_before, spread = spread, p[0, 0] + variance[k]
            log_spread = np.log(spread)
            still = usual and abs(spread - spread_before) <= SETTLED * spread
            for i in range(STATES):
                before, gain[i] = gain[i], p[0, i] / spread
                still = still and (gain[i] - before) ** 2 <= SETTLED * gain[i] ** 2
            calm = calm + 1 if still else 0
            settled = calm >= CALM
        nu = value[k] - m[0]
        used = nu * nu <= width * width * spread
        total -= 0.5 * (LOG_2PI + log_spread + (nu * nu / spread if used else width * width))
        if used:
            for i in range(STATES):
                m[i] += gain[i] * nu
        if k + 1 == bin_.size:
            break
        if settled and used and bin_[k + 1] == bin_[k] + 1:
            block_vector(at, 0, m, m_next)
            m, m_next = m_next, m
        else:
            # a rejected reading leaves more doubt than is usual
            settled, calm = False, calm if used else 0
            if used:
                for i in range(STATES):
                    less[i] = -gain[i] * spread
                add_products(less, 0, gain, 0, p)
            for _ in range(bin_[k + 1] - bin_[k]):
                block_vector(at, 0, m, m_next)
                block_sandwich(a, at, 0, p, half, p_next)
                m, m_next = m_next, m
                p, p_next = p_next, p
                for i in range(STATES):
                    for j in range(STATES):
                        p[i, j] += q[i, j]
    return total


@numba.njit(cache=True, nogil=True)
def _of_all(a, at, q, at_rest, place_sigma_m, sigma, begin, bin_, value, variance, width):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(sigma.size):
        here = slice(begin[i], begin[i + 1])
        p = np.zeros((STATES, STATES))
        p[0, 0] = place_sigma_m**2
        p[1:, 1:] = sigma[i] ** 2 * at_rest
        total += _of_one(a, at, sigma[i] ** 2 * q, p, bin_[here], value[here], variance[here], width)
    return total


def steady_log_likelihood(
    steps: tuple[FloatArray, FloatArray],
    at_rest: FloatArray,
    readings: PlaceReadings,
    sigma: FloatArray,
    *,
    place_sigma_m: float,
    gate: float,
) -> float:
    """Return the log-likelihood of readings of one process along stretches that know nothing of each other.

    Parameters
    ----------
    steps : float64 arrays, shape (n, n)
        A and Q: x' = A x + w, E[w wᵀ] = σ²Q, from bin to bin, the place being the first part of x.
    at_rest : float64 array, shape (n − 1, n − 1)
        Covariance of the others at bin 0, for σ = 1; the mean of all is zero.
    readings : PlaceReadings
    sigma : float64 array, shape (stretch,)
        σ.
    place_sigma_m : float
        Standard deviation of the place at bin 0.
    gate : float
        A reading further than this many standard deviations from its prediction is rejected, and counts as if it lay there.
    """
    a, q = steps
    return float(
        _of_all(
            a, np.ascontiguousarray(a.T), q, at_rest, place_sigma_m, sigma, readings.begin, readings.bin,
            readings.value, readings.variance, gate,
        )
    )  # fmt: skip
