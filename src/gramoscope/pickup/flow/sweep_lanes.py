"""Sweeps of Horn and Schunck, sixteen points as one vector of the processor, over memory laid out for them.

**Arithmetic.** With a = α² + β² and b = α² + γ² (see `horn_schunck`) and both fields times the roots of these, U = √a u and
V = √b v, the same three numbers of a point turn means into fields:

    U ← M − p e,    V ← N − q e,    e = p M + q N + r,    (p, q, r) = (I_x/√a, I_y/√b, I_t) / √(1 + I_x²/a + I_y²/b).

The means come of sums over rows, which three rows share: with the pair d = west + east and t = d + k · middle,

    M = c (t_above + t_below + 2 d) + lift,    c = α²/(12 a),    k = 2 + 6 β²/α²,

and N the same with α²/(12 b), k = 2 and no lift. That is 14 sums, products or both at once for both fields of a point.

**Lanes.** A row is cut into sixteen stretches, one for each lane of a vector, so that vector n holds the n-th point of each.
What lies beside these points are the vectors before and behind, and no number changes its lane (T. Henretty et al., Compiler
Construction, 2011). Only the first and the last vector of a row look across a seam. Where a row is no multiple of sixteen long,
neighbouring stretches have a point in common, which both make of the same numbers.

**Memory.** A strip of `STRIP` vectors has its rows one behind the other, each with all that a sweep needs: U and V of the
sweeps of even number, U and V of odd number, p, q and r. So ten rows of a strip are ten pages of memory, not seventy, and a row
is one cache line longer than what lies in it, or all rows would compete for the same lines of the cache.

**Order.** A sweep may follow the one before it at a distance of one row and one vector: then all that it reads is there, and
what it writes over has been read. `ROWS` rows of a few sweeps go along the picture together, close behind each other, each
shorter by a vector at either end than the one before it, as seams must wait for the other end of the row; then the ends; then
the next few sweeps, a little higher up; then the next rows. Each point is made from the same numbers as if one sweep waited for
the other, and comes out the same to the last bit. (L. Lamport, CACM 17, 83, 1974; D. Wonnacott, IPDPS, 2000.)
"""

from __future__ import annotations

import numba
import numpy as np
from llvmlite import ir

from gramoscope.pickup.lane_writer import (
    BITS,
    LANES,
    LONG,
    VECTOR,
    LaneWriter,
    Value,
    compiled,
    function,
    room_for,
)

STRIP = 8
"""Vectors side by side in a strip."""
FIELD = STRIP * LANES
"""Numbers of one kind in a row of a strip."""
KINDS = 7
ROW = KINDS * FIELD + LANES
"""Numbers from a row of a strip to the next."""
ROWS = 8
"""So many rows go along the picture at a time: what a few sweeps of them need stays in the cache nearest to the core."""
CLOSE = 3
"""So many sweeps go along together."""
CALLED_FOR = 3
"""Lines of the cache that are called for with each vector of `ROWS` rows: by the time that they are needed all have come."""
SEAMS = 4
"""Of a row: lanes that give the next lane the last point but one, for they share the last one; lanes with none to the west;
lanes that give the lane before their second point; lanes with none to the east."""


def _whole(number: int) -> Value:
    return ir.Constant(LONG, number)


def _lanes(w: LaneWriter, seams: Value, kind: int) -> Value:
    """Which lanes are of a kind."""
    b = w.builder
    told = b.load(b.bitcast(b.gep(seams, [_whole(kind * LANES)]), BITS.as_pointer()), align=4)
    return b.icmp_signed("!=", told, ir.Constant(BITS, [0] * LANES))


