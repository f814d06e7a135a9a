"""Eight Kalman filters of both directions abreast, read by both walls: what they do at a bin, and backwards.

As in `tonearm.abreast` each stretch has its own place in a processor's vector, and what differs among stretches are places of
the grid, loudness and readings. The covariance P is three blocks of 8 × 8 in rows: lateral with itself, vertical with lateral,
vertical with itself. Samples of a stretch lie all the same fraction of a step beside their bins: with t the row of Taylor's
series for it, a wall whose gain is g reads h = (t, g t). With P t of all four blocks both walls know what they see. The
second wall is judged by what the first has left: by ν₂ − s₁₂ν₁/S₁ and P h₂ − K₁ s₁₂, s₁₂ = h₁ᵀP h₂. Both are taken off P as the
blocks are moved to the next bin; and so goes the smoother of `tonearm.bryson_frazier` back, with Aᵀ in place of A and

    N ← Aᵀ (N + Σ (h xᵀ + x hᵀ)) A,     x = ½ D h − N K.

Rows of arrays hold one number of each filter.
"""

from __future__ import annotations

from collections.abc import Sequence

from llvmlite import ir
from numba import types

from gramoscope.tonearm.abreast import weighted
from gramoscope.tonearm.vector_rows import STATES, Value, Writer, compiled, function

WALLS = 2
BLOCK = STATES * STATES
"""Rows of a block."""
SQUARES = 0, 2 * BLOCK
ACROSS = BLOCK
"""First rows of the blocks: of each direction with itself, and of the vertical with the lateral one."""
BOTH = 2 * STATES
"""Rows of a vector of both directions."""
VALUE, VARIANCE, GATE_VARIANCE, ALLOWED = (WALLS * i for i in range(4))
"""First rows of readings, one for each wall; nothing is read where the variance is infinite. Allowed is 1 or 0."""
READINGS = 4 * WALLS
GAIN, SCORE, PRECISION, AWAY, EXPECTED = 0, *(WALLS * (BOTH + i) for i in range(4))
"""First rows of what is kept of a bin: K of a used reading, Ph of another, P being that before any reading of the bin; ν/S and
1/S, or 0; how far the reading is from its prediction before any reading of the bin, and hᵀPh."""
KEPT = EXPECTED + WALLS
MISSED, MOST_MISSED = 0, WALLS
"""Rows of a tally: how many more readings of each wall were rejected than used, as `linear_gaussian` counts; and the most of
both ever at the beginning of a bin."""
TALLY = MOST_MISSED + 1
STATE, MEAN = 0, 3 * BLOCK
TAYLOR = MEAN + BOTH
GAINS = TAYLOR + STATES
PRODUCTS = GAINS + WALLS
CHANGES = PRODUCTS + 2 * BOTH
TALLIES = CHANGES + 4 * BOTH
LOUDNESS = TALLIES + TALLY
ROOM = LOUDNESS + 4
"""Of the room in which filters work: P or N, m or r, t, the gains, products with P or N, p, q, r, s of what changes them,
tallies, σ² of both directions, and σ² times agitation."""


class _Numbers:
    """Arithmetic of rows, in short."""

    def __init__(self, write: Writer) -> None:
        self.write, self.build = write, write.builder
        self.none, self.one = write.number(0.0), write.number(1.0)

    def plus(self, *values: Value) -> Value:
        total = values[0]
        for value in values[1:]:
            total = self.build.fadd(total, value)
        return total

    def minus(self, one: Value, other: Value) -> Value:
        return self.build.fsub(one, other)

    def times(self, one: Value, other: Value) -> Value:
        return self.build.fmul(one, other)

    def over(self, one: Value, other: Value) -> Value:
        return self.build.fdiv(one, other)

    def larger(self, one: Value, other: Value) -> Value:
        return self.build.select(self.write.less(one, other), other, one)

    def where(self, told: Value, one: Value, other: Value) -> Value:
        return self.build.select(told, one, other)

    def root(self, value: Value) -> Value:
        kind = ir.FunctionType(value.type, [value.type])
        return self.build.call(self.build.module.declare_intrinsic(f"llvm.sqrt.v{STATES}f64", fnty=kind), [value])

    def product(self, one: Sequence[Value], other: Sequence[Value]) -> Value:
        """The inner product of two vectors, as two sums."""
        sums = [self.times(one[k], other[k]) for k in range(2)]
        for k in range(2, len(one)):
            sums[k % 2] = self.write.times_and(one[k], other[k], sums[k % 2])
        return self.plus(*sums)


