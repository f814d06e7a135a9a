"""Sweeps of Horn and Schunck, sixteen points as one vector of the processor, over memory laid out for them.

**Arithmetic.** With a = α² + β² and b = α² + γ² (see `horn_schunck`) and both fields times the roots of these, U = √a u and
V = √b v, the same three numbers of a point turn means into fields:

    U ← M − p e,    V ← N − q e,    e = p M + q N + r,    (p, q, r) = (I_x/√a, I_y/√b, I_t) / √(1 + I_x²/a + I_y²/b).

The means come of sums over rows, which three rows share: with the pair d = west + east and t = d + k · middle,

    M = c (t_above + t_below + 2 d) + lift,    c = α²/(12 a),    k = 2 + 6 β²/α²,

and N the same with α²/(12 b), k = 2 and no lift. That is 14 sums, products or both at once for both fields of a point.

**Memory.** A strip of `STRIP` vectors is 128 columns wide; its rows lie one behind the other, each with all that a sweep needs:
U and V of the sweeps of even number, U and V of odd number, p, q and r. So ten rows of a strip are ten pages of memory, not
seventy, and a row is one cache line longer than what lies in it, or all rows would compete for the same lines of the cache.

**Order.** A sweep may follow the one before it at a distance of one row and one vector: then all that it reads is there, and
what it writes over has been read. `ROWS` rows of a few sweeps go along the picture together, close behind each other; then the
next few sweeps, a little higher up; then the next rows. Each point is made from the same numbers as if one sweep waited for
the other, and comes out the same to the last bit. (L. Lamport, CACM 17, 83, 1974; D. Wonnacott, IPDPS, 2000.)
"""

from __future__ import annotations

import numba
import numpy as np
from llvmlite import ir

