"""Memory that begins at a cache line.

The vectors of a processor are as long as its cache lines. One that lies across two of them is read and written twice, and
memory that a library gives begins wherever it likes: the same kernel may take half as long again in the next process.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numba
import numpy as np
import numpy.typing as npt

LINE_BYTES = 64
Number = TypeVar("Number", bound=np.generic)


@numba.njit(cache=True, nogil=True)
def single_room(count):  # type: ignore[no-untyped-def]
    """Return room for so many numbers of single precision, with anything in it."""
    memory = np.empty(count + LINE_BYTES // 4, np.float32)
    begin = (LINE_BYTES - memory.ctypes.data % LINE_BYTES) % LINE_BYTES // 4
    return memory[begin : begin + count]


@numba.njit(cache=True, nogil=True)
def double_room(count):  # type: ignore[no-untyped-def]
    """Return room for so many numbers of double precision, with anything in it."""
    memory = np.empty(count + LINE_BYTES // 8, np.float64)
    begin = (LINE_BYTES - memory.ctypes.data % LINE_BYTES) % LINE_BYTES // 8
    return memory[begin : begin + count]


def at_a_line(values: npt.NDArray[Number]) -> npt.NDArray[Number]:
    """Return the same numbers, row by row, where a cache line begins."""
    memory: npt.NDArray[Any] = np.empty(values.nbytes + LINE_BYTES, np.uint8)
    begin = -memory.ctypes.data % LINE_BYTES
    there = memory[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    there[...] = values
    return there