def _carried(write: Writer, *, back: bool, square: bool) -> None:
    """Arrays: the transition, a second one if not of a square, X, p, q, r, s; of squares forwards the noise and its power."""
    x, p, q, r, s = range(1, 6) if square else range(2, 7)
    half: list[list[Value]] = [[] for _ in range(STATES)]
    for j in range(STATES):
        of_q, of_s = write.load(q, j), write.load(s, j)
        column = [
            write.times_and(
                write.load(p, k), of_q, write.times_and(write.load(r, k), of_s, write.load(x, STATES * k + j))
            )
            for k in range(STATES)
        ]
        for i in range(STATES):
            half[i].append(weighted(write, i, column, back=back))
    power = None if back or not square else write.load(s + 2)
    for i in range(STATES):
        for j in range(i + 1 if square else STATES):
            out = weighted(write, j, half[i], matrix=0 if square else 1, back=back)
            if power is not None:
                out = write.times_and(power, write.spread(s + 1, i, j), out)
            write.store(out, x, STATES * i + j)
            if square and i != j:
                write.store(out, x, STATES * j + i)


def _times_taylor(write: Writer) -> None:
    """Arrays: P, t, where to: lateral block, across, across turned, vertical block, times t."""
    t = [write.load(1, k) for k in range(STATES)]
    do = _Numbers(write)
    for to, (first, turned) in enumerate(((SQUARES[0], False), (ACROSS, False), (ACROSS, True), (SQUARES[1], False))):
        for i in range(STATES):
            rows = [first + (STATES * k + i if turned else STATES * i + k) for k in range(STATES)]
            write.store(do.product([write.load(0, row) for row in rows], t), 2, STATES * to + i)


def _times_both(write: Writer) -> None:
    """Arrays: P, a vector of both directions, where to."""
    do = _Numbers(write)
    for i in range(BOTH):
        direction, row = divmod(i, STATES)
        if direction == 0:
            rows = [STATES * row + k for k in range(STATES)] + [ACROSS + STATES * k + row for k in range(STATES)]
        else:
            rows = [first + STATES * row + k for first in (ACROSS, SQUARES[1]) for k in range(STATES)]
        write.store(do.product([write.load(0, r) for r in rows], [write.load(1, k) for k in range(BOTH)]), 2, i)


def _moved_both(write: Writer, *, back: bool) -> None:
    """Arrays: both transitions one below the other, a vector."""
    for direction in range(2):
        x = [write.load(1, STATES * direction + k) for k in range(STATES)]
        for i in range(STATES):
            out = weighted(write, i, x, first=STATES * direction, back=back)
            write.store(out, 1, STATES * direction + i)


class _Walls(_Numbers):
    """What both walls read of a state."""

    def __init__(self, write: Writer) -> None:
        super().__init__(write)
        self.t = [write.load(0, TAYLOR + k) for k in range(STATES)]
        self.gains = [write.load(0, GAINS + wall) for wall in range(WALLS)]

    def read(self, values: Sequence[Value]) -> list[Value]:
        """Each wall's h times a vector of both directions."""
        lateral, vertical = self.product(self.t, values[:STATES]), self.product(self.t, values[STATES:])
        return [self.write.times_and(gain, vertical, lateral) for gain in self.gains]


