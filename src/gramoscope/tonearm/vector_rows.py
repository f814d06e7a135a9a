"""Matrices of 8 × 8 whose rows are vectors of the processor: what a compiler does not find by itself.

Numba's loops over eight numbers become eight scalar instructions each; told that a row is one vector, LLVM makes one or two of
them, whatever the processor has, and a product takes a fifth of the time. Each matrix, and each vector, is given by an array of
float64 and the row and the column of it where it begins, for making views costs as much as a product; of an array with one
dimension the row is 0. The rows of an array lie in one piece each. A number by which rows are multiplied comes first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

STATES = 8
"""Length of a row."""
PARTS = (range(1, 5), range(5, 8))
"""Of a state: what moves by itself, but for the first number of all, which all others move."""
COUPLED = (range(STATES), *[(0, *part) for part in PARTS for _ in part])
"""Columns of a transition, or of its transpose, that are not zero, for each of its rows."""
_DOUBLE, _LONG, _INT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_ROW = ir.VectorType(_DOUBLE, STATES)
_ANY = ir.Constant(_ROW, ir.Undefined)
_EACH = range(STATES)
Value = Any
"""Of LLVM, in the making."""
compiled: Any = intrinsic
"""Numba's own types count the context, which only the compiler gives, as an argument."""


class Writer:
    """Writes code about the rows of matrices, which are counted 0, 1, … in the order of the arguments."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self.builder = builder
        self._matrices = []
        first = len(arguments) % 3
        self.numbers = [context.cast(builder, arguments[i], signature.args[i], types.float64) for i in range(first)]
        for i in range(first, len(arguments), 3):
            array = context.make_array(signature.args[i])(context, builder, arguments[i])
            row, column = (context.cast(builder, arguments[i + k], signature.args[i + k], types.intp) for k in (1, 2))
            stride = builder.extract_value(array.strides, 0)
            there = builder.add(builder.mul(row, stride), builder.mul(column, ir.Constant(_LONG, 8)))
            begin = builder.gep(builder.bitcast(array.data, ir.IntType(8).as_pointer()), [there])
            self._matrices.append((begin, stride))

    def _row(self, matrix: int, row: int) -> Value:
        begin, stride = self._matrices[matrix]
        return self.builder.gep(begin, [self.builder.mul(stride, ir.Constant(_LONG, row))]) if row else begin

    def _part(self, matrix: int, row: int, part: int) -> Value:
        return self.builder.gep(
            self.builder.bitcast(self._row(matrix, row), _ROW.as_pointer()), [ir.Constant(_LONG, part)]
        )

    def load(self, matrix: int, row: int = 0, part: int = 0) -> Value:
        """A row, or a later one that lies in the same piece."""
        return self.builder.load(self._part(matrix, row, part), align=8)

    def store(self, value: Value, matrix: int, row: int = 0, part: int = 0) -> None:
        """Write a row."""
        self.builder.store(value, self._part(matrix, row, part), align=8)

    def spread(self, matrix: int, row: int, column: int) -> Value:
        """One element, in all places of a row."""
        begin = self.builder.bitcast(self._row(matrix, row), _DOUBLE.as_pointer())
        return self.everywhere(self.builder.load(self.builder.gep(begin, [ir.Constant(_LONG, column)])))

    def everywhere(self, value: Value) -> Value:
        """A number, in all places of a row."""
        return self.choose(self.builder.insert_element(_ANY, value, ir.Constant(_INT, 0)), _ANY, [0] * STATES)

    def number(self, value: float) -> Value:
        """A number that is known beforehand, in all places of a row."""
        return ir.Constant(_ROW, [value] * STATES)

    def choose(self, one: Value, other: Value, which: list[int]) -> Value:
        """Elements of two rows; those of the other count from 8."""
        mask = ir.Constant(ir.VectorType(_INT, STATES), [ir.Constant(_INT, i) for i in which])
        return self.builder.shuffle_vector(one, other, mask)

    def times_and(self, one: Value, other: Value, more: Value) -> Value:
        """The product of two rows, and one more row added."""
        kind = ir.FunctionType(_ROW, [_ROW] * 3)
        call = self.builder.module.declare_intrinsic(f"llvm.fmuladd.v{STATES}f64", fnty=kind)
        return self.builder.call(call, [one, other, more])

    def transposed(self, rows: list[Value]) -> list[Value]:
        """Exchange halves, then quarters, then neighbours."""
        rows = list(rows)
        for far in (4, 2, 1):
            for i in [i for i in _EACH if not i & far]:
                one, other = rows[i], rows[i + far]
                rows[i] = self.choose(one, other, [STATES + j - far if j & far else j for j in _EACH])
                rows[i + far] = self.choose(one, other, [STATES + j if j & far else j + far for j in _EACH])
        return rows

    def less(self, one: Value, other: Value) -> Value:
        """Where one row is less than the other; nowhere where either is NaN."""
        return self.builder.fcmp_ordered("<", one, other)

    def total(self, row: Value) -> Value:
        """The sum of a row."""
        for far in (4, 2, 1):
            row = self.builder.fadd(row, self.choose(row, _ANY, [(j + far) % STATES for j in _EACH]))
        return self.builder.extract_element(row, ir.Constant(_INT, 0))


def function(result: Any, arguments: tuple[Any, ...], write: Callable[[Writer], Value]) -> Any:
    """Signature and code of a function that Numba can call."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Value:
        written = write(Writer(context, builder, signature, values))
        return context.get_dummy_value() if written is None else written

    return result(*arguments), generate


