"""Code about sixteen numbers of single precision as one vector of the processor: what a compiler does not find by itself.

Numba's loops over sixteen channels, or sixteen rows, are split where they need not be, and what they add up goes to memory and
comes back. Told that sixteen numbers are one vector, LLVM keeps sums in registers, whatever the processor has. Arrays are
C-contiguous and given with the place in them where to begin, counted in numbers, for making views costs as much as the work;
all lengths are in numbers too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16
REAL, LONG, INT = ir.FloatType(), ir.IntType(64), ir.IntType(32)
VECTOR = ir.VectorType(REAL, LANES)
BITS = ir.VectorType(INT, LANES)
ANY = ir.Constant(VECTOR, ir.Undefined)
_SAME = ir.Constant(ir.VectorType(INT, LANES), [0] * LANES)
Value = Any
"""Of LLVM, in the making."""
compiled: Any = intrinsic
"""Numba's own types count the context, which only the compiler gives, as an argument."""
room_for: Any = cgutils.alloca_once


class LaneWriter:
    """Writes code about arrays; `arguments` are those of the function, arrays as pointers."""

    def __init__(self, builder: Any, arguments: list[Value]) -> None:
        self.builder = builder
        self.arguments = arguments

    def plus(self, one: Value, other: Value | int) -> Value:
        """The sum of two whole numbers."""
        return self.builder.add(one, ir.Constant(LONG, other) if isinstance(other, int) else other)

    def times(self, one: Value, other: Value | int) -> Value:
        """The product of two whole numbers."""
        return self.builder.mul(one, ir.Constant(LONG, other) if isinstance(other, int) else other)

    def load(self, array: Value, place: Value) -> Value:
        """Sixteen numbers from a place on."""
        near = self.builder.bitcast(self.builder.gep(array, [place]), BITS.as_pointer())
        return self.builder.bitcast(self.builder.load(near, align=4), VECTOR)

    def whole(self, array: Value, place: Value) -> Value:
        """A whole number."""
        return self.builder.load(self.builder.gep(array, [place]))

    def store(self, value: Value, array: Value, place: Value) -> None:
        """Write sixteen numbers from a place on."""
        self.builder.store(value, self._at(array, place), align=4)

    def _at(self, array: Value, place: Value) -> Value:
        return self.builder.bitcast(self.builder.gep(array, [place]), VECTOR.as_pointer())

    def spread(self, array: Value, place: Value) -> Value:
        """One number, in all places of a vector."""
        value = self.builder.load(self.builder.gep(array, [place]))
        first = self.builder.insert_element(ANY, value, ir.Constant(INT, 0))
        return self.builder.shuffle_vector(first, ANY, _SAME)

    def times_and(self, one: Value, other: Value, more: Value) -> Value:
        """The product of two vectors, and one more vector added."""
        kind = ir.FunctionType(VECTOR, [VECTOR] * 3)
        call = self.builder.module.declare_intrinsic(f"llvm.fmuladd.v{LANES}f32", fnty=kind)
        return self.builder.call(call, [one, other, more])

    def less(self, from_: Value, one: Value, other: Value) -> Value:
        """The product of two vectors, taken off one more."""
        return self.times_and(self.builder.fneg(one), other, from_)

    def constant(self, value: float) -> Value:
        """One number, known beforehand, in all places of a vector."""
        return ir.Constant(VECTOR, [value] * LANES)

    def cut(self, one: Value, other: Value, begin: int) -> Value:
        """Sixteen numbers of two vectors, one after the other, from a place on.

        As bits, for which processors have an instruction that shifts; numbers are looked up one by one, which takes longer.
        """
        b = self.builder
        order = ir.Constant(BITS, [begin + j for j in range(LANES)])
        return b.bitcast(b.shuffle_vector(b.bitcast(one, BITS), b.bitcast(other, BITS), order), VECTOR)

    def totals_of_four(self, vectors: list[Value]) -> list[Value]:
        """The sums of four vectors, halves first; in pairs, the first two in one vector of two, as the others."""
        one, other = (self._halves_added(vectors[k], vectors[k + 1], LANES // 2) for k in (0, 2))
        folded = self._folded(self._halves_added(one, other, LANES // 4), (2, 1))
        pairs = ((0, LANES // 4), (LANES // 2, 3 * LANES // 4))
        return [
            self.builder.shuffle_vector(folded, ANY, ir.Constant(ir.VectorType(INT, 2), list(pair))) for pair in pairs
        ]

    def _halves_added(self, one: Value, other: Value, far: int) -> Value:
        """Of stretches of twice `far` numbers the first half and the second added, of one vector and then of another."""
        first = [j for j in range(2 * LANES) if j // far % 2 == 0]
        kind = ir.VectorType(INT, LANES)
        low, high = (ir.Constant(kind, [j + more for j in first]) for more in (0, far))
        return self.builder.fadd(
            self.builder.shuffle_vector(one, other, low), self.builder.shuffle_vector(one, other, high)
        )

    def totals_of_halves(self, vector: Value) -> tuple[Value, Value]:
        """The sums of the first and of the last eight of a vector."""
        folded = self._folded(vector, (4, 2, 1))
        first, second = (self.builder.extract_element(folded, ir.Constant(INT, place)) for place in (0, LANES // 2))
        return first, second

    def _folded(self, vector: Value, distances: tuple[int, ...]) -> Value:
        """A vector to which those so many places on were added, turn by turn."""
        for far in distances:
            order = ir.Constant(ir.VectorType(INT, LANES), [(j + far) % LANES for j in range(LANES)])
            vector = self.builder.fadd(vector, self.builder.shuffle_vector(vector, ANY, order))
        return vector

    def turned(self, rows: list[Value]) -> list[Value]:
        """Sixteen rows of sixteen columns as columns (J. O. Eklundh, 1972)."""
        rows, far, kind = list(rows), LANES // 2, ir.VectorType(INT, LANES)
        while far:
            order = [k if not k & far else LANES + k - far for k in range(LANES)]
            low, high = (ir.Constant(kind, [k + more for k in order]) for more in (0, far))
            for j in range(LANES):
                if not j & far:
                    one, other = rows[j], rows[j + far]
                    rows[j] = self.builder.shuffle_vector(one, other, low)
                    rows[j + far] = self.builder.shuffle_vector(one, other, high)
            far //= 2
        return rows

    def call_for(self, array: Value, place: Value) -> None:
        """Tell the processor that this will be read soon; it may lie anywhere."""
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer(), INT, INT, INT])
        call = self.builder.module.declare_intrinsic("llvm.prefetch.p0i8", fnty=kind)
        where = self.builder.bitcast(self.builder.gep(array, [place]), ir.IntType(8).as_pointer())
        self.builder.call(call, [where, *(ir.Constant(INT, flag) for flag in (0, 3, 1))])

    def loop(self, count: Value, body: Callable[[Value], None]) -> None:
        """Repeat something for 0, 1, … as often as told."""
        with cgutils.for_range(self.builder, count) as loop:
            body(loop.index)

    def sums(self, count: int) -> list[Value]:
        """Vectors that loops add to, 0 to begin with."""
        rooms = [room_for(self.builder, VECTOR) for _ in range(count)]
        for room in rooms:
            self.builder.store(ir.Constant(VECTOR, [0.0] * LANES), room)
        return rooms

    def add_product(self, room: Value, one: Value, other: Value) -> None:
        """Add the product of two vectors to a sum."""
        self.builder.store(self.times_and(one, other, self.builder.load(room)), room)


def function(arguments: tuple[Any, ...], write: Callable[[LaneWriter], None], *, apart: str = "") -> Any:
    """Signature and code of a function that Numba can call.

    Code that stands `apart`, under a name of its own, is not mixed with what calls it: the compiler would move what the loops
    of both have in common to memory, where vectors wait for it.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Value:
        given = [
            context.make_array(kind)(context, builder, value).data
            if isinstance(kind, types.Array)
            else context.cast(builder, value, kind, types.intp)
            for kind, value in zip(signature.args, values, strict=True)
        ]
        if apart:
            builder.call(_standing_apart(builder.module, apart, [value.type for value in given], write), given)
        else:
            write(LaneWriter(builder, given))
        return context.get_dummy_value()

    places = tuple(one if isinstance(one, types.Array) else types.intp for one in arguments)
    return types.void(*places), generate


def _standing_apart(module: Any, name: str, kinds: list[Any], write: Callable[[LaneWriter], None]) -> Value:
    if name in module.globals:
        return module.globals[name]
    made = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name)
    made.linkage = "internal"
    made.attributes.add("noinline")
    builder = ir.IRBuilder(made.append_basic_block())
    write(LaneWriter(builder, list(made.args)))
    builder.ret_void()
    return made