def _observed(write: Writer) -> None:
    """Arrays: the room, readings, what to keep; numbers: square of the gate, forgiveness."""
    do = _Walls(write)
    gate, forgiveness = (write.everywhere(number) for number in write.numbers)
    m = [write.load(0, MEAN + k) for k in range(BOTH)]
    lateral, across, turned, vertical = (
        [write.load(0, PRODUCTS + STATES * block + k) for k in range(STATES)] for block in range(4)
    )
    ph = [
        [write.times_and(gain, other, one) for one, other in zip(lateral + across, turned + vertical, strict=True)]
        for gain in do.gains
    ]
    (first, cross), (_, second) = do.read(ph[0]), do.read(ph[1])
    predicted = do.read(m)
    away = [do.minus(write.load(1, VALUE + wall), predicted[wall]) for wall in range(WALLS)]
    missed = [write.load(0, TALLIES + MISSED + wall) for wall in range(WALLS)]
    write.store(do.larger(write.load(0, TALLIES + MOST_MISSED), do.larger(*missed)), 0, TALLIES + MOST_MISSED)

    def judged(wall: int, seen: Value, nu: Value) -> tuple[Value, Value]:
        """1/S and ν/S, or 0 of a reading that is not used."""
        allowed = write.less(do.none, write.load(1, ALLOWED + wall))
        within = do.times(gate, do.plus(seen, write.load(1, GATE_VARIANCE + wall)))
        wild = write.less(within, do.times(nu, nu))
        forgiven = do.larger(do.minus(missed[wall], forgiveness), do.none)
        counted = do.where(wild, do.plus(missed[wall], do.one), forgiven)
        write.store(do.where(allowed, counted, missed[wall]), 0, TALLIES + MISSED + wall)
        precision = do.over(do.one, do.plus(seen, write.load(1, VARIANCE + wall)))
        precision = do.where(allowed, do.where(wild, do.none, precision), do.none)
        return precision, do.times(nu, precision)

    precision, score = judged(0, first, away[0])
    shared = do.times(cross, precision)
    left = do.minus(second, do.times(cross, shared))
    then_precision, then_score = judged(1, left, do.minus(away[1], do.times(cross, score)))
    used, then_used = write.less(do.none, precision), write.less(do.none, then_precision)
    for k in range(BOTH):
        gain, after = do.times(ph[0][k], precision), do.minus(ph[1][k], do.times(ph[0][k], shared))
        then_gain = do.times(after, then_precision)
        for number, value in enumerate((write.builder.fneg(gain), ph[0][k], write.builder.fneg(then_gain), after)):
            write.store(value, 0, CHANGES + BOTH * number + k)
        write.store(do.where(used, gain, ph[0][k]), 2, GAIN + k)
        write.store(do.where(then_used, then_gain, ph[1][k]), 2, GAIN + BOTH + k)
        write.store(write.times_and(ph[0][k], score, write.times_and(after, then_score, m[k])), 0, MEAN + k)
    told = {SCORE: (score, then_score), PRECISION: (precision, then_precision), AWAY: away, EXPECTED: (first, second)}
    for row, values in told.items():
        for wall in range(WALLS):
            write.store(values[wall], 2, row + wall)


def _unobserved(write: Writer) -> None:
    """Arrays: the room, readings, what was kept, distances."""
    do = _Walls(write)
    gains = [[write.load(2, GAIN + BOTH * wall + k) for k in range(BOTH)] for wall in range(WALLS)]
    nk = [[write.load(0, PRODUCTS + BOTH * wall + k) for k in range(BOTH)] for wall in range(WALLS)]
    r = [write.load(0, MEAN + k) for k in range(BOTH)]
    h = [do.t + [do.times(gain, t) for t in do.t] for gain in do.gains]
    precision = [write.load(2, PRECISION + wall) for wall in range(WALLS)]
    used = [write.less(do.none, one) for one in precision]
    gate = [write.load(1, GATE_VARIANCE + wall) for wall in range(WALLS)]
    x: list[list[Value]] = [[], []]

    def taken(wall: int, n_gain: list[Value], r: list[Value]) -> tuple[list[Value], Value]:
        """Find a used reading's x, the new r, and how far it is from all others."""
        e = do.minus(write.load(2, SCORE + wall), do.product(gains[wall], r))
        d = do.plus(precision[wall], do.product(gains[wall], n_gain))
        e, known = do.where(used[wall], e, do.none), do.where(used[wall], d, do.one)
        half_d = do.times(write.number(0.5), d)
        x[wall] = [
            do.where(used[wall], do.minus(do.times(h[wall][k], half_d), n_gain[k]), do.none) for k in range(BOTH)
        ]
        variance = do.plus(do.over(do.one, known), do.minus(gate[wall], write.load(1, VARIANCE + wall)))
        distance = do.over(do.over(e, known), do.root(do.where(used[wall], variance, do.one)))
        return [write.times_and(h[wall][k], e, r[k]) for k in range(BOTH)], distance

    r, then_off = taken(1, nk[1], r)
    along, beside = do.product(x[1], gains[0]), do.read(gains[0])[1]
    after = [write.times_and(h[1][k], along, write.times_and(x[1][k], beside, nk[0][k])) for k in range(BOTH)]
    # of a second reading that is not used h x' + x h' is nothing, for x is
    r, off = taken(0, after, r)
    for wall, mine in ((0, off), (1, then_off)):
        read, less = do.read(gains[wall]), do.product(gains[wall], nk[wall])
        for other in range(WALLS):
            less = write.times_and(do.plus(read[other], read[other]), do.product(x[other], gains[wall]), less)
        spread = do.larger(do.minus(write.load(2, EXPECTED + wall), less), do.none)
        away = do.minus(write.load(2, AWAY + wall), do.product(gains[wall], r))
        distance = do.where(used[wall], mine, do.over(away, do.root(do.plus(spread, gate[wall]))))
        write.store(do.larger(distance, write.builder.fneg(distance)), 3, wall)
    for k in range(BOTH):
        write.store(r[k], 0, MEAN + k)
        write.store(do.plus(x[0][k], x[1][k]), 0, CHANGES + k)
        vertical = write.times_and(do.gains[0], x[0][k], do.times(do.gains[1], x[1][k]))
        write.store(vertical, 0, CHANGES + BOTH + k)