def _matrix_product(write: Writer) -> None:
    x = [write.load(1, k) for k in _EACH]
    for i in _EACH:
        total = write.builder.fmul(write.spread(0, i, 0), x[0])
        for k in _EACH[1:]:
            total = write.times_and(write.spread(0, i, k), x[k], total)
        write.store(total, 2, i)


def _sandwich(write: Writer, a: int, b: int, x: int) -> list[Value]:
    """The rows of b (a x)ᵀ for transitions a and b; what is zero in them is left out."""

    def moved(matrix: int, rows: list[Value]) -> list[Value]:
        out = []
        for i in _EACH:
            total = write.builder.fmul(write.spread(matrix, i, 0), rows[0])
            for k in COUPLED[i][1:]:
                total = write.times_and(write.spread(matrix, i, k), rows[k], total)
            out.append(total)
        return out

    return moved(b, write.transposed(moved(a, [write.load(x, k) for k in _EACH])))


def _square_sandwich(write: Writer) -> None:
    """Made symmetric by what is on and above the diagonal: products that the other order has on and below it."""
    rows = _sandwich(write, 0, 0, 1)
    for i, column in enumerate(write.transposed(rows)):
        write.store(write.choose(column, rows[i], [j if j <= i else STATES + j for j in _EACH]), 2, i)


def _cross_sandwich(write: Writer) -> None:
    rows = _sandwich(write, 0, 1, 2)
    for i, column in enumerate(write.transposed(rows)):
        write.store(column, 3, i)
        write.store(rows[i], 4, i)


def _vector_product(write: Writer) -> None:
    even, odd = write.load(2), write.builder.fmul(write.spread(0, 0, 1), write.load(1, 1))
    for k in _EACH[::2]:
        even = write.times_and(write.spread(0, 0, k), write.load(1, k), even)
    for k in _EACH[3::2]:
        odd = write.times_and(write.spread(0, 0, k), write.load(1, k), odd)
    write.store(write.builder.fadd(even, odd), 2)


