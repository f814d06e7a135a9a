"""Room for pictures is given again, but never while anybody looks at what is in it."""

import threading

import numpy as np

from gramoscope.pickup.picture_room import MOST_KEPT, picture_room


def _place(room: np.ndarray) -> int:
    return int(room.ctypes.data)


def test_room_is_given_again_when_nobody_looks_at_it() -> None:
    room = picture_room(300, 200)
    assert room.shape == (300, 200)
    assert room.dtype == np.float32
    assert room.flags.c_contiguous
    assert _place(room) % 64 == 0
    place = _place(room)
    del room
    assert _place(picture_room(299, 200)) == place


def test_a_view_of_a_view_keeps_the_room() -> None:
    room = picture_room(310, 200)
    room[:] = 7
    part = room[10:200][:, 5:20].T[::2]
    del room
    others = [picture_room(310, 200) for _ in range(MOST_KEPT + 2)]
    for other in others:
        other[:] = 1
    assert (part == 7).all()
    assert len({_place(one) for one in (part, *others)}) == MOST_KEPT + 3


def test_more_pictures_than_are_kept_have_room_of_their_own() -> None:
    pictures = [picture_room(20, 30) for _ in range(3 * MOST_KEPT)]
    for number, picture in enumerate(pictures):
        picture[:] = number
    assert [picture.max() for picture in pictures] == list(range(3 * MOST_KEPT))


def test_room_that_is_too_small_or_far_too_large_is_not_given() -> None:
    place = _place(picture_room(50, 64))
    larger = picture_room(80, 64)
    larger[:] = 1
    assert larger.shape == (80, 64)
    del larger
    small = picture_room(3, 3)
    assert small.base is not None
    assert small.base.size < 200
    del small, place


def test_each_thread_has_rooms_of_its_own() -> None:
    here = picture_room(100, 100)
    here[:] = 1
    places = list[int]()

    def draw() -> None:
        for _ in range(5):
            room = picture_room(100, 100)
            room[:] = 2
            places.append(_place(room))
            del room

    thread = threading.Thread(target=draw)
    thread.start()
    thread.join()
    assert (here == 1).all()
    assert len(set(places)) == 1
