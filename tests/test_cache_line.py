"""Rooms begin at cache lines, wherever the memory lies that they are cut out of."""

import numpy as np
import pytest

from gramoscope.cache_line import LINE_BYTES, at_a_line, double_room, single_room


def _aside(values: np.ndarray) -> int:
    return int(values.ctypes.data % LINE_BYTES)


@pytest.mark.parametrize(("room", "kind"), [(single_room, np.float32), (double_room, np.float64)])
def test_room_is_as_large_as_asked_for_and_begins_at_a_line(room: object, kind: type) -> None:
    rooms = [room(count) for count in (*range(40), 1000, 100_003)]  # type: ignore[operator]
    assert [one.size for one in rooms] == [*range(40), 1000, 100_003]
    assert {one.dtype.type for one in rooms} == {kind}
    assert {_aside(one) for one in rooms if one.size} == {0}
    # none of them lies in another
    for number, one in enumerate(rooms):
        one[:] = number
    assert all((one == number).all() for number, one in enumerate(rooms))


@pytest.mark.parametrize("shape", [(0,), (7,), (3, 5, 7), (2, 8, 8)])
@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64])
def test_numbers_are_the_same_at_a_line(shape: tuple[int, ...], kind: type) -> None:
    values = np.random.default_rng(1).integers(0, 99, shape[::-1]).astype(kind).T
    there = at_a_line(values)
    np.testing.assert_array_equal(there, values)
    assert there.dtype == kind
    assert there.flags.c_contiguous
    assert there.flags.writeable
    assert there.size == 0 or _aside(there) == 0
    assert not np.shares_memory(there, values)
