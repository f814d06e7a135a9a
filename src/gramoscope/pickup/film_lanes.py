"""Lines of film added, interpolated and turned into columns, many pixels of them as one vector of the processor.

Pixels are small whole numbers: 64 of them are added at a time, and what frames that lie at one fraction of a pixel add up to
becomes single precision on its way out of the registers. A picture is drawn row by row and wanted column by column: sixteen
rows of sixteen columns change places without touching memory, and leave as whole cache lines. Arrays are given as `lane_writer`
says.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir

from gramoscope.pickup.lane_writer import INT, LANES, LONG, REAL, LaneWriter, Value, compiled, function, room_for

PIXELS = 64
"""So many pixels are added at a time; a line has at least as many."""
COLUMNS = 32
"""Of so many, products are added at a time; a row has at least as many."""
PRODUCTS = 8
SERIES = 9
SQUARE_ROOT_HALF_BITS = 0x3F3504F3
"""√½ in single precision, as a whole number."""


def _places(numbers: list[int]) -> Value:
    return ir.Constant(ir.VectorType(INT, len(numbers)), numbers)


def _least(w: LaneWriter, one: Value, other: Value) -> Value:
    return w.builder.select(w.builder.icmp_signed("<", one, other), one, other)


def _in_pieces(w: LaneWriter, count: Value, size: int) -> tuple[Value, Any]:
    """How many pieces of such a size make up a line, and where each begins: the last one ends where the line does."""
    pieces = w.builder.sdiv(w.plus(count, size - 1), ir.Constant(LONG, size))
    last = w.plus(count, -size)
    return pieces, lambda piece: _least(w, w.times(piece, size), last)


def _pixels(w: LaneWriter, film: Value, place: Value, kind: ir.IntType) -> Value:
    """Pixels from a place on, as whole numbers of such a kind."""
    seen = ir.VectorType(film.type.pointee, PIXELS)
    near = w.builder.bitcast(w.builder.gep(film, [place]), seen.as_pointer())
    return w.builder.zext(w.builder.load(near, align=1), ir.VectorType(kind, PIXELS))


def _write_real(w: LaneWriter, numbers: Value, line: Value, place: Value) -> None:
    """Write whole numbers as numbers of single precision."""
    real = w.builder.uitofp(numbers, ir.VectorType(REAL, PIXELS))
    w.builder.store(real, w.builder.bitcast(w.builder.gep(line, [place]), real.type.as_pointer()), align=4)


def _sum_of_lines(w: LaneWriter) -> None:
    film, begins, first, frames, offset, soon, line, place, count = w.arguments
    kind = ir.IntType(2 * film.type.pointee.width)
    pieces, begin = _in_pieces(w, count, PIXELS)
    room = room_for(w.builder, ir.VectorType(kind, PIXELS))

    def piece(number: Value) -> None:
        x = begin(number)
        w.builder.store(ir.Constant(room.type.pointee, [0] * PIXELS), room)

        def frame(k: Value) -> None:
            there = w.builder.load(w.builder.gep(begins, [w.plus(first, k)]))
            here = w.plus(w.plus(there, offset), x)
            w.call_for(film, w.plus(here, soon))
            seen = _pixels(w, film, here, kind)
            w.builder.store(w.builder.add(w.builder.load(room), seen), room)

        w.loop(frames, frame)
        _write_real(w, w.builder.load(room), line, w.plus(place, x))

    w.loop(pieces, piece)


def _sum_of_phases(w: LaneWriter) -> None:
    lines, step, taps, phases, total, place, count = w.arguments
    at_once = 2
    first = w.sums(at_once)

    def piece(number: Value) -> None:
        x = w.times(number, at_once * LANES)
        for room in first:
            w.builder.store(w.constant(0.0), room)

        def phase(p: Value) -> None:
            weight = [w.spread(taps, w.plus(w.times(p, 4), t)) for t in range(4)]
            here = w.plus(w.times(p, step), x)
            seen = [w.load(lines, w.plus(here, k * LANES)) for k in range(at_once + 1)]
            for k, room in enumerate(first):
                value = w.builder.fmul(weight[1], w.cut(seen[k], seen[k + 1], 1))
                for t in (0, 2, 3):
                    value = w.times_and(weight[t], w.cut(seen[k], seen[k + 1], t), value)
                w.builder.store(w.builder.fadd(w.builder.load(room), value), room)

        w.loop(phases, phase)
        for k, room in enumerate(first):
            w.store(w.builder.load(room), total, w.plus(w.plus(place, x), k * LANES))

    w.loop(w.builder.sdiv(w.plus(count, at_once * LANES - 1), ir.Constant(LONG, at_once * LANES)), piece)


def _means_as_columns(w: LaneWriter) -> None:
    total, begin, step, share, first, count, columns, place, height = w.arguments
    pieces, start = _in_pieces(w, count, LANES)

    def piece(number: Value) -> None:
        x = start(number)
        part = w.load(share, w.plus(first, x))
        rows = [w.load(total, w.plus(w.plus(begin, x), w.times(step, j))) for j in range(LANES)]
        into = w.plus(place, w.times(x, height))
        for k, column in enumerate(w.turned([w.builder.fmul(row, part) for row in rows])):
            w.store(column, columns, w.plus(into, w.times(height, k)))

    w.loop(pieces, piece)


@compiled
def sum_lines(_, film, begins, first, frames, offset, soon, line, place, count):  # type: ignore[no-untyped-def]
    """Write sums of so many lines of a film, which begin `offset` after the places given, as single precision.

    At least `PIXELS` of them; those `soon` places further on are called for.
    """
    return function((film, begins, first, frames, offset, soon, line, place, count), _sum_of_lines)


@compiled
def sum_phases(_, lines, step, taps, phases, total, place, count):  # type: ignore[no-untyped-def]
    """Write sums of lines, `step` apart, each interpolated by four taps of its own.

    Up to 31 numbers more than are asked for are written, and 16 more of each line are read.
    """
    return function((lines, step, taps, phases, total, place, count), _sum_of_phases)


@compiled
def write_as_columns(_, total, begin, step, share, first, count, columns, place, height):  # type: ignore[no-untyped-def]
    """Write sixteen rows, `step` apart, as at least sixteen columns, `height` apart, each times its share."""
    return function((total, begin, step, share, first, count, columns, place, height), _means_as_columns)


def _summed(w: LaneWriter, rows: list[Value]) -> list[Value]:
    """Sums of the first and of the last eight numbers of sixteen vectors, as two vectors.

    Two vectors become one, three times over: the fourth number further on is added, then neighbours, then theirs.
    """
    half = LANES // 2
    owner = [[(row, column // half) for column in range(LANES)] for row in range(LANES)]
    fours = [k for k in range(2 * LANES) if k % half < 4]
    fours = [k for first in (0, half) for k in (*fours[first // 2 : first // 2 + 4], *fours[half + first // 2 :][:4])]
    for kept, far in ((fours, 4), (range(0, 2 * LANES, 2), 1), (range(0, 2 * LANES, 2), 1)):
        one, other = list(kept), [k + far for k in kept]
        rows, owner = (
            [
                w.builder.fadd(*(w.builder.shuffle_vector(a, b, _places(order)) for order in (one, other)))
                for a, b in zip(rows[0::2], rows[1::2], strict=True)
            ],
            [[(a + b)[k] for k in one] for a, b in zip(owner[0::2], owner[1::2], strict=True)],
        )
    both = owner[0] + owner[1]
    return [
        w.builder.shuffle_vector(rows[0], rows[1], _places([both.index((row, part)) for row in range(LANES)]))
        for part in (0, 1)
    ]


def _energies_of_cells(w: LaneWriter) -> None:
    lines, begin, step, weight, cells, energy, place, height = w.arguments
    pieces, start = _in_pieces(w, cells, 2)
    half = w.constant(0.5)

    def piece(number: Value) -> None:
        cell = start(number)
        x = w.times(cell, LANES // 2)
        share = w.load(weight, x)
        squares = []
        for j in range(LANES):
            first = w.plus(w.plus(w.plus(begin, x), w.times(step, j)), -2)
            here, behind = w.load(lines, first), w.load(lines, w.plus(first, LANES))
            far_before, before, after, far_after = (w.cut(here, behind, far) for far in (0, 1, 3, 4))
            near, beyond = w.builder.fsub(after, before), w.builder.fsub(far_after, far_before)
            difference = w.builder.fmul(w.times_and(half, beyond, near), share)
            squares.append(w.builder.fmul(difference, difference))
        into = w.plus(place, w.times(cell, height))
        for k, energies in enumerate(_summed(w, squares)):
            w.store(energies, energy, w.plus(into, w.times(height, k)))

    w.loop(pieces, piece)


@compiled
def write_energies(_, lines, begin, step, weight, cells, energy, place, height):  # type: ignore[no-untyped-def]
    """Write the energies of at least two cells of eight columns, `height` apart, for sixteen rows, `step` apart.

    Energies are the squares of slopes by the derivative of a Gaussian of about one pixel, from four columns: what is two
    before and two behind a row is read, too. Each slope is given its column's weight.
    """
    return function((lines, begin, step, weight, cells, energy, place, height), _energies_of_cells)


def _products_of_rows(w: LaneWriter) -> None:
    film, here, there, count, sums = w.arguments
    b, bits = w.builder, film.type.pointee.width
    small, wide = (ir.VectorType(ir.IntType(size * bits), COLUMNS) for size in (2, 4))
    pieces, start = _in_pieces(w, count, COLUMNS)
    rooms = [room_for(b, wide) for _ in range(PRODUCTS)]
    zero, order = ir.Constant(small, [0] * COLUMNS), ir.Constant(small, [*range(COLUMNS)])
    for room in rooms:
        b.store(ir.Constant(wide, [0] * COLUMNS), room)

    def seen(place: Value, aside: int) -> Value:
        at = b.bitcast(b.gep(film, [w.plus(place, aside)]), ir.VectorType(film.type.pointee, COLUMNS).as_pointer())
        return b.zext(b.load(at, align=1), small)

    def piece(number: Value) -> None:
        x = start(number)
        mine, other = w.plus(here, x), w.plus(there, x)
        slope = b.sub(b.add(seen(mine, 2), seen(mine, 1)), b.add(seen(mine, -1), seen(mine, -2)))
        # the last piece shows some columns again
        nothing, again = ir.Constant(small, ir.Undefined), b.sub(w.times(number, COLUMNS), x)
        again = b.insert_element(nothing, b.trunc(again, small.element), ir.Constant(INT, 0))
        again = b.shuffle_vector(again, nothing, _places([0] * COLUMNS))
        slope = b.select(b.icmp_signed("<", order, again), zero, slope)
        for room, factor in zip(rooms, [slope, seen(mine, 0), *(seen(other, k - 2) for k in range(6))], strict=True):
            product = b.mul(b.sext(slope, wide), b.sext(factor, wide))
            b.store(b.add(b.load(room), product), room)

    w.loop(pieces, piece)
    kind = ir.FunctionType(wide.element, [wide])
    total = b.module.declare_intrinsic(f"llvm.vector.reduce.add.v{COLUMNS}i{4 * bits}", fnty=kind)
    for k, room in enumerate(rooms):
        at = b.gep(sums, [ir.Constant(LONG, k)])
        sum_ = b.call(total, [b.load(room)])
        b.store(b.add(b.load(at), sum_ if sum_.type == LONG else b.sext(sum_, LONG)), at)


@compiled
def add_products(_, film, here, there, count, sums):  # type: ignore[no-untyped-def]
    """Add, to eight sums, the products of a row's slope with itself, with its row and with six places of another row.

    The slope is x₂ + x₁ − x₋₁ − x₋₂, the places are −2 … 3, and there are at least `COLUMNS` columns.
    """
    return function((film, here, there, count, sums), _products_of_rows)


def _logarithms(w: LaneWriter, number: Value, series: list[Value], gain: Value) -> Value:
    """Logarithms of positive numbers times a gain: by powers of two, and a series between √½ and √2."""
    b, whole = w.builder, ir.VectorType(INT, LANES)
    bits = b.bitcast(number, whole)
    shift = ir.Constant(whole, [23] * LANES)
    power = b.ashr(b.sub(bits, ir.Constant(whole, [SQUARE_ROOT_HALF_BITS] * LANES)), shift)
    y = b.fsub(b.bitcast(b.sub(bits, b.shl(power, shift)), number.type), w.constant(1.0))
    value = series[-1]
    for coefficient in series[-2::-1]:
        value = w.times_and(value, y, coefficient)
    twos = w.times_and(b.sitofp(power, number.type), w.constant(math.log(2)), b.fmul(y, value))
    return b.fmul(gain, twos)


def _in_tone(w: LaneWriter) -> None:
    grey, count, curve, series, seen = w.arguments
    b, at_once = w.builder, PIXELS // LANES
    share, rest, gain = (w.spread(curve, ir.Constant(LONG, k)) for k in range(3))
    weight = [w.spread(series, ir.Constant(LONG, k)) for k in range(SERIES)]
    zero = w.constant(0.0)
    black = _logarithms(w, rest, weight, gain)
    pieces, start = _in_pieces(w, count, PIXELS)

    def piece(number: Value) -> None:
        x = start(number)
        places = [w.plus(x, k * LANES) for k in range(at_once)]
        values = [w.load(grey, place) for place in places]
        lit = [b.fcmp_ordered(">", value, zero) for value in values]
        values = [b.select(some, value, zero) for some, value in zip(lit, values, strict=True)]
        any_ = b.bitcast(b.or_(b.or_(lit[0], lit[1]), b.or_(lit[2], lit[3])), ir.IntType(LANES))
        with b.if_else(b.icmp_unsigned("!=", any_, ir.Constant(any_.type, 0))) as (then, otherwise):
            with then:
                for place, value in zip(places, values, strict=True):
                    w.store(_logarithms(w, b.fadd(rest, b.fmul(share, value)), weight, gain), seen, place)
            with otherwise:
                for place in places:
                    w.store(black, seen, place)

    w.loop(pieces, piece)


@compiled
def write_in_tone(_, grey, count, curve, series, seen):  # type: ignore[no-untyped-def]
    """Write c log(b + a x) of at least `PIXELS` grey levels x, or 0 if they are below it, for a curve (a, b, c).

    Of `SERIES` coefficients of log(1 + y)/y between √½ and √2, the lowest power first. What is black is told at a glance.
    """
    return function((grey, count, curve, series, seen), _in_tone)


def _sum_of_real_lines(w: LaneWriter) -> None:
    first_line, from_, lines, begins, first, number, step, out, place, count = w.arguments
    b, at_once = w.builder, PIXELS // LANES
    rooms = w.sums(at_once)

    def piece(index: Value) -> None:
        x = w.times(index, PIXELS)
        for k, room in enumerate(rooms):
            b.store(w.load(first_line, w.plus(w.plus(from_, x), k * LANES)), room)

        def line(i: Value) -> None:
            there = w.plus(b.load(b.gep(begins, [w.plus(first, w.times(i, step))])), x)
            for k, room in enumerate(rooms):
                b.store(b.fadd(b.load(room), w.load(lines, w.plus(there, k * LANES))), room)

        w.loop(number, line)
        for k, room in enumerate(rooms):
            w.store(b.load(room), out, w.plus(w.plus(place, x), k * LANES))

    w.loop(b.sdiv(w.plus(count, PIXELS - 1), ir.Constant(LONG, PIXELS)), piece)


@compiled
def add_lines(_, first_line, from_, lines, begins, first, number, step, out, place, count):  # type: ignore[no-untyped-def]
    """Write a line to which others are added, in their order: those that begin at every `step`-th of the places given.

    Up to 63 numbers more than are asked for are read and written.
    """
    arguments = (first_line, from_, lines, begins, first, number, step, out, place, count)
    return function(arguments, _sum_of_real_lines)
