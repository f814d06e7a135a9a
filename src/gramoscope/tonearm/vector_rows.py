"""Matrices of 8 × 8 whose rows are vectors of the processor: what a compiler does not find by itself.

Numba's loops over eight numbers become eight scalar instructions each; told that a row is one vector, LLVM makes one or two of
them, whatever the processor has, and a product takes a quarter of the time. All matrices are float64 with their rows in one
piece each, and may be parts of larger ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

STATES = 8
"""Length of a row."""
_DOUBLE, _LONG, _INT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_ROW = ir.VectorType(_DOUBLE, STATES)
_ANY = ir.Constant(_ROW, ir.Undefined)
Value = Any
"""Of LLVM, in the making."""


class _Writer:
    """Writes code about the rows of its arguments."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self.builder = builder
        arrays = zip(signature.args, arguments, strict=True)
        self._arrays = [context.make_array(kind)(context, builder, value) for kind, value in arrays]

    def _row(self, number: int, row: int) -> Value:
        """Where a row of an argument, or a vector, begins."""
        array = self._arrays[number]
        begin = self.builder.bitcast(array.data, ir.IntType(8).as_pointer())
        stride = cgutils.unpack_tuple(self.builder, array.strides)[0]
        return self.builder.gep(begin, [self.builder.mul(stride, ir.Constant(_LONG, row))]) if row else begin

    def load(self, number: int, row: int = 0) -> Value:
        return self.builder.load(self.builder.bitcast(self._row(number, row), _ROW.as_pointer()), align=8)

    def store(self, value: Value, number: int, row: int = 0) -> None:
        self.builder.store(value, self.builder.bitcast(self._row(number, row), _ROW.as_pointer()), align=8)

    def spread(self, number: int, row: int, column: int) -> Value:
        """One element, in all places of a row."""
        begin = self.builder.bitcast(self._row(number, row), _DOUBLE.as_pointer())
        value = self.builder.load(self.builder.gep(begin, [ir.Constant(_LONG, column)]))
        first = self.builder.insert_element(_ANY, value, ir.Constant(_INT, 0))
        return self.choose(first, _ANY, [0] * STATES)

    def choose(self, one: Value, other: Value, which: list[int]) -> Value:
        """Elements of two rows; those of the other count from 8."""
        mask = ir.Constant(ir.VectorType(_INT, STATES), [ir.Constant(_INT, i) for i in which])
        return self.builder.shuffle_vector(one, other, mask)

    def times_and(self, one: Value, other: Value, more: Value) -> Value:
        """one · other + more."""
        kind = ir.FunctionType(_ROW, [_ROW] * 3)
        call = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.fmuladd.v{STATES}f64")
        return self.builder.call(call, [one, other, more])

    def transposed(self, rows: list[Value]) -> list[Value]:
        """Exchange halves, then quarters, then neighbours."""
        rows, columns = list(rows), range(STATES)
        for far in (4, 2, 1):
            for i in [i for i in columns if not i & far]:
                one, other = rows[i], rows[i + far]
                rows[i] = self.choose(one, other, [STATES + j - far if j & far else j for j in columns])
                rows[i + far] = self.choose(one, other, [STATES + j if j & far else j + far for j in columns])
        return rows


def _written(write: Callable[[_Writer], None]) -> Any:
    """Turn what writes code into a function that Numba can call."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Value:
        write(_Writer(context, builder, signature, arguments))
        return context.get_dummy_value()

    return generate


def _matrix_product(write: _Writer) -> None:
    x = [write.load(1, k) for k in range(STATES)]
    for i in range(STATES):
        total = write.builder.fmul(write.spread(0, i, 0), x[0])
        for k in range(1, STATES):
            total = write.times_and(write.spread(0, i, k), x[k], total)
        write.store(total, 2, i)


def _vector_product(write: _Writer) -> None:
    even, odd = write.load(2), write.builder.fmul(write.spread(0, 0, 1), write.load(1, 1))
    for k in range(0, STATES, 2):
        even = write.times_and(write.spread(0, 0, k), write.load(1, k), even)
    for k in range(3, STATES, 2):
        odd = write.times_and(write.spread(0, 0, k), write.load(1, k), odd)
    write.store(write.builder.fadd(even, odd), 2)


def _outer_product(write: _Writer) -> None:
    y = write.load(1)
    for i in range(STATES):
        write.store(write.times_and(write.spread(0, 0, i), y, write.load(2, i)), 2, i)


def _transposition(write: _Writer) -> None:
    for i, row in enumerate(write.transposed([write.load(0, k) for k in range(STATES)])):
        write.store(row, 1, i)


def _symmetry(write: _Writer) -> None:
    rows = [write.load(0, k) for k in range(STATES)]
    for i, column in enumerate(write.transposed(rows)):
        write.store(write.choose(rows[i], column, [j if j <= i else STATES + j for j in range(STATES)]), 0, i)


@intrinsic
def multiply(_, a, x, out):  # type: ignore[no-untyped-def]
    """Write a x."""
    return types.void(a, x, out), _written(_matrix_product)


@intrinsic
def add_row_times(_, h, x, out):  # type: ignore[no-untyped-def]
    """Add h x to `out`, h and `out` being vectors."""
    return types.void(h, x, out), _written(_vector_product)


@intrinsic
def add_outer(_, x, y, out):  # type: ignore[no-untyped-def]
    """Add x yᵀ to `out`."""
    return types.void(x, y, out), _written(_outer_product)


@intrinsic
def transpose(_, x, out):  # type: ignore[no-untyped-def]
    """Write xᵀ."""
    return types.void(x, out), _written(_transposition)


@intrinsic
def mirror(_, x):  # type: ignore[no-untyped-def]
    """Make x symmetric, by what is on and below its diagonal."""
    return types.void(x), _written(_symmetry)
