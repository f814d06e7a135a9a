"""How likely readings of a place are, and nothing else: what the learning of a prior asks a thousand times.

The same recursion as `linear_gaussian.forward` for one process and readings of the place alone, over eight stretches abreast
(`tonearm.abreast`). The logarithms of all spreads are that of their product.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.tonearm.abreast import (
    DISTANCE,
    FILTERS,
    LOUDNESS,
    ROWS,
    SPREAD,
    VALUE,
    VARIANCE,
    covariance_row,
    step,
)
from gramoscope.tonearm.small_matrices import STATES

AT_ONCE = 8
"""So many spreads are multiplied before their logarithm is taken; each may be 10⁻³⁷ … 10³⁷."""
LOG_2PI = float(np.log(2 * np.pi))
_COVARIANCE_ROWS = np.array([[covariance_row(i, j) for j in range(STATES)] for i in range(STATES)])


@dataclass(frozen=True, eq=False)
class PlaceReadings:
    """Readings of a place along several stretches, eight of them abreast.

    Attributes
    ----------
    seen : float64 array, shape (eight, bin, 2, `FILTERS`)
        Values and variances, from the first reading of each stretch on; an infinite variance where there is none.
    stretches, count : int
        How many stretches there are, and how many readings.
    """

    seen: FloatArray
    stretches: int
    count: int


def abreast(stretches: Sequence[tuple[IntArray, FloatArray, FloatArray]]) -> PlaceReadings:
    """Return the readings of several stretches, given by their bins, rising from 0 on, values and variances."""
    eights = -(-len(stretches) // FILTERS)
    longest = max(int(bins[-1]) + 1 for bins, _, _ in stretches)
    seen = np.zeros((eights, longest, 2, FILTERS))
    seen[:, :, VARIANCE] = np.inf
    for number, (bins, value, variance) in enumerate(stretches):
        eight, place = divmod(number, FILTERS)
        seen[eight, bins, VALUE, place], seen[eight, bins, VARIANCE, place] = value, variance
    return PlaceReadings(seen, len(stretches), sum(bins.size for bins, _, _ in stretches))


@numba.njit(cache=True, nogil=True)
def _begin(at_rest, place_sigma_m, sigma, first, rows, state, tally):  # type: ignore[no-untyped-def]
    """Write what is known of eight filters before anything was seen; those without a stretch are silent."""
    state[:] = 0.0
    tally[:] = 0.0
    tally[SPREAD] = 1.0
    for place in range(min(FILTERS, sigma.size - first)):
        loudness = sigma[first + place] ** 2
        tally[LOUDNESS, place] = loudness
        state[0, place] = place_sigma_m**2
        for i in range(1, STATES):
            for j in range(1, i + 1):
                state[rows[i, j], place] = loudness * at_rest[i - 1, j - 1]


@numba.njit(cache=True, nogil=True)
def _of_all(a, q, at_rest, place_sigma_m, sigma, seen, width, rows):  # type: ignore[no-untyped-def]
    """Sum of ν²/S + log S over all readings."""
    now, later, tally = np.empty((ROWS, FILTERS)), np.empty((ROWS, FILTERS)), np.empty((3, FILTERS))
    total = 0.0
    for eight in range(seen.shape[0]):
        _begin(at_rest, place_sigma_m, sigma, eight * FILTERS, rows, now, tally)
        readings = seen[eight].reshape(-1, FILTERS)
        for k in range(seen.shape[1]):
            step(width**2, a, 0, 0, q, 0, 0, now, 0, 0, readings, 2 * k, 0, later, 0, 0, tally, 0, 0)
            now, later = later, now
            if k % AT_ONCE == AT_ONCE - 1 or k == seen.shape[1] - 1:
                for place in range(FILTERS):
                    total += np.log(tally[SPREAD, place])
                    tally[SPREAD, place] = 1.0
        total += tally[DISTANCE].sum()
    return total


def place_log_likelihood(
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
        A and Q: x' = A x + w, E[w wᵀ] = σ²Q, from bin to bin, of a `GroovePrior`.
    at_rest : float64 array, shape (n − 1, n − 1)
        Covariance of all but the place at bin 0, for σ = 1; the mean of all is zero.
    readings : PlaceReadings
    sigma : float64 array, shape (stretch,)
        σ.
    place_sigma_m : float
        Standard deviation of the place at bin 0.
    gate : float
        A reading further than this many standard deviations from its prediction is rejected, and counts as if it lay there.
    """
    a, q = steps
    distance = _of_all(a, q, at_rest, place_sigma_m, sigma, readings.seen, gate, _COVARIANCE_ROWS)
    return -0.5 * (readings.count * LOG_2PI + float(distance))
