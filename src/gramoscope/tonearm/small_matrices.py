"""Products of small matrices, for a state of blocks that all have one size."""

from __future__ import annotations

import numba

STATES = 8
"""Size of a block. Known to the compiler, it makes these products three times as fast."""


@numba.njit(cache=True, nogil=True)
def _sandwich_one(a, c, x, row, column, half, out):  # type: ignore[no-untyped-def]
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += a[i, k] * x[row + k, column + j]
            half[i, j] = total
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += half[i, k] * c[j, k]
            out[row + i, column + j] = total
            out[column + j, row + i] = total


@numba.njit(cache=True, nogil=True)
def block_sandwich(a, x, half, out):  # type: ignore[no-untyped-def]
    """Write A x Aᵀ for symmetric x and a block diagonal A."""
    for b in range(a.shape[0]):
        for c in range(b + 1):
            _sandwich_one(a[b], a[c], x, b * STATES, c * STATES, half, out)


@numba.njit(cache=True, nogil=True)
def block_vector(a, x, out):  # type: ignore[no-untyped-def]
    """Write A x for a block diagonal A, given as its blocks."""
    for b in range(a.shape[0]):
        for i in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += a[b, i, k] * x[b * STATES + k]
            out[b * STATES + i] = total


@numba.njit(cache=True, nogil=True)
def dot(x, y):  # type: ignore[no-untyped-def]
    """Return x·y."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@numba.njit(cache=True, nogil=True)
def times(p, h, out):  # type: ignore[no-untyped-def]
    """Write p h for symmetric p and return hᵀ p h."""
    size = h.size
    for i in range(size):
        out[i] = 0.0
    for k in range(size):
        w = h[k]
        for i in range(size):
            out[i] += w * p[k, i]
    return dot(h, out)
