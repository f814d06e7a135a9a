"""How many threads a kernel is given: one for each element of what it writes."""

from __future__ import annotations

BLOCK = 16
"""Threads of a block along each of the two last axes: columns beside each other in memory go to threads beside each other."""


def threads_for(shape: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return blocks and threads a block for an array of one to three axes, the last axis first, as CUDA counts them."""
    extent = shape[::-1]
    threads = tuple(min(n, BLOCK) if axis < 2 else 1 for axis, n in enumerate(extent))
    return tuple(-(-n // t) for n, t in zip(extent, threads, strict=True)), threads
