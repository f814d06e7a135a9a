"""Products of small matrices, for a state of blocks that all have one size."""

from __future__ import annotations

import numba

from gramoscope.tonearm.vector_rows import STATES, add_outer, add_row_times, mirror, multiply, transpose

__all__ = ["STATES", "add_products", "block_sandwich", "block_vector", "dot", "times"]


@numba.njit(cache=True, nogil=True)
def block_sandwich(a, at, x, half, out):  # type: ignore[no-untyped-def]
    """Write A x Aᵀ for symmetric x and a block diagonal A, given as its blocks and as theirs, transposed."""
    for b in range(a.shape[0]):
        row = slice(b * STATES, (b + 1) * STATES)
        for c in range(b + 1):
            column = slice(c * STATES, (c + 1) * STATES)
            here = out[row, column]
            multiply(a[b], x[row, column], half)
            multiply(half, at[c], here)
            if b == c:
                mirror(here)
            else:
                transpose(here, out[column, row])


@numba.njit(cache=True, nogil=True)
def block_vector(at, x, out):  # type: ignore[no-untyped-def]
    """Write A x for a block diagonal A, given as its blocks, transposed."""
    out[:] = 0.0
    for b in range(at.shape[0]):
        row = slice(b * STATES, (b + 1) * STATES)
        add_row_times(x[row], at[b], out[row])


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
    out[:] = 0.0
    for b in range(0, h.size, STATES):
        for c in range(0, h.size, STATES):
            add_row_times(h[b : b + STATES], p[b : b + STATES, c : c + STATES], out[c : c + STATES])
    return dot(h, out)


@numba.njit(cache=True, nogil=True)
def add_products(x, y, p):  # type: ignore[no-untyped-def]
    """Add x yᵀ to p."""
    for b in range(0, x.size, STATES):
        for c in range(0, x.size, STATES):
            add_outer(x[b : b + STATES], y[c : c + STATES], p[b : b + STATES, c : c + STATES])
