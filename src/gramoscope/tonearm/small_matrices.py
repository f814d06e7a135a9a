"""Products of small matrices, for a state of blocks that all have one size.

Vectors are rows of arrays, given by their number (see `tonearm.vector_rows`). Block diagonal matrices are given as their blocks
one below the other, from a row on.
"""

from __future__ import annotations

import numba

from gramoscope.tonearm.vector_rows import (
    STATES,
    add_multiple,
    add_outer,
    add_row_times,
    inner,
    multiple,
    quadratic_form,
    sandwich,
    sandwich_across,
)

__all__ = ["STATES", "add_products", "add_scaled", "block_sandwich", "block_vector", "dot", "scaled", "times"]


@numba.njit(cache=True, nogil=True)
def block_sandwich(a, first, x, out):  # type: ignore[no-untyped-def]
    """Write A x Aᵀ for symmetric x and a block diagonal A of transitions, or of their transposes."""
    for b in range(0, x.shape[0], STATES):
        sandwich(a, first + b, 0, x, b, b, out, b, b)
        for c in range(0, b, STATES):
            sandwich_across(a, first + b, 0, a, first + c, 0, x, b, c, out, b, c, out, c, b)


@numba.njit(cache=True, nogil=True)
def block_vector(at, first, x, out):  # type: ignore[no-untyped-def]
    """Write A x for a block diagonal A whose transpose is given, and vectors that are arrays by themselves."""
    for i in range(x.size):
        out[i] = 0.0
    for b in range(0, x.size, STATES):
        add_row_times(x, 0, b, at, first + b, 0, out, 0, b)


@numba.njit(cache=True, nogil=True)
def dot(x, i, y, j, size):  # type: ignore[no-untyped-def]
    """Return x·y."""
    total = 0.0
    for b in range(0, size, STATES):
        total += inner(x, i, b, y, j, b)
    return total


@numba.njit(cache=True, nogil=True)
def times(p, h, j, out):  # type: ignore[no-untyped-def]
    """Write p h for symmetric p and return hᵀ p h."""
    if out.size == 2 * STATES:
        return quadratic_form(h, j, 0, p, 0, 0, out, 0, 0)
    for i in range(out.size):
        out[i] = 0.0
    for b in range(0, out.size, STATES):
        for c in range(0, out.size, STATES):
            add_row_times(h, j, b, p, b, c, out, 0, c)
    return dot(h, j, out, 0, out.size)


@numba.njit(cache=True, nogil=True)
def add_products(x, i, y, j, p):  # type: ignore[no-untyped-def]
    """Add x yᵀ to p."""
    for b in range(0, p.shape[0], STATES):
        for c in range(0, p.shape[0], STATES):
            add_outer(x, i, b, y, j, c, p, b, c)


@numba.njit(cache=True, nogil=True)
def scaled(c, x, i, out, j, size):  # type: ignore[no-untyped-def]
    """Write c x."""
    for b in range(0, size, STATES):
        multiple(c, x, i, b, out, j, b)


@numba.njit(cache=True, nogil=True)
def add_scaled(c, x, i, out, j, size):  # type: ignore[no-untyped-def]
    """Add c x to a vector."""
    for b in range(0, size, STATES):
        add_multiple(c, x, i, b, out, j, b)
