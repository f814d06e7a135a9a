"""Room for pictures, which is given again when nobody looks at what was in it any more.

A picture has some megabytes. Room that is new is cleared by the system when it is written for the first time, page by page,
and that may take longer than drawing the picture. So each thread keeps the room of a few pictures.
"""

from __future__ import annotations

import threading
import weakref

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Float32Array

MOST_KEPT = 3
"""So many rooms each thread keeps: of a picture, of the same in another tone, and of the one before."""
LINE = 16
"""Numbers of single precision in a cache line."""


class _Kept(threading.local):
    def __init__(self) -> None:
        self.rooms: list[tuple[Float32Array, weakref.ref[npt.NDArray[np.float32]]]] = []


_kept = _Kept()


def picture_room(columns: int, rows: int) -> Float32Array:
    """Return room for a picture, shape (column, row), with anything in it; it begins at a cache line.

    The room is kept for the next picture of this thread as soon as there is neither this array nor a view of it any more.
    """
    size = columns * rows + LINE
    _kept.rooms = [
        (memory, lent) for memory, lent in _kept.rooms if lent() is not None or size <= memory.size <= 2 * size
    ]
    memory = next((memory for memory, lent in _kept.rooms if lent() is None), None)
    _kept.rooms = [(other, lent) for other, lent in _kept.rooms if other is not memory]
    if memory is None:
        memory = np.empty(size, np.float32)
    # views of an array that lies in no other array refer to that array, and not to the memory
    room = np.frombuffer(memory.data, np.float32)
    if len(_kept.rooms) < MOST_KEPT:
        _kept.rooms.append((memory, weakref.ref(room)))
    begin = -room.ctypes.data // room.itemsize % LINE
    return room[begin : begin + columns * rows].reshape(columns, rows)