def _sweep(w: LaneWriter) -> None:
    """Sweeps of some rows; if told of seams, vectors that look across them, too."""
    room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, *ends = w.arguments
    b = w.builder
    steep, mean_u, mean_v = (w.spread(weights, _whole(k)) for k in range(3))
    two = w.constant(2.0)
    sums = [room_for(b, VECTOR) for _ in range(6)]
    if ends:
        vectors, seams = ends
        second_west, no_west, second_east, no_east = (_lanes(w, seams, kind) for kind in range(SEAMS))

    def piece(t: Value, s: Value) -> None:
        here = b.sub(w.plus(column, t), s)
        west, middle, east = (w.whole(places, w.plus(here, k)) for k in range(3))
        y = b.sub(top, s)
        down = w.times(y, ROW)
        kind = w.times(b.and_(w.plus(s, odd), _whole(1)), 2 * FIELD)
        old, new = w.plus(down, kind), w.plus(w.plus(down, 2 * FIELD), b.neg(kind))
        line = w.plus(soon, w.times(w.plus(w.times(t, sweeps), s), CALLED_FOR * LANES))
        for k in range(CALLED_FOR):
            w.call_for(room, w.plus(line, k * LANES))

        def beside(at: Value, own: Value) -> tuple[Value, Value]:
            """The vectors of the points to the west and to the east."""
            a, e = (w.load(room, w.plus(at, place)) for place in (west, east))
            if not ends:
                return a, e
            first, last = b.icmp_signed("==", here, _whole(0)), b.icmp_signed("==", w.plus(here, 1), vectors)
            # the sentinels before the first place and behind the last are those of the row's other end
            before = w.load(room, w.plus(at, w.whole(places, b.select(first, w.plus(vectors, -1), here))))
            after = w.load(room, w.plus(at, w.whole(places, b.select(last, _whole(2), here))))
            before, after = b.select(second_west, before, a), b.select(second_east, after, e)
            across = w.cut(before, before, LANES - 1), w.cut(after, after, 1)
            return (
                b.select(first, b.select(no_west, own, across[0]), a),
                b.select(last, b.select(no_east, own, across[1]), e),
            )

        def row(far: Value) -> list[Value]:
            """Of a row of U and of V: the sum of three, and of the pair."""
            found = []
            for field, share in ((0, steep), (FIELD, two)):
                at = w.plus(w.plus(old, far), field)
                own = w.load(room, w.plus(at, middle))
                pair = b.fadd(*beside(at, own))
                found += [w.times_and(share, own, pair), pair]
            return found

        before, now = row(above), row(_whole(0))
        for place, value in zip(sums, (before[0], now[0], now[1], before[2], now[2], now[3]), strict=True):
            b.store(value, place)

        def point(k: Value) -> None:
            u_above, u_here, u_pair, v_above, v_here, v_pair = (b.load(place) for place in sums)
            far = w.times(k, ROW)
            is_last = b.icmp_signed("==", k, w.plus(rows, -1))
            after = row(w.plus(far, b.select(is_last, below, _whole(ROW))))
            for place, value in zip(sums, (u_here, *after[:2], v_here, *after[2:]), strict=True):
                b.store(value, place)
            u = w.times_and(two, u_pair, b.fadd(u_above, after[0]))
            v = w.times_and(two, v_pair, b.fadd(v_above, after[2]))
            u, v = w.times_and(mean_u, u, w.spread(lift, w.plus(y, k))), b.fmul(mean_v, v)
            known = w.plus(w.plus(down, middle), far)
            p, q, r = (w.load(room, w.plus(known, (4 + n) * FIELD)) for n in range(3))
            error = w.times_and(p, u, w.times_and(q, v, r))
            into = w.plus(w.plus(new, middle), far)
            w.store(w.less(u, p, error), room, into)
            w.store(w.less(v, q, error), room, w.plus(into, FIELD))

        w.loop(rows, point)

    w.loop(columns, lambda t: w.loop(sweeps, lambda s: piece(t, s)))


@compiled
def sweep_columns(_, room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon):  # type: ignore[no-untyped-def]
    """Sweep so many `rows` from row `top` on, along so many `columns` of vectors, by so many `sweeps` close behind each other.

    Each sweep is one row higher and one vector behind the one before it. `places` says where each vector's strip and place in
    it begin, with one more at either end; `weights` are k, c and that of V; `odd` whether the first sweep reads the fields of
    odd number; `above` and `below` how far the rows beyond lie; `soon` what is to be called for.
    """
    arguments = (room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon)
    return function(arguments, _sweep, apart="gramoscope_sweep_columns")


@compiled
def sweep_end(_, room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, vectors, seams):  # type: ignore[no-untyped-def]  # fmt: skip
    """Do the same with vectors that may be the first or the last of so many in a row."""
    arguments = (room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, vectors, seams)  # fmt: skip  # noqa: E501
    return function(arguments, _sweep, apart="gramoscope_sweep_end")