def _quadratic_form(write: Writer) -> Value:
    """Both halves of the product at once, each as two sums: nothing waits for what it has just written."""
    halves = 2
    h = [write.spread(0, 0, k) for k in range(halves * STATES)]
    seen = []
    for c in range(halves):
        even, odd = (write.builder.fmul(h[k], write.load(1, k, c)) for k in range(2))
        for k in range(2, halves * STATES, 2):
            even = write.times_and(h[k], write.load(1, k, c), even)
            odd = write.times_and(h[k + 1], write.load(1, k + 1, c), odd)
        both = write.builder.fadd(even, odd)
        write.store(both, 2, 0, c)
        seen.append(write.builder.fmul(both, write.load(0, 0, c)))
    return write.total(write.builder.fadd(*seen))


def _outer_product(write: Writer) -> None:
    y = write.load(1)
    for i in _EACH:
        write.store(write.times_and(write.spread(0, 0, i), y, write.load(2, i)), 2, i)


def _multiple(write: Writer) -> None:
    write.store(write.builder.fmul(write.everywhere(write.numbers[0]), write.load(0)), 1)


def _sum_with_multiple(write: Writer) -> None:
    write.store(write.times_and(write.everywhere(write.numbers[0]), write.load(0), write.load(1)), 1)


def _inner_product(write: Writer) -> Value:
    return write.total(write.builder.fmul(write.load(0), write.load(1)))


def _transposition(write: Writer) -> None:
    for i, row in enumerate(write.transposed([write.load(0, k) for k in _EACH])):
        write.store(row, 1, i)


@compiled
def multiply(_, a, a_row, a_column, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write a x; the result may lie where a does."""
    return function(types.void, (a, a_row, a_column, x, x_row, x_column, out, row, column), _matrix_product)


@compiled
def sandwich_across(_, a, a_row, a_column, b, b_row, b_column, x, x_row, x_column, out, row, column, turned, turned_row, turned_column):  # type: ignore  # fmt: skip  # noqa: E501
    """Write a x bᵀ for transitions, or their transposes (`COUPLED`), and its own transpose."""
    rows = (a, a_row, a_column, b, b_row, b_column, x, x_row, x_column)
    return function(types.void, (*rows, out, row, column, turned, turned_row, turned_column), _cross_sandwich)


@compiled
def sandwich(_, a, a_row, a_column, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write a x aᵀ for a symmetric x and a transition a, or its transpose (`COUPLED`)."""
    return function(types.void, (a, a_row, a_column, x, x_row, x_column, out, row, column), _square_sandwich)


@compiled
def add_row_times(_, h, h_row, h_column, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Add the vector h x to another."""
    return function(types.void, (h, h_row, h_column, x, x_row, x_column, out, row, column), _vector_product)


@compiled
def quadratic_form(_, h, h_row, h_column, p, p_row, p_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write p h for a symmetric p of 16 × 16 and a vector of as many, and return hᵀ p h."""
    return function(types.float64, (h, h_row, h_column, p, p_row, p_column, out, row, column), _quadratic_form)


@compiled
def add_outer(_, x, x_row, x_column, y, y_row, y_column, out, row, column):  # type: ignore[no-untyped-def]
    """Add the matrix x yᵀ to another."""
    return function(types.void, (x, x_row, x_column, y, y_row, y_column, out, row, column), _outer_product)


@compiled
def multiple(_, c, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write the vector c x; the result may lie where x does."""
    return function(types.void, (c, x, x_row, x_column, out, row, column), _multiple)


@compiled
def add_multiple(_, c, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Add the vector c x to another."""
    return function(types.void, (c, x, x_row, x_column, out, row, column), _sum_with_multiple)


@compiled
def inner(_, x, x_row, x_column, y, y_row, y_column):  # type: ignore[no-untyped-def]
    """Return x·y."""
    return function(types.float64, (x, x_row, x_column, y, y_row, y_column), _inner_product)


@compiled
def transpose(_, x, x_row, x_column, out, row, column):  # type: ignore[no-untyped-def]
    """Write xᵀ."""
    return function(types.void, (x, x_row, x_column, out, row, column), _transposition)
