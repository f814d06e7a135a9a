"""How likely readings of a place are, and nothing else: what the learning of a prior asks a thousand times.

The same recursion as `linear_gaussian.forward` for one process and readings of the place alone, over eight stretches abreast
(`tonearm.abreast`). The logarithms of all spreads are that of their product.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.cache_line import at_a_line, double_room
from gramoscope.conventions import FloatArray
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


def abreast(place_m: FloatArray, variance: FloatArray) -> PlaceReadings:
    """Return the readings of stretches, given bin by bin, shape (stretch, bin), NaN where nothing was read.

    Of each stretch something must have been read.
    """
    known = np.isfinite(place_m)
    first, stop = known.argmax(axis=1), known.shape[1] - known[:, ::-1].argmax(axis=1)
    seen = np.zeros((-(-len(place_m) // FILTERS), int((stop - first).max()), 2, FILTERS))
    seen[:, :, VARIANCE] = np.inf
    _lay_abreast(place_m, variance, first, seen)
    return PlaceReadings(at_a_line(seen), len(place_m), int(np.count_nonzero(known)))


@numba.njit(cache=True, nogil=True)
def _lay_abreast(place_m, variance, first, seen):  # type: ignore[no-untyped-def]
    for i in range(len(place_m)):
        for k in range(first[i], place_m.shape[1]):
            if np.isfinite(place_m[i, k]):
                seen[i // FILTERS, k - first[i], VALUE, i % FILTERS] = place_m[i, k]
                seen[i // FILTERS, k - first[i], VARIANCE, i % FILTERS] = variance[i, k]


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
def place_log_likelihood(a, q, at_rest, seen, count, sigma, place_sigma_m, gate):  # type: ignore[no-untyped-def]
    """Return the log-likelihood of readings of one process along stretches that know nothing of each other.

    Parameters
    ----------
    a, q : float64 arrays, shape (n, n)
        x' = A x + w, E[w wᵀ] = σ²Q, from bin to bin, of a `GroovePrior`.
    at_rest : float64 array, shape (n − 1, n − 1)
        Covariance of all but the place at bin 0, for σ = 1; the mean of all is zero.
    seen, count
        Of `PlaceReadings`.
    sigma : float64 array, shape (stretch,)
        σ.
    place_sigma_m : float
        Standard deviation of the place at bin 0.
    gate : float
        A reading further than this many standard deviations from its prediction is rejected, and counts as if it lay there.
    """
    now, later = double_room(ROWS * FILTERS).reshape(ROWS, FILTERS), double_room(ROWS * FILTERS).reshape(ROWS, FILTERS)
    tally = double_room(3 * FILTERS).reshape(3, FILTERS)
    # of ν²/S + log S of all readings
    total = 0.0
    for eight in range(seen.shape[0]):
        _begin(at_rest, place_sigma_m, sigma, eight * FILTERS, _COVARIANCE_ROWS, now, tally)
        readings = seen[eight].reshape(-1, FILTERS)
        for k in range(seen.shape[1]):
            step(gate**2, a, 0, 0, q, 0, 0, now, 0, 0, readings, 2 * k, 0, later, 0, 0, tally, 0, 0)
            now, later = later, now
            if k % AT_ONCE == AT_ONCE - 1 or k == seen.shape[1] - 1:
                for place in range(FILTERS):
                    total += np.log(tally[SPREAD, place])
                    tally[SPREAD, place] = 1.0
        total += tally[DISTANCE].sum()
    return -0.5 * (count * LOG_2PI + total)