@compiled
def write_vectors(_, row, starts, first, room, place, far):  # type: ignore[no-untyped-def]
    """Write sixteen vectors from a place on, the last eight so `far` behind: points `first` … of all stretches of a row."""

    def write(w: LaneWriter) -> None:
        row, starts, first, room, place, far = w.arguments
        stretches = [w.load(row, w.plus(w.whole(starts, _whole(lane)), first)) for lane in range(LANES)]
        for n, vector in enumerate(w.turned(stretches)):
            w.store(vector, room, _nth(w, place, far, n))

    return function((row, starts, first, room, place, far), write, apart="gramoscope_write_vectors")


@compiled
def read_vectors(_, row, starts, first, room, place, far):  # type: ignore[no-untyped-def]
    """Read them back; the last stretch that holds a point has the last word."""

    def read(w: LaneWriter) -> None:
        row, starts, first, room, place, far = w.arguments
        vectors = [w.load(room, _nth(w, place, far, n)) for n in range(LANES)]
        for lane, stretch in enumerate(w.turned(vectors)):
            w.store(stretch, row, w.plus(w.whole(starts, _whole(lane)), first))

    return function((row, starts, first, room, place, far), read, apart="gramoscope_read_vectors")


def _nth(w: LaneWriter, place: Value, far: Value, number: int) -> Value:
    """Where the n-th of sixteen vectors lies that are halves of two strips."""
    beside = number % STRIP * LANES
    return w.plus(place, beside) if number < STRIP else w.plus(w.plus(place, far), beside)


@numba.njit(cache=True, nogil=True)
def _stretches(width, seams):  # type: ignore[no-untyped-def]
    """Where the stretches of a row begin, and how many points each has; what lies beside their ends is written to `seams`."""
    vectors = (width + LANES - 1) // LANES
    starts = np.empty(LANES, np.int64)
    for lane in range(LANES):
        starts[lane] = lane * (width - vectors) // (LANES - 1) if width >= LANES else max(0, lane + width - LANES)
    seams[:] = 0
    for lane in range(LANES):
        shared = starts[lane] - starts[lane - 1] < vectors
        if lane > 0 and shared:
            seams[0, lane - 1] = seams[2, lane] = 1
        seams[1, lane] = starts[lane] == 0
        seams[3, lane] = starts[lane] + vectors == width
    return starts, vectors


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _write_known(ix, iy, it, per_u, per_v, starts, vectors, room):  # type: ignore[no-untyped-def]
    """Write p, q and r into the rows of the strips, and fields of zero."""
    root_u, root_v, one = np.sqrt(per_u), np.sqrt(per_v), np.float32(1)
    height, width = ix.shape
    rows = room.reshape(-1, ROW)
    known = np.zeros((KINDS - 4, width + 2 * LANES), np.float32)
    p, q, r = known[0], known[1], known[2]
    for y in range(height):
        along, across, passing = ix[y], iy[y], it[y]
        for x in range(width):
            k = np.uintp(x)  # an index that may be negative keeps the loop from becoming vector instructions
            a, b, c = along[k], across[k], passing[k]
            scale = one / np.sqrt(one + per_u * a * a + per_v * b * b)
            p[k] = root_u * scale * a
            q[k] = root_v * scale * b
            r[k] = scale * c
        for first in range(0, vectors, LANES):
            row = first // STRIP * height + y
            rows[row, : 2 * FIELD] = 0
            rows[row + height, : 2 * FIELD] = 0
            for kind in range(4, KINDS):
                write_vectors(known[kind - 4], starts, first, room, row * ROW + kind * FIELD, height * ROW)


