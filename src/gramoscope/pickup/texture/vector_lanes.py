"""Sums of sixteen numbers at a time that windows, their channels and their transforms are made of.

As vectors of the processor (`pickup.lane_writer`) they take half the time of Numba's own loops.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from llvmlite import ir

from gramoscope.pickup.lane_writer import (
    LANES,
    LONG,
    REAL,
    VECTOR,
    LaneWriter,
    Value,
    compiled,
    function,
    room_for,
)

AT_ONCE = 4
"""So many columns are worked on together: what they share is read once."""
LINES_CALLED_FOR = 4
"""Of the cache, of sixteen numbers each: what a window's rows lie in."""
INTERPOLATED_FROM = 10
"""Rows of a picture that make one of a window."""


def _interpolation(w: LaneWriter) -> None:
    picture, first, soon, taps, tap, window, place, rows = w.arguments
    weight = [w.spread(taps, w.plus(tap, k)) for k in range(INTERPOLATED_FROM)]
    last = room_for(w.builder, VECTOR)
    w.builder.store(w.load(picture, first), last)

    def lanes(number: Value) -> None:
        row = w.times(number, LANES)
        w.call_for(picture, w.plus(w.plus(first, soon), row))
        here, next_ = w.builder.load(last), w.load(picture, w.plus(w.plus(first, LANES), row))
        w.builder.store(next_, last)
        # what begins a few rows on is cut out of both: reading it again would be dearer, as most of it lies in two lines
        seen = [here] + [w.cut(here, next_, k) for k in range(1, INTERPOLATED_FROM)]
        near, far = w.builder.fmul(weight[3], seen[3]), w.builder.fmul(weight[0], seen[0])
        for k in (4, 5, 6, 8):
            near = w.times_and(weight[k], seen[k], near)
        for k in (1, 2, 7, 9):
            far = w.times_and(weight[k], seen[k], far)
        w.store(w.builder.fadd(near, far), window, w.plus(place, row))

    w.loop(w.builder.sdiv(rows, ir.Constant(LONG, LANES)), lanes)


def _mixture(w: LaneWriter) -> None:
    picture, places, number, rows, mixture, begin, out, targets = w.arguments
    for k in range(AT_ONCE):
        soon = w.whole(places, w.plus(number, AT_ONCE + k))
        for line in range(LINES_CALLED_FOR):
            w.call_for(picture, w.plus(soon, line * LANES))
    first = [w.whole(places, w.plus(number, k)) for k in range(AT_ONCE)]
    sums = w.sums(AT_ONCE)

    def row(j: Value) -> None:
        weight = w.load(mixture, w.plus(begin, w.times(j, LANES)))
        for room, place in zip(sums, first, strict=True):
            w.add_product(room, w.spread(picture, w.plus(place, j)), weight)

    w.loop(rows, row)
    for k, room in enumerate(sums):
        w.store(w.builder.load(room), out, w.whole(targets, w.plus(number, k)))


def _symmetric_filter(w: LaneWriter) -> None:
    wide, middle, taps, reach, out, place = w.arguments
    sums = w.sums(AT_ONCE)
    weight = w.spread(taps, ir.Constant(LONG, 0))
    for k, room in enumerate(sums):
        w.builder.store(w.builder.fmul(weight, w.load(wide, w.plus(middle, k * LANES))), room)

    def pair(j: Value) -> None:
        away = w.plus(j, 1)
        weight, distance = w.spread(taps, away), w.times(away, LANES)
        before, behind = w.builder.sub(middle, distance), w.plus(middle, distance)
        for k, room in enumerate(sums):
            both = w.builder.fadd(w.load(wide, w.plus(before, k * LANES)), w.load(wide, w.plus(behind, k * LANES)))
            w.add_product(room, weight, both)

    w.loop(reach, pair)
    for k, room in enumerate(sums):
        w.store(w.builder.load(room), out, w.plus(place, k * LANES))


def _power(w: LaneWriter) -> None:
    seen, first, form, begin, out, place = w.arguments
    sums = w.sums(AT_ONCE)

    def channel(c: Value) -> None:
        row = w.load(form, w.plus(begin, w.times(c, LANES)))
        for k, room in enumerate(sums):
            w.add_product(room, w.spread(seen, w.plus(w.plus(first, c), k * LANES)), row)

    w.loop(ir.Constant(LONG, LANES), channel)
    for k, room in enumerate(sums):
        vector = w.builder.load(room)
        for half, total in enumerate(w.totals_of_halves(w.builder.fmul(vector, vector))):
            w.builder.store(total, w.builder.gep(out, [w.plus(place, 2 * k + half)]))


