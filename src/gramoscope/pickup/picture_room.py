"""Room for pictures, which is given again when nobody looks at what was in it any more.

A picture has some megabytes. Room that is new is cleared by the system when it is written for the first time, page by page,
and that may take longer than drawing the picture. So each thread keeps the room of a few pictures.
"""

from __future__ import annotations

import threading
import weakref
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Float32Array

MOST_KEPT = 3
"""So many rooms each thread keeps: of a picture, of the same in another tone, and of the one before."""
LINE = 16
"""Numbers of single precision in a cache line."""


@dataclass(eq=False)
class _Room:
    """Memory of some size, where its first cache line begins, and the array by which it was lent."""

    memory: Float32Array
    begin: int
    lent: weakref.ref[npt.NDArray[np.float32]]


class _Kept(threading.local):
    def __init__(self) -> None:
        self.rooms: list[_Room] = []


_kept = _Kept()


def picture_room(columns: int, rows: int) -> Float32Array:
    """Return room for a picture, shape (column, row), with anything in it; it begins at a cache line.

    The room is kept for the next picture of this thread as soon as there is neither this array nor a view of it any more.
    """
    needed = columns * rows
    room = _free_room(needed + LINE)
    # views of an array that lies in no other array refer to that array, and not to the memory
    lent = np.frombuffer(room.memory.data, np.float32)
    room.lent = weakref.ref(lent)
    return lent[room.begin : room.begin + needed].reshape(columns, rows)


def _free_room(size: int) -> _Room:
    """Return a room that nobody looks at, of such a size; what is too small or far too large is given up."""
    for room in _kept.rooms:
        if room.lent() is None:
            if size <= room.memory.size <= 2 * size:
                return room
            _kept.rooms = [other for other in _kept.rooms if other is not room]
    memory = np.empty(size, np.float32)
    room = _Room(memory, -memory.ctypes.data // memory.itemsize % LINE, weakref.ref(memory))
    if len(_kept.rooms) < MOST_KEPT:
        _kept.rooms = [*_kept.rooms, room]
    return room
