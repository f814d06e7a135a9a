"""Sixteen numbers of single precision as one vector of the processor: what a compiler does not find by itself.

Numba's loops over sixteen channels, or sixteen rows, are split where they need not be, and what they add up goes to memory and
comes back. Told that sixteen numbers are one vector, LLVM keeps sums in registers, whatever the processor has, and windows are
mixed and whitened in half the time. Arrays are C-contiguous and given with the place in them where to begin, counted
in numbers, for making views costs as much as the work; all lengths are in numbers too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16
AT_ONCE = 4
"""So many columns are worked on together: what they share is read once."""
LINES_CALLED_FOR = 4
"""Of the cache, of sixteen numbers each: what a window's rows lie in."""
INTERPOLATED_FROM = 10
"""Rows of a picture that make one of a window."""
_REAL, _LONG, _INT = ir.FloatType(), ir.IntType(64), ir.IntType(32)
_VECTOR = ir.VectorType(_REAL, LANES)
_ANY = ir.Constant(_VECTOR, ir.Undefined)
_SAME = ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES)
Value = Any
"""Of LLVM, in the making."""
_compiled: Any = intrinsic
"""Numba's own types count the context, which only the compiler gives, as an argument."""
_room: Any = cgutils.alloca_once


class _Writer:
    """Writes code about arrays; `arguments` are those of the function, arrays as pointers."""

    def __init__(self, context: Any, builder: Any, signature: Any, values: Any) -> None:
        self.builder = builder
        self.arguments = [
            context.make_array(kind)(context, builder, value).data
            if isinstance(kind, types.Array)
            else context.cast(builder, value, kind, types.intp)
            for kind, value in zip(signature.args, values, strict=True)
        ]

    def plus(self, one: Value, other: Value | int) -> Value:
        return self.builder.add(one, ir.Constant(_LONG, other) if isinstance(other, int) else other)

    def times(self, one: Value, other: Value | int) -> Value:
        return self.builder.mul(one, ir.Constant(_LONG, other) if isinstance(other, int) else other)

    def load(self, array: Value, place: Value) -> Value:
        return self.builder.load(self._at(array, place), align=4)

    def whole(self, array: Value, place: Value) -> Value:
        """A whole number."""
        return self.builder.load(self.builder.gep(array, [place]))

    def store(self, value: Value, array: Value, place: Value) -> None:
        self.builder.store(value, self._at(array, place), align=4)

    def _at(self, array: Value, place: Value) -> Value:
        return self.builder.bitcast(self.builder.gep(array, [place]), _VECTOR.as_pointer())

    def spread(self, array: Value, place: Value) -> Value:
        """One number, in all places of a vector."""
        value = self.builder.load(self.builder.gep(array, [place]))
        first = self.builder.insert_element(_ANY, value, ir.Constant(_INT, 0))
        return self.builder.shuffle_vector(first, _ANY, _SAME)

    def times_and(self, one: Value, other: Value, more: Value) -> Value:
        """The product of two vectors, and one more vector added."""
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        call = self.builder.module.declare_intrinsic(f"llvm.fmuladd.v{LANES}f32", fnty=kind)
        return self.builder.call(call, [one, other, more])

    def less(self, from_: Value, one: Value, other: Value) -> Value:
        """The product of two vectors, taken off one more."""
        return self.times_and(self.builder.fsub(self.constant(0.0), one), other, from_)

    def constant(self, value: float) -> Value:
        """One number, known beforehand, in all places of a vector."""
        return ir.Constant(_VECTOR, [value] * LANES)

    def cut(self, one: Value, other: Value, begin: int) -> Value:
        """Sixteen numbers of two vectors, one after the other, from a place on."""
        order = ir.Constant(ir.VectorType(_INT, LANES), [begin + j for j in range(LANES)])
        return self.builder.shuffle_vector(one, other, order)

    def totals_of_four(self, vectors: list[Value]) -> list[Value]:
        """The sums of four vectors, halves first; in pairs, the first two in one vector of two, as the others."""
        one, other = (self._halves_added(vectors[k], vectors[k + 1], LANES // 2) for k in (0, 2))
        folded = self._folded(self._halves_added(one, other, LANES // 4), (2, 1))
        pairs = ((0, LANES // 4), (LANES // 2, 3 * LANES // 4))
        return [
            self.builder.shuffle_vector(folded, _ANY, ir.Constant(ir.VectorType(_INT, 2), list(pair))) for pair in pairs
        ]

    def _halves_added(self, one: Value, other: Value, far: int) -> Value:
        """Of stretches of twice `far` numbers the first half and the second added, of one vector and then of another."""
        first = [j for j in range(2 * LANES) if j // far % 2 == 0]
        kind = ir.VectorType(_INT, LANES)
        low, high = (ir.Constant(kind, [j + more for j in first]) for more in (0, far))
        return self.builder.fadd(
            self.builder.shuffle_vector(one, other, low), self.builder.shuffle_vector(one, other, high)
        )

    def totals_of_halves(self, vector: Value) -> tuple[Value, Value]:
        """The sums of the first and of the last eight of a vector."""
        folded = self._folded(vector, (4, 2, 1))
        first, second = (self.builder.extract_element(folded, ir.Constant(_INT, place)) for place in (0, LANES // 2))
        return first, second

    def _folded(self, vector: Value, distances: tuple[int, ...]) -> Value:
        """A vector to which those so many places on were added, turn by turn."""
        for far in distances:
            order = ir.Constant(ir.VectorType(_INT, LANES), [(j + far) % LANES for j in range(LANES)])
            vector = self.builder.fadd(vector, self.builder.shuffle_vector(vector, _ANY, order))
        return vector

    def call_for(self, array: Value, place: Value) -> None:
        """Tell the processor that this will be read soon; it may lie anywhere."""
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer(), _INT, _INT, _INT])
        call = self.builder.module.declare_intrinsic("llvm.prefetch.p0i8", fnty=kind)
        where = self.builder.bitcast(self.builder.gep(array, [place]), ir.IntType(8).as_pointer())
        self.builder.call(call, [where, *(ir.Constant(_INT, flag) for flag in (0, 3, 1))])

    def loop(self, count: Value, body: Callable[[Value], None]) -> None:
        with cgutils.for_range(self.builder, count) as loop:
            body(loop.index)

    def sums(self, count: int) -> list[Value]:
        """Vectors that loops add to, 0 to begin with."""
        rooms = [_room(self.builder, _VECTOR) for _ in range(count)]
        for room in rooms:
            self.builder.store(ir.Constant(_VECTOR, [0.0] * LANES), room)
        return rooms

    def add_product(self, room: Value, one: Value, other: Value) -> None:
        self.builder.store(self.times_and(one, other, self.builder.load(room)), room)


def _function(arguments: tuple[Any, ...], write: Callable[[_Writer], None]) -> Any:
    """Signature and code of a function that Numba can call."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Value:
        write(_Writer(context, builder, signature, values))
        return context.get_dummy_value()

    places = tuple(one if isinstance(one, types.Array) else types.intp for one in arguments)
    return types.void(*places), generate


def _interpolation(w: _Writer) -> None:
    picture, first, soon, taps, tap, window, place, rows = w.arguments
    weight = [w.spread(taps, w.plus(tap, k)) for k in range(INTERPOLATED_FROM)]
    last = _room(w.builder, _VECTOR)
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

    w.loop(w.builder.sdiv(rows, ir.Constant(_LONG, LANES)), lanes)


def _mixture(w: _Writer) -> None:
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


def _symmetric_filter(w: _Writer) -> None:
    wide, middle, taps, reach, out, place = w.arguments
    sums = w.sums(AT_ONCE)
    weight = w.spread(taps, ir.Constant(_LONG, 0))
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


def _power(w: _Writer) -> None:
    seen, first, form, begin, out, place = w.arguments
    sums = w.sums(AT_ONCE)

    def channel(c: Value) -> None:
        row = w.load(form, w.plus(begin, w.times(c, LANES)))
        for k, room in enumerate(sums):
            w.add_product(room, w.spread(seen, w.plus(w.plus(first, c), k * LANES)), row)

    w.loop(ir.Constant(_LONG, LANES), channel)
    for k, room in enumerate(sums):
        vector = w.builder.load(room)
        for half, total in enumerate(w.totals_of_halves(w.builder.fmul(vector, vector))):
            w.builder.store(total, w.builder.gep(out, [w.plus(place, 2 * k + half)]))


def _butterfly(radix: int) -> Callable[[_Writer], None]:
    """Transforms of so many complex lanes, with their twiddles, for many neighbours; see `lane_transform`."""

    def write(w: _Writer) -> None:
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


def _transformed(w: _Writer, seen: list[Complex]) -> list[Complex]:
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


def _turned(w: _Writer, one: Complex) -> Complex:
    """A complex vector times −i."""
    return one[1], w.builder.fsub(w.constant(0.0), one[0])


def _sum(w: _Writer, one: Complex, other: Complex) -> Complex:
    return w.builder.fadd(one[0], other[0]), w.builder.fadd(one[1], other[1])


def _difference(w: _Writer, one: Complex, other: Complex) -> Complex:
    return w.builder.fsub(one[0], other[0]), w.builder.fsub(one[1], other[1])


def _weighing(w: _Writer) -> None:
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
            b.store(pair, b.bitcast(at, ir.VectorType(_REAL, 2).as_pointer()), align=4)

    w.loop(b.sdiv(count, ir.Constant(_LONG, 2)), weigh)


def _folding(w: _Writer) -> None:
    bins, here, there, turn, place, z, into = w.arguments
    b = w.builder
    one, other = ((w.load(bins, at), w.load(bins, w.plus(at, LANES))) for at in (here, there))
    cosine, sine = w.spread(turn, place), w.spread(turn, w.plus(place, 1))
    even = (b.fadd(one[0], other[0]), b.fsub(one[1], other[1]))
    apart = (b.fsub(one[0], other[0]), b.fadd(one[1], other[1]))
    odd = (w.less(b.fmul(cosine, apart[0]), sine, apart[1]), w.times_and(sine, apart[0], b.fmul(cosine, apart[1])))
    w.store(b.fadd(even[1], odd[0]), z, into)
    w.store(b.fsub(even[0], odd[1]), z, w.plus(into, LANES))


@_compiled
def weigh_bin(_, z, here, there, turn, place, weights, begin, count, out, into):  # type: ignore[no-untyped-def]
    """Write sums over sixteen rows by some weights, of a bin that is in two places of `lane_transform.transform`.

    The weights are even in number.
    """
    return _function((z, here, there, turn, place, weights, begin, count, out, into), _weighing)


@_compiled
def fold_bin(_, bins, here, there, turn, place, z, into):  # type: ignore[no-untyped-def]
    """Write twice what `lane_transform.fold` says of a bin."""
    return _function((bins, here, there, turn, place, z, into), _folding)


@_compiled
def halves(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform pairs of complex lanes, `far` apart, into pairs `near` each other, for `count` neighbours."""
    return _function((source, here, far, twiddle, place, target, there, near, count), _butterfly(2))


@_compiled
def thirds(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform threes, as `halves` does pairs."""
    return _function((source, here, far, twiddle, place, target, there, near, count), _butterfly(3))


@_compiled
def quarters(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform fours, as `halves` does pairs."""
    return _function((source, here, far, twiddle, place, target, there, near, count), _butterfly(4))


@_compiled
def fifths(_, source, here, far, twiddle, place, target, there, near, count):  # type: ignore[no-untyped-def]
    """Transform fives, as `halves` does pairs."""
    return _function((source, here, far, twiddle, place, target, there, near, count), _butterfly(5))


@_compiled
def interpolate(_, picture, first, soon, taps, tap, window, place, rows):  # type: ignore[no-untyped-def]
    """Write rows of a window, a multiple of 16, each from ten rows of a picture by ten taps; 16 rows more are looked at."""
    return _function((picture, first, soon, taps, tap, window, place, rows), _interpolation)


@_compiled
def mix(_, picture, places, number, rows, mixture, begin, out, targets):  # type: ignore[no-untyped-def]
    """Write sixteen weighted sums of neighbouring rows of a picture, by a mixture [row, 16], for four places of it.

    `places` and `targets`, int64, say from a number on where the rows begin and where the sums go; the next four places are
    called for, and may lie anywhere.
    """
    return _function((picture, places, number, rows, mixture, begin, out, targets), _mixture)


@_compiled
def filter_symmetrically(_, wide, middle, taps, reach, out, place):  # type: ignore[no-untyped-def]
    """Write four columns of [column, 16], filtered along the columns by taps given from their middle on."""
    return _function((wide, middle, taps, reach, out, place), _symmetric_filter)


@_compiled
def power(_, seen, first, form, begin, out, place):  # type: ignore[no-untyped-def]
    """Write |zᵀ P|², of the first eight and of the last eight columns of P [16, 16], for four columns z of [column, 16]."""
    return _function((seen, first, form, begin, out, place), _power)