from gramoscope.pickup.lane_writer import (
    BITS,
    INT,
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


def _whole(number: int) -> Value:
    return ir.Constant(LONG, number)


def _where(w: LaneWriter, number: Value) -> Value:
    """Where a vector has its number so and so."""
    b = w.builder
    first = b.insert_element(ir.Constant(BITS, ir.Undefined), b.trunc(number, INT), ir.Constant(INT, 0))
    every = b.shuffle_vector(first, ir.Constant(BITS, ir.Undefined), ir.Constant(BITS, [0] * LANES))
    return b.icmp_signed("==", every, ir.Constant(BITS, list(range(LANES))))


def _sweep(w: LaneWriter) -> None:
    """Sweeps of some rows; if told where the picture's ends are, what lies there is its own neighbour."""
    room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, *ends = w.arguments
    b = w.builder
    steep, mean_u, mean_v = (w.spread(weights, _whole(k)) for k in range(3))
    two = w.constant(2.0)
    own_neighbour = [_where(w, number) for number in ends]
    sums = [room_for(b, VECTOR) for _ in range(6)]

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

        def row(far: Value) -> list[Value]:
            """Of a row of U and of V: the sum of three, and of the pair."""
            found = []
            for field, share in ((0, steep), (FIELD, two)):
                a, c, e = (w.load(room, w.plus(w.plus(w.plus(old, at), far), field)) for at in (west, middle, east))
                left, right = w.cut(a, c, LANES - 1), w.cut(c, e, 1)
                if own_neighbour:
                    left, right = (
                        b.select(own, c, side) for own, side in zip(own_neighbour, (left, right), strict=True)
                    )
                pair = b.fadd(left, right)
                found += [w.times_and(share, c, pair), pair]
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
def sweep_end(_, room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, first, last):  # type: ignore[no-untyped-def]
    """Do the same where the picture's first and last column are, counted from the vector's own first number."""
    arguments = (room, places, weights, lift, column, columns, sweeps, top, odd, above, below, rows, soon, first, last)
    return function(arguments, _sweep, apart="gramoscope_sweep_end")


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _write_known(ix, iy, it, per_u, per_v, rows):  # type: ignore[no-untyped-def]
    """Write p, q and r into the rows of the strips, zero beyond the picture, and fields of zero."""
    root_u, root_v, one = np.sqrt(per_u), np.sqrt(per_v), np.float32(1)
    height, width = ix.shape
    for y in range(height):
        along, across, passing = ix[y], iy[y], it[y]
        for strip in range((width + FIELD - 1) // FIELD):
            row, x = rows[strip * height + y], np.uintp(strip * FIELD)
            count = min(FIELD, width - strip * FIELD)
            row[: 2 * FIELD] = 0
            for n in range(count):
                k = np.uintp(n)  # an index that may be negative keeps the loop from becoming vector instructions
                a, b, c = along[x + k], across[x + k], passing[x + k]
                scale = one / np.sqrt(one + per_u * a * a + per_v * b * b)
                row[k + np.uintp(4 * FIELD)] = root_u * scale * a
                row[k + np.uintp(5 * FIELD)] = root_v * scale * b
                row[k + np.uintp(6 * FIELD)] = scale * c
            for field in range(4, KINDS):
                row[field * FIELD + count : (field + 1) * FIELD] = 0


@numba.njit(cache=True, nogil=True)
def _read_fields(rows, odd, scale_u, scale_v, u, v):  # type: ignore[no-untyped-def]
    """Read the fields of even or odd number."""
    height, width = u.shape
    first = np.uintp(2 * FIELD if odd else 0)
    for y in range(height):
        along, across = u[y], v[y]
        for strip in range((width + FIELD - 1) // FIELD):
            row, x = rows[strip * height + y], np.uintp(strip * FIELD)
            for n in range(min(FIELD, width - strip * FIELD)):
                k = np.uintp(n)
                along[x + k] = scale_u * row[first + k]
                across[x + k] = scale_v * row[first + np.uintp(FIELD) + k]


@numba.njit(cache=True, nogil=True)
def _pass(room, places, weights, lift, height, width, sweeps, odd):  # type: ignore[no-untyped-def]
    """So many sweeps, all together, once over the whole picture."""
    vectors = places.size - 2
    strips = (vectors + STRIP - 1) // STRIP
    walks = (sweeps + CLOSE - 1) // CLOSE
    for front in range(0, height + sweeps - 1, ROWS):
        for begin in range(0, sweeps, CLOSE):
            close = min(CLOSE, sweeps - begin)
            soon = (begin // CLOSE * strips // walks * height + front + ROWS) * ROW
            inside = front - (begin + close - 1) >= 1 and front - begin + ROWS < height
            t, end = begin, vectors + begin + close - 1
            while t < end:
                if inside and t - (begin + close - 1) >= 1 and t - begin < vectors - 1:
                    many = vectors - 1 + begin - t
                    sweep_columns(
                        room, places, weights, lift, t - begin, many, close, front - begin, (odd + begin) & 1, -ROW, ROW, ROWS,
                        soon,
                    )  # fmt: skip
                    t += many
                    continue
                for sweep in range(begin, begin + close):
                    vector = t - sweep
                    top, rows = max(front - sweep, 0), min(front - sweep + ROWS, height) - max(front - sweep, 0)
                    if vector < 0 or vector >= vectors or rows <= 0:
                        continue
                    above, below = -ROW if top > 0 else 0, ROW if top + rows < height else 0
                    sweep_end(
                        room, places, weights, lift, vector, 1, 1, top, (odd + sweep) & 1, above, below, rows, soon,
                        -LANES * vector, width - 1 - LANES * vector,
                    )  # fmt: skip
                t += 1


@numba.njit(cache=True, nogil=True)
def sweep_picture(ix, iy, it, lift, alpha2, beta2, gamma2, iterations, together, rows, u, v):  # type: ignore[no-untyped-def]
    """All sweeps from rest, at most so many of them together; `rows` are the room for `rows_of_strips`, at a cache line."""
    height, width = ix.shape
    a, b = alpha2 + beta2, alpha2 + gamma2
    one = np.float32(1)
    _write_known(ix, iy, it, one / a, one / b, rows)
    twelfth, six = np.float32(1 / 12), np.float32(6)
    weights = np.array([np.float32(2) + six * beta2 / alpha2, alpha2 / a * twelfth, alpha2 / b * twelfth], np.float32)
    vectors = (width + LANES - 1) // LANES
    places = np.empty(vectors + 2, np.int64)
    for x in range(vectors):
        places[x + 1] = x // STRIP * height * ROW + x % STRIP * LANES
    places[0], places[-1] = places[1], places[-2]
    lifted = beta2 / a * np.sqrt(a) * lift
    for done in range(0, iterations, together):
        _pass(rows.reshape(-1), places, weights, lifted, height, width, min(together, iterations - done), done & 1)
    _read_fields(rows, (iterations & 1) == 1, one / np.sqrt(a), one / np.sqrt(b), u, v)


def rows_of_strips(height: int, width: int) -> int:
    """How many rows of `ROW` numbers a picture takes, as sweeps need it."""
    return -(-width // FIELD) * height
