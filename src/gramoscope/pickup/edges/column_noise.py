"""How the errors of the pixels of one column go together, and which mean of the pixels tells the place of an edge best.

Land and wall are brighter in one column than in the next, more or less so towards the edge; grain is wider than a pixel.
So what pixels are off the profile by has a covariance Σ across the edge. Of all means of them that answer 1 to the gradient
g the one with the least error has the shares

    a = Σ⁻¹ g / g'Σ⁻¹ g

(generalised least squares; Aitken). A brighter wall, which a plain mean takes for an edge that has moved, is then seen as a
brighter wall. While the course does not follow the edge yet, Σ is put together from what is seen away from the edge
(`patchy_covariance`): what is seen at the edge would be its own wanderings. When it does, Σ is that of all pixels
(`seen_covariance`): wanderings that are left are a multiple of g g' in it, which leaves the shares as they are (Sherman and
Morrison).

Everything is in units of the noise of each pixel.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy.linalg import toeplitz
from scipy.special import ndtr

from gramoscope.conventions import BoolArray, FloatArray

MOST_NOISES = 4.0
"""A pixel that differs by more noises than this counts as if it were this one."""
SHRUNK = 0.1
"""Share of the covariance between pixels that is not believed: it was learned from some hundred columns."""
LEAST_EIGENVALUE = 0.02
"""Of the covariance, in shares of the variance of a pixel."""
LEAST_LIKENESS = 0.1


def filtered_beside(covariance: FloatArray, kept: BoolArray, gradient: FloatArray, pattern: FloatArray) -> FloatArray:
    """Return (Σ + p p')⁻¹ g of each column, p being a pattern of its own that may be in it or not (Sherman and Morrison).

    Parameters
    ----------
    covariance : float64 array, shape (place, place)
    kept : bool array, shape (column, place)
    gradient, pattern : float64 arrays, shape (column, place)
    """
    found = filtered(covariance, kept, gradient)
    some = pattern.any(axis=1)
    if some.any():
        mine, other = pattern[some], filtered(covariance, kept[some], pattern[some])
        part = (mine * found[some]).sum(axis=1) / (1 + (mine * other).sum(axis=1))
        found[some] -= part[:, None] * other
    return found


def filtered(covariance: FloatArray, kept: BoolArray, gradient: FloatArray) -> FloatArray:
    """Return Σ⁻¹ g of each column, by the pixels that are kept; 0 at others.

    Parameters
    ----------
    covariance : float64 array, shape (place, place)
    kept : bool array, shape (column, place)
    gradient : float64 array, shape (column, place)
    """
    found = np.where(kept, gradient, 0.0)
    if np.array_equal(covariance, np.eye(covariance.shape[0])):
        return found
    inverse = np.linalg.inv(covariance)
    found = np.asarray(found @ inverse, np.float64)
    leave_out(inverse, kept, found)
    return found


@numba.njit(cache=True, nogil=True)
def leave_out(inverse, kept, found):  # type: ignore[no-untyped-def]
    """Make Σ⁻¹ g, by all pixels, what it is by those that are kept, in place.

    With P = Σ⁻¹, y = P g, where g is 0 at d, the pixels that are left out: the others have y − P_·d (P_dd)⁻¹ y_d. `inverse` is
    P, symmetric, shape (place, place); `kept` and `found` have the shape (column, place).
    """
    columns, places = found.shape
    out = np.empty(places, np.int64)
    factor = np.empty((places, places))
    for c in range(columns):
        count = 0
        for i in range(places):
            if not kept[c, i]:
                out[count] = i
                count += 1
        if count == places:
            found[c] = 0.0
            continue
        # Cholesky's factor, and both triangles solved; y_d becomes the solution
        for i in range(count):
            for j in range(i + 1):
                total = inverse[out[i], out[j]]
                for k in range(j):
                    total -= factor[i, k] * factor[j, k]
                factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
            total = found[c, out[i]]
            for k in range(i):
                total -= factor[i, k] * found[c, out[k]]
            found[c, out[i]] = total / factor[i, i]
        for i in range(count - 1, -1, -1):
            total = found[c, out[i]]
            for k in range(i + 1, count):
                total -= factor[k, i] * found[c, out[k]]
            found[c, out[i]] = total / factor[i, i]
        for k in range(count):
            share = found[c, out[k]]
            for i in range(places):
                if kept[c, i]:
                    found[c, i] -= inverse[i, out[k]] * share
        for k in range(count):
            found[c, out[k]] = 0.0


def seen_covariance(rest: FloatArray, kept: BoolArray) -> FloatArray:
    """Return Σ as pixels show it, a little less of it off the diagonal.

    Parameters
    ----------
    rest : float64 array, shape (column, place)
        By how much pixels differ from the profile, in units of their noise.
    kept : bool array, shape (column, place)
    """
    raw = _raw_covariance(rest, kept)
    strength = np.sqrt(np.maximum(np.diag(raw), LEAST_EIGENVALUE))
    alike = (1 - SHRUNK) * raw / np.outer(strength, strength)
    np.fill_diagonal(alike, 1.0)
    value, vector = np.linalg.eigh(alike)
    return np.asarray((vector * np.maximum(value, LEAST_EIGENVALUE)) @ vector.T * np.outer(strength, strength))


def patchy_covariance(rest: FloatArray, kept: BoolArray, patterns: FloatArray, away: BoolArray) -> FloatArray:
    """Return Σ put together: pixels with errors of their own, and patterns that come and go.

    Parameters
    ----------
    rest : float64 array, shape (column, place)
    kept : bool array, shape (column, place)
    patterns : float64 array, shape (place, pattern)
        What may come and go, in units of the noise; see `patch_patterns`.
    away : bool array, shape (place,)
        Places away from the edge, from which is learned how strongly patterns come and go.
    """
    raw = _raw_covariance(rest, kept)[np.ix_(away, away)]
    fit = np.linalg.pinv(patterns[away])
    free = np.eye(raw.shape[0]) - patterns[away] @ fit
    left = free @ raw @ free.T
    own = toeplitz(_along_diagonals(left) * raw.shape[0] / max(raw.shape[0] - patterns.shape[1], 1))
    value, vector = np.linalg.eigh(fit @ (raw - own) @ fit.T)
    strength = (vector * np.maximum(value, 0.0)) @ vector.T
    return np.asarray(np.eye(patterns.shape[0]) + patterns @ strength @ patterns.T)


def patch_patterns(from_edge_px: FloatArray, soft_px: float) -> FloatArray:
    """Return what comes and goes at the places of a column: the land, the wall, and the wall towards the edge."""
    land = ndtr(from_edge_px / soft_px)
    half_px = max(float(np.abs(from_edge_px).max()), 1.0)
    return np.stack([land, 1 - land, (1 - land) * from_edge_px / half_px], axis=1)


def _raw_covariance(rest: FloatArray, kept: BoolArray) -> FloatArray:
    clipped = np.where(kept, np.clip(rest, -MOST_NOISES, MOST_NOISES), 0.0)
    count = kept.astype(np.float64)
    return np.asarray((clipped.T @ clipped) / np.maximum(count.T @ count, 1.0))


def _along_diagonals(matrix: FloatArray) -> FloatArray:
    """Means along the diagonals, from the main one on, to the first that is hardly anything."""
    mean = np.array([np.diag(matrix, lag).mean() for lag in range(matrix.shape[0])])
    small = np.flatnonzero(mean < LEAST_LIKENESS * mean[0])
    mean[small[0] if small.size else mean.size :] = 0.0
    return mean
