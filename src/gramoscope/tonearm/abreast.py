"""Eight Kalman filters abreast: one process along eight stretches, each stretch in its own place of a processor's vector.

One bin of one filter is hardly more than a hundred multiplications that wait for each other; of eight that move alike, each
is one instruction. What differs among them is the loudness, and what was read. A reading y of the place with variance V moves
the state's mean m and covariance P to m + pν/S and P − ppᵀ/S, with p the first column of P, ν = y − m₀ and S = P₀₀ + V; so on
the next bin

    m ← A m + A p ν/S,      P ← A P Aᵀ − A p (A p)ᵀ/S + σ²Q.

Rows of arrays hold one number of each filter: those of the covariance on and below its diagonal row by row, then those of the
mean. A is taken to be that of `tonearm.groove_prior`: the body and what is wide move by themselves.
"""

from __future__ import annotations

from typing import Any

from numba import types

from gramoscope.tonearm.vector_rows import PARTS, STATES, Value, Writer, compiled, function

FILTERS = STATES
"""As many as states, so that both fill a row."""
MOVED_BY = (range(STATES), *[part for part in PARTS for _ in part])
MOVED_BACK_BY = tuple(tuple(k for k in range(STATES) if i in MOVED_BY[k]) for i in range(STATES))
"""On which states each depends a step later, and by Aᵀ."""
MEAN = STATES * (STATES + 1) // 2
"""First row of the mean."""
ROWS = MEAN + STATES
VALUE, VARIANCE = range(2)
"""Rows of readings; where nothing was read the variance is infinite."""
LOUDNESS, SPREAD, DISTANCE = range(3)
"""Rows of a tally: σ², the product of all S, and the sum of all ν²/S."""


def covariance_row(i: int, j: int) -> int:
    """Return the row that holds an element of the covariance."""
    return max(i, j) * (max(i, j) + 1) // 2 + min(i, j)


def _observed(write: Writer) -> tuple[Value, Value]:
    """Tally the readings; return 1/S, or 0 where a reading is not used, and ν."""
    build, a_one, nothing = write.builder, write.number(1.0), write.number(0.0)
    gate = write.everywhere(write.numbers[0])
    spread = build.fadd(write.load(2), write.load(3, VARIANCE))
    away = build.fsub(write.load(3, VALUE), write.load(2, MEAN))
    precision = build.fdiv(a_one, spread)
    distance = build.fmul(build.fmul(away, away), precision)
    read, wild = write.less(nothing, precision), write.less(gate, distance)
    write.store(build.fmul(write.load(5, SPREAD), build.select(read, spread, a_one)), 5, SPREAD)
    write.store(build.fadd(write.load(5, DISTANCE), build.select(wild, gate, distance)), 5, DISTANCE)
    return build.select(wild, nothing, precision), away


def weighted(
    write: Writer,
    i: int,
    values: Any,
    total: Value | None = None,
    *,
    matrix: int = 0,
    first: int = 0,
    back: bool = False,
) -> Value:
    """The i-th row of A, or of Aᵀ, times values, and more; A is an array from a first row on."""
    for k in (MOVED_BACK_BY if back else MOVED_BY)[i]:
        factor = write.spread(matrix, first + k, i) if back else write.spread(matrix, first + i, k)
        total = write.builder.fmul(factor, values[k]) if total is None else write.times_and(factor, values[k], total)
    return total


def _step(write: Writer) -> None:
    build = write.builder
    precision, away = _observed(write)
    loudness = write.load(5, LOUDNESS)
    shift = build.fmul(precision, away)
    means = [write.load(2, MEAN + k) for k in range(STATES)]
    columns: list[Value] = []
    for i in range(STATES):
        moved = []
        for j in range(STATES):
            moved.append(weighted(write, i, {k: write.load(2, covariance_row(k, j)) for k in MOVED_BY[i]}))
        columns.append(moved[0])
        write.store(write.times_and(moved[0], shift, weighted(write, i, means)), 4, MEAN + i)
        less = build.fneg(build.fmul(moved[0], precision))
        for j in range(i + 1):
            noise = build.fmul(loudness, write.spread(1, i, j))
            write.store(weighted(write, j, moved, write.times_and(less, columns[j], noise)), 4, covariance_row(i, j))


@compiled
def step(_, gate, a, a_row, a_column, q, q_row, q_column, before, before_row, before_column, seen, seen_row, seen_column, after, after_row, after_column, tally, tally_row, tally_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Tally the readings of a bin and write the states at the next; the gate is a square."""
    rows = (
        a, a_row, a_column, q, q_row, q_column, before, before_row, before_column, seen, seen_row, seen_column,
        after, after_row, after_column, tally, tally_row, tally_column,
    )  # fmt: skip
    return function(types.void, (gate, *rows), _step)