def _butterfly(radix: int) -> Callable[[LaneWriter], None]:
    """Transforms of so many complex lanes, with their twiddles, for many neighbours; see `lane_transform`."""

    def write(w: LaneWriter) -> None:
        source, here, far, twiddle, place, target, there, near, count = w.arguments
        turns = [[w.spread(twiddle, w.plus(place, 2 * k + part)) for part in (0, 1)] for k in range(radix - 1)]

        def neighbour(q: Value) -> None:
            step = w.times(q, 2 * LANES)
            first, into = w.plus(here, step), w.plus(there, step)
            seen = []
            for j in range(radix):
                at = w.plus(first, w.times(far, j)) if j else first
                seen.append((w.load(source, at), w.load(source, w.plus(at, LANES))))
            for k, (real, imaginary) in enumerate(_transformed(w, seen)):
                at = w.plus(into, w.times(near, k)) if k else into
                if k:
                    cosine, sine = turns[k - 1]
                    real, imaginary = (
                        w.less(w.builder.fmul(real, cosine), imaginary, sine),
                        w.times_and(real, sine, w.builder.fmul(imaginary, cosine)),
                    )
                w.store(real, target, at)
                w.store(imaginary, target, w.plus(at, LANES))

        w.loop(count, neighbour)

    return write


Complex = tuple[Value, Value]


