"""How alike the noise of neighbouring pixels is."""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray

LAGS = 6
"""Pixels so many rows or columns apart have independent noise."""


def likeness(rest: FloatArray, lags: int = LAGS) -> FloatArray:
    """Return how noise correlates with itself 0 … `lags` − 1 further along the first axis; it is 0 where unknown.

    From `LAGS` on it is none.
    """
    known = rest != 0
    power = float((rest**2).sum()) / max(int(known.sum()), 1)
    found = np.zeros(lags)
    found[0] = 1.0
    for lag in range(1, min(LAGS, lags, rest.shape[0])):
        pairs = int((known[lag:] & known[:-lag]).sum())
        if pairs == 0 or power == 0:
            break
        rho = float((rest[lag:] * rest[:-lag]).sum()) / pairs / power
        # likeness that is no more than chance is none, and what follows it neither
        if rho < 2 / np.sqrt(pairs):
            break
        found[lag] = rho
    return found


def shared_pixels(rest: FloatArray) -> float:
    """Return how many pixels share one error, by their likeness along both axes; see `likeness`."""
    return float(np.prod([1 + 2 * likeness(along)[1:].sum() for along in (rest, rest.T)]))
