"""What this machine can do at best, measured in the same run: bytes moved and sums of products a second, on one thread.

Every other figure is judged by its share of these two (S. Williams, A. Waterman and D. Patterson, *Roofline*, 2009).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np

TRIAD_VALUES = 16_000_000
CHAINS = 256
"""Sums that do not wait for each other: enough to fill the pipelines of any processor."""
DEEP = 16
"""Products that each sum takes while it lies in a register."""
SUMS = 5_000


@dataclass(frozen=True)
class Ceilings:
    """What is measured, on one thread.

    Attributes
    ----------
    triad_bytes_s : float
        a = b + s·c over arrays that no cache holds, 12 bytes a value counted.
    fma_s : float
        Single-precision products added to sums, a second.
    """

    triad_bytes_s: float
    fma_s: float


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _triad(a, b, c, s):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        a[i] = b[i] + s * c[i]


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _products(sums, x, y, rounds):  # type: ignore[no-untyped-def]
    for _ in range(rounds):
        for i in range(sums.size):
            total = sums[i]
            for _ in range(DEEP):
                total = total * x + y
            sums[i] = total


def seconds(work: Callable[[], object], *, times: int = 7) -> float:
    """Return the median time of some work after one round to warm up."""
    work()
    spent = []
    for _ in range(times):
        started = time.perf_counter()
        work()
        spent.append(time.perf_counter() - started)
    return float(np.median(spent))


def measured_ceilings() -> Ceilings:
    """Measure both."""
    a, b, c = (np.ones(TRIAD_VALUES, np.float32) for _ in range(3))
    triad = seconds(lambda: _triad(a, b, c, np.float32(0.5)))
    sums = np.ones(CHAINS, np.float32)
    products = seconds(lambda: _products(sums, np.float32(0.999), np.float32(1e-3), SUMS))
    return Ceilings(12.0 * TRIAD_VALUES / triad, float(CHAINS) * DEEP * SUMS / products)