def _transformed(w: LaneWriter, seen: list[Complex]) -> list[Complex]:
    """The transform of a few complex vectors."""
    if len(seen) == 2:
        return [_sum(w, seen[0], seen[1]), _difference(w, seen[0], seen[1])]
    if len(seen) == 4:
        even_ones, odd_ones = _transformed(w, seen[0::2]), _transformed(w, seen[1::2])
        pairs = list(zip(even_ones, [odd_ones[0], _turned(w, odd_ones[1])], strict=True))
        return [_sum(w, *pair) for pair in pairs] + [_difference(w, *pair) for pair in pairs]
    n = len(seen)
    sums = [_sum(w, seen[j], seen[n - j]) for j in range(1, n // 2 + 1)]
    differences = [_difference(w, seen[j], seen[n - j]) for j in range(1, n // 2 + 1)]
    total = seen[0]
    for one in sums:
        total = _sum(w, total, one)
    out: list[Complex] = [total] + [seen[0]] * (n - 1)
    for k in range(1, n // 2 + 1):
        even, odd = seen[0], (w.constant(0.0), w.constant(0.0))
        for j, (both, apart) in enumerate(zip(sums, differences, strict=True), start=1):
            cosine, sine = (w.constant(f(2 * math.pi * j * k / n)) for f in (math.cos, math.sin))
            even = (w.times_and(cosine, both[0], even[0]), w.times_and(cosine, both[1], even[1]))
            odd = (w.times_and(sine, apart[0], odd[0]), w.times_and(sine, apart[1], odd[1]))
        turned = _turned(w, odd)
        out[k], out[n - k] = _sum(w, even, turned), _difference(w, even, turned)
    return out


def _turned(w: LaneWriter, one: Complex) -> Complex:
    """A complex vector times −i."""
    return one[1], w.builder.fsub(w.constant(0.0), one[0])


def _sum(w: LaneWriter, one: Complex, other: Complex) -> Complex:
    return w.builder.fadd(one[0], other[0]), w.builder.fadd(one[1], other[1])


def _difference(w: LaneWriter, one: Complex, other: Complex) -> Complex:
    return w.builder.fsub(one[0], other[0]), w.builder.fsub(one[1], other[1])


def _weighing(w: LaneWriter) -> None:
    z, here, there, turn, place, weights, begin, count, out, into = w.arguments
    b, half = w.builder, w.constant(0.5)
    one, other = ((w.load(z, at), w.load(z, w.plus(at, LANES))) for at in (here, there))
    cosine, sine = w.spread(turn, place), w.spread(turn, w.plus(place, 1))
    even = (b.fadd(one[0], other[0]), b.fsub(one[1], other[1]))
    odd = (b.fadd(one[1], other[1]), b.fsub(other[0], one[0]))
    real = b.fmul(half, w.times_and(sine, odd[1], w.times_and(cosine, odd[0], even[0])))
    imaginary = b.fmul(half, w.less(w.times_and(cosine, odd[1], even[1]), sine, odd[0]))

    def weigh(number: Value) -> None:
        k = w.times(number, 2)
        row = w.plus(begin, w.times(k, LANES))
        weight = [w.load(weights, w.plus(row, more)) for more in (0, LANES)]
        totals = w.totals_of_four([b.fmul(one, part) for part in (real, imaginary) for one in weight])
        for first, pair in zip((0, LANES), totals, strict=True):
            at = b.gep(out, [w.plus(w.plus(into, k), first)])
            b.store(pair, b.bitcast(at, ir.VectorType(REAL, 2).as_pointer()), align=4)

    w.loop(b.sdiv(count, ir.Constant(LONG, 2)), weigh)


def _folding(w: LaneWriter) -> None:
    bins, here, there, turn, place, z, into = w.arguments
    b = w.builder
    one, other = ((w.load(bins, at), w.load(bins, w.plus(at, LANES))) for at in (here, there))
    cosine, sine = w.spread(turn, place), w.spread(turn, w.plus(place, 1))
    even = (b.fadd(one[0], other[0]), b.fsub(one[1], other[1]))
    apart = (b.fsub(one[0], other[0]), b.fadd(one[1], other[1]))
    odd = (w.less(b.fmul(cosine, apart[0]), sine, apart[1]), w.times_and(sine, apart[0], b.fmul(cosine, apart[1])))
    w.store(b.fadd(even[1], odd[0]), z, into)
    w.store(b.fsub(even[0], odd[1]), z, w.plus(into, LANES))


def _squares_by_lane(w: LaneWriter) -> None:
    answers, first, out, place, apart = w.arguments
    # neighbours lie in one complex lane, their parts exchanged
    rows = [w.load(answers, w.plus(first, LANES * (k ^ 1))) for k in range(LANES)]
    for lane, row in enumerate(w.turned([w.builder.fmul(row, row) for row in rows])):
        w.store(row, out, w.plus(place, w.times(apart, lane)))


@compiled
def squares_by_lane(_, answers, first, out, place, apart):  # type: ignore[no-untyped-def]
    """Write the squares of sixteen columns of answers, `lane_transform.fold`, to sixteen lines, `apart` from each other."""
    return function((answers, first, out, place, apart), _squares_by_lane)


@compiled
def weigh_bin(_, z, here, there, turn, place, weights, begin, count, out, into):  # type: ignore[no-untyped-def]
    """Write sums over sixteen rows by some weights, of a bin that is in two places of `lane_transform.transform`.

    The weights are even in number.
    """
    return function((z, here, there, turn, place, weights, begin, count, out, into), _weighing)


@compiled
def fold_bin(_, bins, here, there, turn, place, z, into):  # type: ignore[no-untyped-def]
    """Write twice what `lane_transform.fold` says of a bin."""
    return function((bins, here, there, turn, place, z, into), _folding)


@compiled
def halves(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform pairs of complex lanes, `far` apart, into pairs `near` each other, for `count` neighbours."""
    return function((source, here, far, twiddle, place, target, there, near, count), _butterfly(2))


@compiled
def thirds(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform threes, as `halves` does pairs."""
    return function((source, here, far, twiddle, place, target, there, near, count), _butterfly(3))


@compiled
def quarters(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform fours, as `halves` does pairs."""
    return function((source, here, far, twiddle, place, target, there, near, count), _butterfly(4))


@compiled
def fifths(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform fives, as `halves` does pairs."""
    return function((source, here, far, twiddle, place, target, there, near, count), _butterfly(5))


@compiled
def interpolate(_, picture, first, soon, taps, tap, window, place, rows):  # type: ignore[no-untyped-def]
    """Write rows of a window, a multiple of 16, each from ten rows of a picture by ten taps; 16 rows more are looked at."""
    return function((picture, first, soon, taps, tap, window, place, rows), _interpolation)


@compiled
def mix(_, picture, places, number, rows, mixture, begin, out, targets):  # type: ignore[no-untyped-def]
    """Write sixteen weighted sums of neighbouring rows of a picture, by a mixture [row, 16], for four places of it.

    `places` and `targets`, int64, say from a number on where the rows begin and where the sums go; the next four places are
    called for, and may lie anywhere.
    """
    return function((picture, places, number, rows, mixture, begin, out, targets), _mixture)


@compiled
def filter_symmetrically(_, wide, middle, taps, reach, out, place):  # type: ignore[no-untyped-def]
    """Write four columns of [column, 16], filtered along the columns by taps given from their middle on."""
    return function((wide, middle, taps, reach, out, place), _symmetric_filter)


@compiled
def power(_, seen, first, form, begin, out, place):  # type: ignore[no-untyped-def]
    """Write |zᵀ P|², of the first eight and of the last eight columns of P [16, 16], for four columns z of [column, 16]."""
    return function((seen, first, form, begin, out, place), _power)
