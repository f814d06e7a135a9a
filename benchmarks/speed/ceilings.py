"""What this machine can do at best, measured in the same run: bytes moved and sums of products a second, on one thread.

Every other figure is judged by its share of these two (S. Williams, A. Waterman and D. Patterson, *Roofline*, 2009).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from llvmlite import ir

from gramoscope.pickup.lane_writer import LANES, LONG, LaneWriter, Value, compiled, function

TRIAD_VALUES = 16_000_000
CHAINS = 12
"""Vectors that do not wait for each other: enough to fill the pipelines, few enough for the registers of any processor."""
SUMS = 1_000_000


@dataclass(frozen=True)
class Ceilings:
    """What is measured, on one thread.

    Attributes
    ----------
    triad_bytes_s : float
        a = b + s·c over arrays that no cache holds, 12 bytes a value counted.
    fma_s : float
        Single-precision products added to sums, a second, in vectors as long as the processor has.
    """

    triad_bytes_s: float
    fma_s: float


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _triad(a, b, c, s):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        a[i] = b[i] + s * c[i]


def _chains(w: LaneWriter) -> None:
    sums, factor, rounds = w.arguments
    rooms = w.sums(CHAINS)
    x = w.spread(factor, ir.Constant(LONG, 0))

    def again(_: Value) -> None:
        for room in rooms:
            w.builder.store(w.times_and(w.builder.load(room), x, x), room)

    w.loop(rounds, again)
    for k, room in enumerate(rooms):
        w.store(w.builder.load(room), sums, ir.Constant(LONG, k * LANES))


@compiled
def _add_products(_, sums, factor, rounds):  # type: ignore[no-untyped-def]
    return function((sums, factor, rounds), _chains, apart="gramoscope_chains")


@numba.njit(cache=True, nogil=True)
def _products(sums, factor, rounds):  # type: ignore[no-untyped-def]
    _add_products(sums, factor, rounds)


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
    sums, factor = np.empty(CHAINS * LANES, np.float32), np.full(1, 0.5, np.float32)
    products = seconds(lambda: _products(sums, factor, SUMS))
    return Ceilings(12.0 * TRIAD_VALUES / triad, float(CHAINS) * LANES * SUMS / products)
