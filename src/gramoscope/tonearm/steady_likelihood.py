"""How likely regular readings of a place are, and nothing else: what the learning of a prior asks a thousand times.

The same recursion as `linear_gaussian.forward` for one process and readings of the place alone, kept short by what it comes to:
where readings follow each other bin by bin with one and the same variance the covariance settles within a few dozen of them,
and from there on only the mean has to be carried along.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.tonearm.small_matrices import block_sandwich, block_vector, dot, times

SETTLED = 4e-6
"""Relative change of the spread of a reading from bin to bin that counts as none, and the square of that of the gain."""
CALM = 6
"""So many times one after the other, for on its way it swings."""
LOG_2PI = float(np.log(2 * np.pi))


@numba.njit(cache=True, nogil=True)
def _log_likelihood(a, at, q, covariance, bin_, value, variance, h, width):  # type: ignore[no-untyped-def]
    states = h.size
    m, m_next, gain, gain_before = np.zeros(states), np.zeros(states), np.zeros(states), np.zeros(states)
    p, p_next, half = covariance.copy(), np.empty_like(covariance), np.empty((a.shape[1], a.shape[1]))
    total, spread, settled, calm = 0.0, 1.0, False, 0
    for k in range(bin_.size):
        usual = k > 0 and bin_[k] == bin_[k - 1] + 1 and variance[k] == variance[k - 1]
        settled = settled and usual
        if not settled:
            gain_before[:], spread_before = gain, spread
            spread = times(p, h, gain) + variance[k]
            for i in range(states):
                gain[i] /= spread
            still = usual and abs(spread - spread_before) <= SETTLED * spread
            for i in range(states):
                still = still and (gain[i] - gain_before[i]) ** 2 <= SETTLED * gain[i] ** 2
            calm = calm + 1 if still else 0
            settled = calm >= CALM
        nu = value[k] - dot(h, m)
        used = nu * nu <= width * width * spread
        total -= 0.5 * (LOG_2PI + np.log(spread) + (nu * nu / spread if used else width * width))
        if used:
            for i in range(states):
                m[i] += gain[i] * nu
        if k + 1 == bin_.size:
            break
        if settled and used and bin_[k + 1] == bin_[k] + 1:
            block_vector(at, m, m_next)
            m[:] = m_next
        else:
            # a rejected reading leaves more doubt than is usual
            settled, calm = False, calm if used else 0
            if used:
                for i in range(states):
                    for j in range(states):
                        p[i, j] -= gain[i] * spread * gain[j]
            for _ in range(bin_[k + 1] - bin_[k]):
                block_vector(at, m, m_next)
                block_sandwich(a, at, p, half, p_next)
                m[:], p[:] = m_next, p_next + q
    return total


def steady_log_likelihood(
    a: FloatArray,
    q: FloatArray,
    covariance: FloatArray,
    bin_: IntArray,
    value: FloatArray,
    variance: FloatArray,
    h: FloatArray,
    *,
    gate: float,
) -> float:
    """Return the log-likelihood of readings of one process.

    Parameters
    ----------
    a, q : float64 arrays, shape (n, n)
        x' = A x + w, E[w wᵀ] = Q, from bin to bin.
    covariance : float64 array, shape (n, n)
        At bin 0, of a mean of zero.
    bin_ : int array, shape (reading,)
        Rising, from 0 on.
    value, variance : float64 arrays, shape (reading,)
    h : float64 array, shape (n,)
        What is read of the state.
    gate : float
        A reading further than this many standard deviations from its prediction is rejected, and counts as if it lay there.
    """
    return float(
        _log_likelihood(a[None], np.ascontiguousarray(a.T)[None], q, covariance, bin_, value, variance, h, gate)
    )