@numba.njit(cache=True, nogil=True)
def _read_field(room, begin, scale, starts, vectors, field):  # type: ignore[no-untyped-def]
    """Read one field, whose first number lies at `begin`."""
    height, width = field.shape
    along = np.empty(width + 2 * LANES, np.float32)
    for y in range(height):
        for first in range((vectors - 1) // LANES * LANES, -1, -LANES):
            place = (first // STRIP * height + y) * ROW + begin
            read_vectors(along, starts, first, room, place, height * ROW)
        out = field[y]
        for x in range(width):
            k = np.uintp(x)
            out[k] = scale * along[k]


@numba.njit(cache=True, nogil=True)
def _pass(room, places, weights, lift, seams, height, sweeps, odd):  # type: ignore[no-untyped-def]
    """So many sweeps, all together, once over the whole picture."""
    vectors = places.size - 2
    strips = (vectors + STRIP - 1) // STRIP
    walks = (sweeps + CLOSE - 1) // CLOSE
    for front in range(0, height + sweeps - 1, ROWS):
        for begin in range(0, sweeps, CLOSE):
            close = min(CLOSE, sweeps - begin)
            soon = (begin // CLOSE * strips // walks * height + front + ROWS) * ROW
            top = front - begin
            if top - (close - 1) >= 1 and top + ROWS < height and vectors >= 2 * close + 2:
                _close(room, places, weights, lift, seams, close, top, (odd + begin) & 1, soon)
                continue
            for sweep in range(begin, begin + close):
                top, stop = max(front - sweep, 0), min(front - sweep + ROWS, height)
                if top < stop:
                    above, below = -ROW if top > 0 else 0, ROW if stop < height else 0
                    sweep_end(
                        room, places, weights, lift, 0, vectors, 1, top, (odd + sweep) & 1, above, below, stop - top, soon,
                        vectors, seams,
                    )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _close(room, places, weights, lift, seams, close, top, odd, soon):  # type: ignore[no-untyped-def]
    """A few sweeps of `ROWS` rows, from `top` on; no row beside them lies beyond the picture.

    Along the row sweep k leaves out k + 1 vectors at either end: what lies beyond the seam is not there before the end.
    """
    vectors = places.size - 2
    whole = 2 * close - 1
    for t in range(1, whole):
        for k in range((t + 1) // 2):
            _piece(room, places, weights, lift, t - k, top - k, (odd + k) & 1, soon)
    many = vectors - 1 - whole
    sweep_columns(room, places, weights, lift, whole, many, close, top, odd, -ROW, ROW, ROWS, soon)
    for k in range(close):
        for n in range(1, k + 1):
            _piece(room, places, weights, lift, n, top - k, (odd + k) & 1, soon)
            _piece(room, places, weights, lift, vectors - 1 - n, top - k, (odd + k) & 1, soon)
        for n in (0, vectors - 1):
            sweep_end(room, places, weights, lift, n, 1, 1, top - k, (odd + k) & 1, -ROW, ROW, ROWS, soon, vectors, seams)  # fmt: skip  # noqa: E501


@numba.njit(cache=True, nogil=True)
def _piece(room, places, weights, lift, vector, top, odd, soon):  # type: ignore[no-untyped-def]
    """One sweep of `ROWS` rows of one vector."""
    sweep_columns(room, places, weights, lift, vector, 1, 1, top, odd, -ROW, ROW, ROWS, soon)


@numba.njit(cache=True, nogil=True)
def sweep_picture(ix, iy, it, lift, alpha2, beta2, gamma2, iterations, together, rows, u, v):  # type: ignore[no-untyped-def]
    """All sweeps from rest, at most so many of them together; `rows` are the room for `rows_of_strips`, at a cache line."""
    height, width = ix.shape
    a, b = alpha2 + beta2, alpha2 + gamma2
    one, room = np.float32(1), rows.reshape(-1)
    seams = np.empty((SEAMS, LANES), np.int32)
    starts, vectors = _stretches(width, seams)
    _write_known(ix, iy, it, one / a, one / b, starts, vectors, room)
    twelfth, six = np.float32(1 / 12), np.float32(6)
    weights = np.array([np.float32(2) + six * beta2 / alpha2, alpha2 / a * twelfth, alpha2 / b * twelfth], np.float32)
    places = np.empty(vectors + 2, np.int64)
    for n in range(vectors):
        places[n + 1] = n // STRIP * height * ROW + n % STRIP * LANES
    places[0], places[-1] = places[-2], places[1]
    lifted = beta2 / a * np.sqrt(a) * lift
    for done in range(0, iterations, together):
        _pass(room, places, weights, lifted, seams, height, min(together, iterations - done), done & 1)
    last = 2 * FIELD * (iterations & 1)
    _read_field(room, last, one / np.sqrt(a), starts, vectors, u)
    _read_field(room, last + FIELD, one / np.sqrt(b), starts, vectors, v)


def rows_of_strips(height: int, width: int) -> int:
    """How many rows of `ROW` numbers a picture takes, as sweeps need it."""
    return -(-width // LANES**2) * (LANES // STRIP) * height
