"""The kernels that read the film: how far the record turned, where the picture is sharp, the frames laid over each other.

They compute what the kernels of `registration`, `texture.sharpness`, `overlay` and `texture.tone` compute; `placement` and the
taps of the interpolation are the very same functions. The film is read by neighbouring threads at neighbouring columns, and
what changes its order (pictures lie column by column) goes through a block's shared memory.
"""

from __future__ import annotations

import math

from numba import cuda, float32, float64

from gramoscope.pickup.overlay import TILE_COLUMNS, TILE_ROWS
from gramoscope.pickup.registration import CONVERGED_PX, LARGEST_STEP_PX, placement, quintic_taps
from gramoscope.pickup.texture.sharpness import CELL_PX

PAIR_THREADS = 256
"""Threads that find the shift of one pair of frames together; a power of two."""
ENERGY_COLUMNS = 128
"""Columns of a block that finds energies; whole cells."""
BESIDE = 2
"""Columns on each side that a difference reaches."""
ENERGY_ROOM = ENERGY_COLUMNS + 2 * BESIDE
TILE_ROOM = (TILE_ROWS, TILE_COLUMNS + 1)
"""A column more than is used: threads that write a column beside each other then write to different banks."""
ROWS_AT_ONCE = 4
"""Rows of a tile that a block adds up at a time."""


@cuda.jit(device=True)
def _normal_equation(here, there, rows, shift_px, thread):  # type: ignore[no-untyped-def]
    """One thread's part of the sums of `registration.pair_shift_px`."""
    width = here.shape[1]
    start, stop, offset, fraction = placement(shift_px, width, width)
    start, stop = max(start + 1, 2), min(stop - 1, width - 2)
    taps = quintic_taps(fraction)
    a, b, c = float32(taps[0]), float32(taps[1]), float32(taps[2])
    d, e, f = float32(taps[3]), float32(taps[4]), float32(taps[5])
    square, cross = float32(0), float32(0)
    for i in range(rows.size):
        one, other = here[rows[i]], there[rows[i]]
        for x in range(start + thread, stop, PAIR_THREADS):
            t = x + offset
            moved = a * float32(other[t - 2]) + b * float32(other[t - 1]) + c * float32(other[t])
            moved += d * float32(other[t + 1]) + e * float32(other[t + 2]) + f * float32(other[t + 3])
            gradient = float32(one[x + 2]) + float32(one[x + 1]) - float32(one[x - 1]) - float32(one[x - 2])
            square += gradient * gradient
            cross += gradient * (moved - float32(one[x]))
    return square, cross


@cuda.jit(device=True)
def _add_up(values, thread):  # type: ignore[no-untyped-def]
    """Add up what the threads of a block know, pair by pair, into the first value."""
    half = PAIR_THREADS // 2
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            values[thread] += values[thread + half]
        half //= 2
    cuda.syncthreads()


@cuda.jit
def pair_shifts(film, expected_px, rows, reach_px, rounds, found_px):  # type: ignore[no-untyped-def]
    """Write how far the record turned from each frame to the next, a block a pair; see `registration.pair_shift_px`."""
    pair, thread = cuda.blockIdx.x, cuda.threadIdx.x
    square = cuda.shared.array(PAIR_THREADS, float64)
    cross = cuda.shared.array(PAIR_THREADS, float64)
    expected = expected_px[pair]
    shift, answer = expected, math.nan
    for _ in range(rounds):
        mine = _normal_equation(film[pair], film[pair + 1], rows, shift, thread)
        square[thread], cross[thread] = mine[0], mine[1]
        _add_up(square, thread)
        _add_up(cross, thread)
        # every thread knows the sums and takes the same step
        step = 6.0 * cross[0] / square[0] if square[0] > 0 else 0.0
        cuda.syncthreads()
        step = min(max(step, -LARGEST_STEP_PX), LARGEST_STEP_PX)
        shift += step
        if not abs(shift - expected) <= reach_px or shift < 0:
            break
        if abs(step) < CONVERGED_PX:
            answer = shift
            break
    if thread == 0:
        found_px[pair] = answer


@cuda.jit(device=True)
def _mean_of_column(film, frames, offset, share, row, x):  # type: ignore[no-untyped-def]
    """The mean of whole pixels of some frames in one column of the overlay; 0 beyond it."""
    if x < 0 or x >= share.size:
        return float32(0)
    total = 0
    for k in range(frames.size):
        column = x - offset[k]
        if column >= 0 and column < film.shape[2]:
            total += int(film[frames[k], row, column])
    return float32(total) * share[x]


