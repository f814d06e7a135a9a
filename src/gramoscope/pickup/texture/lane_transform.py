"""Fourier transforms of sixteen real rows at once, within a kernel.

A look at the stripes is windows, transform, filters, transform back, energies. A library's transform takes the rows four at a
time and must be called from outside, which hands the interpreter's lock to and fro twelve times a group. Here sixteen
channels are one vector of the processor (`vector_lanes`), and the whole look is one kernel.

A row of N real numbers is half as many complex ones, z_n = x_2n + i x_2n+1, whose transform Z says the row's (any textbook):

    X_k = E_k + e^(−iθ) O_k,   E_k = (Z_k + Z*_M−k)/2,   O_k = (Z_k − Z*_M−k)/2i,   M = N/2,   θ = 2πk/N.

Transforms are Stockham's: in stages of 2, 3, 4 or 5, sorted as they go, from one room to another and back. A complex lane is
its sixteen real parts and then its sixteen imaginary ones; the way back is the way there with both exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np
from scipy import fft

from gramoscope.conventions import Float32Array, IntArray
from gramoscope.errors import require
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.vector_lanes import fifths, fold_bin, halves, quarters, thirds, weigh_bin

PAIR = 2 * LANES
"""Numbers in a complex lane."""


@dataclass(frozen=True, eq=False)
class Plan:
    """How rows of one length are transformed.

    Attributes
    ----------
    length : int
        N, even; N/2 has no factors but 2, 3 and 5.
    radix : int64 array, shape (stage,)
    twiddle : float32 array
        Of all stages: [place in the stage, power, cosine and sine], one after the other.
    turn : float32 array, shape (N/2 + 1, 2)
        cos θ and sin θ.
    """

    length: int
    radix: IntArray
    twiddle: Float32Array
    turn: Float32Array


@lru_cache(maxsize=64)
def fast_length(least: int) -> int:
    """Return an even length, at least so much and not much more, that is quickest to transform: with few stages."""
    half = -(-max(least, 2) // 2)
    some = {int(fft.next_fast_len(n, real=True)) for n in range(half, half + half // 10 + 1)}
    return 2 * min(some, key=lambda n: (n * max(len(_factors(n)), 1), n))


@lru_cache(maxsize=16)
def plan_for(length: int) -> Plan:
    """Return how rows of a length are transformed; ArgumentError for one that has other factors."""
    radix = _factors(length // 2)
    possible = length >= 2 and length % 2 == 0 and np.prod(radix, dtype=np.int64) == length // 2
    require(possible, f"a transform of {length}", "an even length with no factors but 2, 3 and 5", "take `fast_length`")
    twiddles, n = [np.zeros(0)], length // 2
    for r in radix:
        turns = 2 * np.pi * np.outer(np.arange(n // r), np.arange(1, r)) / n
        twiddles.append(np.stack([np.cos(turns), -np.sin(turns)], axis=-1).reshape(-1))
        n //= r
    theta = 2 * np.pi * np.arange(length // 2 + 1) / length
    return Plan(
        length,
        np.array(radix, np.int64),
        np.concatenate(twiddles).astype(np.float32),
        np.stack([np.cos(theta), np.sin(theta)], axis=-1).astype(np.float32),
    )


def _factors(number: int) -> list[int]:
    found = list[int]()
    for r in (4, 5, 3, 2):
        while number % r == 0 and number > 1:
            found.append(r)
            number //= r
    return found


@numba.njit(cache=True, nogil=True)
def transform(lanes, begin, radix, twiddle, one, other):  # type: ignore[no-untyped-def]
    """Transform complex lanes, which begin at a place of a line; return which of two rooms, 0 or 1, the answer is in.

    `one` and `other` are float32 lines with room for all of them; the input stays as it is.
    """
    n, stride, first, into = one.size // PAIR, 1, 0, 0
    count = n
    source, at = lanes, begin
    for r in radix:
        m = n // r
        target = one if into == 0 else other
        for p in range(m):
            here, there = at + p * stride * PAIR, p * r * stride * PAIR
            far, near = m * stride * PAIR, stride * PAIR
            place = first + p * (r - 1) * 2
            if r == 4:
                quarters(source, here, far, twiddle, place, target, there, near, stride)
            elif r == 3:
                thirds(source, here, far, twiddle, place, target, there, near, stride)
            elif r == 2:
                halves(source, here, far, twiddle, place, target, there, near, stride)
            else:
                fifths(source, here, far, twiddle, place, target, there, near, stride)
        first += m * (r - 1) * 2
        n, stride = m, stride * r
        source, at = target, 0
        into = 1 - into
    if count == 1:
        one[:] = lanes[begin : begin + PAIR]
        return 0
    return 1 - into


@numba.njit(cache=True, nogil=True)
def let_through(z, turn, filters, first, bins, lane):  # type: ignore[no-untyped-def]
    """Write what filters let through, from a first bin on, each to a lane of the bins of the answers.

    z is what `transform` made of sixteen real rows; filters, float32 [bin, filter, 16], are real.
    """
    m, count = z.size // PAIR, filters.shape[1]
    turns, weights = turn.reshape(turn.size), filters.reshape(filters.size)
    for b in range(len(filters)):
        k = first + b
        here, there, into = k % m * PAIR, (m - k) % m * PAIR, k * PAIR + lane
        weigh_bin(z, here, there, turns, 2 * k, weights, b * count * LANES, count, bins, into)


@numba.njit(cache=True, nogil=True)
def fold(bins, turn, z):  # type: ignore[no-untyped-def]
    """Write what `transform` makes sixteen real rows of, their parts exchanged, of the bins of these rows, from 0 to M."""
    m = z.size // PAIR
    turns = turn.reshape(turn.size)
    for k in range(m):
        fold_bin(bins, k * PAIR, (m - k) * PAIR, turns, 2 * k, z, k * PAIR)
    z *= np.float32(0.5 / m)


@numba.njit(cache=True, nogil=True)
def power_between(z, turn, band, lane):  # type: ignore[no-untyped-def]
    """Return the mean of |X_k|² over the bins of a band, from … to, of one of sixteen real rows that `transform` made z of."""
    m, total = z.size // PAIR, 0.0
    for k in range(band[0], band[1]):
        here, there = k % m * PAIR + lane, (m - k) % m * PAIR + lane
        even, even_imaginary = z[here] + z[there], z[here + LANES] - z[there + LANES]
        odd, odd_imaginary = z[here + LANES] + z[there + LANES], z[there] - z[here]
        real = even + turn[k, 0] * odd + turn[k, 1] * odd_imaginary
        imaginary = even_imaginary + turn[k, 0] * odd_imaginary - turn[k, 1] * odd
        total += 0.25 * (np.float64(real) * real + np.float64(imaginary) * imaginary)
    return total / (band[1] - band[0])