@compiled
def square(_, a, a_row, a_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column, s, s_row, s_column, noise, noise_row, noise_column, power, power_row, power_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Put A (X + p qᵀ + r sᵀ) Aᵀ in the place of X, a block of one direction with itself, and add the power times the noise."""
    rows = (
        a, a_row, a_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column,
        s, s_row, s_column, noise, noise_row, noise_column, power, power_row, power_column,
    )  # fmt: skip
    return function(types.void, rows, lambda write: _carried(write, back=False, square=True))


@compiled
def across(_, a, a_row, a_column, b, b_row, b_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column, s, s_row, s_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Put A (X + p qᵀ + r sᵀ) Bᵀ in the place of X."""
    rows = (
        a, a_row, a_column, b, b_row, b_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column,
        r, r_row, r_column, s, s_row, s_column,
    )  # fmt: skip
    return function(types.void, rows, lambda write: _carried(write, back=False, square=False))


@compiled
def square_back(_, a, a_row, a_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column, s, s_row, s_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Put Aᵀ (X + p qᵀ + r sᵀ) A in the place of X, a block of one direction with itself."""
    rows = (
        a, a_row, a_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column,
        s, s_row, s_column,
    )  # fmt: skip
    return function(types.void, rows, lambda write: _carried(write, back=True, square=True))


@compiled
def across_back(_, a, a_row, a_column, b, b_row, b_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column, r, r_row, r_column, s, s_row, s_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Put Aᵀ (X + p qᵀ + r sᵀ) B in the place of X."""
    rows = (
        a, a_row, a_column, b, b_row, b_column, x, x_row, x_column, p, p_row, p_column, q, q_row, q_column,
        r, r_row, r_column, s, s_row, s_column,
    )  # fmt: skip
    return function(types.void, rows, lambda write: _carried(write, back=True, square=False))


@compiled
def moved(_, a, a_row, a_column, x, x_row, x_column):  # type: ignore[no-untyped-def]
    """Put A x in the place of a vector of both directions, whose transitions lie one below the other."""
    return function(types.void, (a, a_row, a_column, x, x_row, x_column), lambda write: _moved_both(write, back=False))


@compiled
def moved_back(_, a, a_row, a_column, x, x_row, x_column):  # type: ignore[no-untyped-def]
    """Put Aᵀ x in the place of a vector of both directions."""
    return function(types.void, (a, a_row, a_column, x, x_row, x_column), lambda write: _moved_both(write, back=True))


@compiled
def times_taylor(_, x, x_row, x_column, t, t_row, t_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write t times the blocks of a matrix: lateral, across, across turned, vertical."""
    return function(types.void, (x, x_row, x_column, t, t_row, t_column, out, row, column), _times_taylor)


@compiled
def times_both(_, x, x_row, x_column, v, v_row, v_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write a matrix, of blocks, times a vector of both directions."""
    return function(types.void, (x, x_row, x_column, v, v_row, v_column, out, row, column), _times_both)


@compiled
def observe(_, gate, forgiveness, room, room_row, room_column, readings, readings_row, readings_column, kept, kept_row, kept_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Read a bin: judge both readings, put the mean right, and write what is to be taken off P and what is to be kept."""
    rows = (room, room_row, room_column, readings, readings_row, readings_column, kept, kept_row, kept_column)
    return function(types.void, (gate, forgiveness, *rows), _observed)


@compiled
def unobserve(_, room, room_row, room_column, readings, readings_row, readings_column, kept, kept_row, kept_column, off, off_row, off_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Take the readings of a bin into r, write what is to be added to N, and how far each lies from all others."""
    rows = (room, room_row, room_column, readings, readings_row, readings_column, kept, kept_row, kept_column)
    return function(types.void, (*rows, off, off_row, off_column), _unobserved)