@cuda.jit
def cell_energy(film, frames, offset, share, energy):  # type: ignore[no-untyped-def]
    """Write energies, [cell, row]; see `texture.sharpness.cell_energy`."""
    mean = cuda.shared.array(ENERGY_ROOM, float32)
    square = cuda.shared.array(ENERGY_COLUMNS, float32)
    thread, row = cuda.threadIdx.x, cuda.blockIdx.y
    first = cuda.blockIdx.x * ENERGY_COLUMNS
    for i in range(thread, ENERGY_ROOM, ENERGY_COLUMNS):
        mean[i] = _mean_of_column(film, frames, offset, share, row, first + i - BESIDE)
    cuda.syncthreads()
    x, i = first + thread, thread + BESIDE
    difference = mean[i + 1] - mean[i - 1] + float32(0.5) * (mean[i + 2] - mean[i - 2])
    # at the ends there is nothing to take the difference from
    square[thread] = difference * difference if x > BESIDE and x < share.size - BESIDE - 1 else float32(0)
    cuda.syncthreads()
    if thread % CELL_PX == 0 and x // CELL_PX < energy.shape[0]:
        near = (square[thread] + square[thread + 4]) + (square[thread + 1] + square[thread + 5])
        far = (square[thread + 2] + square[thread + 6]) + (square[thread + 3] + square[thread + 7])
        energy[x // CELL_PX, row] = near + far


@cuda.jit(device=True)
def _mean_at(film, places, taps, share, row, x):  # type: ignore[no-untyped-def]
    """The mean of the frames that show a point, each at its own fraction of a pixel."""
    total = float32(0)
    for k in range(film.shape[0]):
        if x >= places[k, 0] and x < places[k, 1]:
            seen = x + places[k, 2]
            total += taps[k, 0] * float32(film[k, row, seen - 1]) + taps[k, 1] * float32(film[k, row, seen])
            total += taps[k, 2] * float32(film[k, row, seen + 1]) + taps[k, 3] * float32(film[k, row, seen + 2])
    return total * share[x]


@cuda.jit
def overlay_tiles(film, places, taps, share, wanted, columns):  # type: ignore[no-untyped-def]
    """Write the mean of the frames, [column, row], a block a tile; 0 in tiles that are not wanted; see `overlay.overlay`.

    places[frame] holds the first and the last but one column that a frame covers, and its own column minus theirs.
    """
    tile = cuda.shared.array(TILE_ROOM, float32)
    tx, ty = cuda.threadIdx.x, cuda.threadIdx.y
    left, top = cuda.blockIdx.x * TILE_COLUMNS, cuda.blockIdx.y * TILE_ROWS
    width, height = columns.shape
    asked = wanted[cuda.blockIdx.y, cuda.blockIdx.x] != 0
    for j in range(ty, TILE_ROWS, ROWS_AT_ONCE):
        inside = asked and left + tx < width and top + j < height
        tile[j, tx] = _mean_at(film, places, taps, share, top + j, left + tx) if inside else float32(0)
    cuda.syncthreads()
    for k in range(ty * TILE_COLUMNS + tx, TILE_ROWS * TILE_COLUMNS, ROWS_AT_ONCE * TILE_COLUMNS):
        j, x = k % TILE_ROWS, k // TILE_ROWS
        if left + x < width and top + j < height:
            columns[left + x, top + j] = tile[j, x]


@cuda.jit
def hold_ends(columns, first, last):  # type: ignore[no-untyped-def]
    """Repeat the outermost columns that a frame covers in those beyond them, a thread a row."""
    row = cuda.grid(1)
    if row < columns.shape[1]:
        for x in range(first):
            columns[x, row] = columns[first, row]
        for x in range(last + 1, columns.shape[0]):
            columns[x, row] = columns[last, row]


@cuda.jit
def any_brighter(columns, level, found):  # type: ignore[no-untyped-def]
    """Write 1 if any point reaches a level."""
    row, x = cuda.grid(2)
    if x < columns.shape[0] and row < columns.shape[1] and columns[x, row] >= level:
        found[0] = 1


@cuda.jit
def compress(columns, share, rest, gain, seen):  # type: ignore[no-untyped-def]
    """Write the logarithm of light over its mean; see `texture.tone.Tone`."""
    row, x = cuda.grid(2)
    if x < columns.shape[0] and row < columns.shape[1]:
        seen[x, row] = gain * math.log(rest + share * max(columns[x, row], float32(0)))
