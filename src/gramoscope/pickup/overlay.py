"""The frames of a group laid over each other and averaged, column by column, in one pass over the film.

What `registration.register` gives beside its trend, for readings that need no temporal derivative: every byte of the film is
read once, each frame at its own fraction of a pixel (Catmull–Rom), and a column of the mean lies together in memory, as
windows that follow the groove want it. Only the parts of the picture that somebody wants are drawn: most of it is out of
focus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.cache_line import single_room
from gramoscope.camera.film_line import film_line
from gramoscope.conventions import BoolArray, Float32Array, FloatArray
from gramoscope.pickup.device import Kept
from gramoscope.pickup.film_lanes import PIXELS, sum_lines, sum_phases, write_as_columns
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.picture_room import picture_room
from gramoscope.pickup.registration import cubic_taps, placement
from gramoscope.signal_path import ImageArray

TILE_ROWS, TILE_COLUMNS = 16, 64
"""So much of the picture is wanted or not. Sixteen rows are averaged before they are written: a cache line of each column."""
RUN_TILES = 32
"""So many tiles at most are averaged at a time: what they add up to stays near."""
ROOM = 48
"""Sums are written, and read, beyond the end of a line by no more than this."""
SOON_ROWS = 2
"""Rows of film are called for so many rows ahead."""
MOST_AT_ONCE = 256
"""So many frames are added up as whole numbers of twice as many bits as theirs."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """The mean of the frames of a group.

    Attributes
    ----------
    columns : float32 array, shape (column, row)
        Grey levels, in the coordinates of the first frame, extended forward by the last shift; 0 where not wanted. Lies
        where the device that drew it keeps it (`pickup.device`).
    frames : int64 array, shape (column,)
        How many frames each column rests on.
    shift_px : float64 array, shape (frame,)
        How far the record had turned, of each frame used.
    frame_index : int64 array, shape (frame,)
        Which frames of the group were used.
    """

    columns: Kept
    frames: npt.NDArray[np.int64]
    shift_px: FloatArray
    frame_index: npt.NDArray[np.int64]


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_frame(film, first, stride, taps, start, stop, total):  # type: ignore[no-untyped-def]
    """Add one frame, of a film as one line of pixels, to the columns from start to stop of [row, column]."""
    w0, w1, w2, w3 = np.float32(taps[0]), np.float32(taps[1]), np.float32(taps[2]), np.float32(taps[3])
    into = total.reshape(total.size)
    # unsigned places, for signed ones may count from the end, and keep the loop from being vectorised
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for j in range(total.shape[0]):
        here, there = np.uint64(first + j * stride), np.uint64(j * total.shape[1] + start)
        for x in range(np.uint64(stop - start)):
            near = w0 * np.float32(film[here + x]) + w1 * np.float32(film[here + x + one])
            into[there + x] += near + w2 * np.float32(film[here + x + two]) + w3 * np.float32(film[here + x + three])


@numba.njit(cache=True, nogil=True)
def _phases(places, fraction):  # type: ignore[no-untyped-def]
    """Return where frames of one fraction of a pixel begin, and their taps; as many at a time as sums have room for."""
    first, taps, count = np.empty(len(places) + 1, np.int64), np.empty((len(places), 4), np.float32), 0
    for k in range(len(places)):
        if count == 0 or fraction[k] != fraction[first[count - 1]] or k - first[count - 1] == MOST_AT_ONCE:
            first[count], taps[count] = k, cubic_taps(fraction[k])
            count += 1
    first[count] = len(places)
    return first[: count + 1], taps[:count].copy().reshape(4 * count)


@numba.njit(cache=True, nogil=True)
def _common(places, run):  # type: ignore[no-untyped-def]
    """Return the columns of a run to which all frames reach; none, at its end, if they are few."""
    start, stop = run
    for k in range(len(places)):
        start, stop = max(start, places[k, 1]), min(stop, places[k, 2])
    return (start, stop) if stop - start >= PIXELS else (run[1], run[1])


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_sums(film, begins, first, stride, taps, start, stop, total):  # type: ignore[no-untyped-def]
    """Add some frames, added up as whole numbers, to the columns from start to stop of [row, column]."""
    w0, w1, w2, w3 = np.float32(taps[0]), np.float32(taps[1]), np.float32(taps[2]), np.float32(taps[3])
    sums, into = np.empty(stop - start + 3, np.uint32), total.reshape(total.size)
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for j in range(total.shape[0]):
        sums[:] = 0
        for begin in begins:
            here = np.uint64(begin + first + j * stride)
            for x in range(np.uint64(sums.size)):
                sums[x] += film[here + x]
        there = np.uint64(j * total.shape[1] + start)
        for x in range(np.uint64(stop - start)):
            near = w0 * np.float32(sums[x]) + w1 * np.float32(sums[x + one])
            into[there + x] += near + w2 * np.float32(sums[x + two]) + w3 * np.float32(sums[x + three])


@numba.njit(cache=True, nogil=True)
def _add_end(film, shape, places, begins, taps, rows, run, end, total):  # type: ignore[no-untyped-def]
    """Add frames of one fraction of a pixel to an end: whole numbers where all of them reach, each by itself elsewhere."""
    low, high = end
    for k in range(len(places)):
        low, high = max(low, places[k, 1]), min(high, places[k, 2])
    if high <= low:
        low = high = end[1]
    if high > low:
        _add_sums(film, begins, rows[0] * shape[1] + low, shape[1], taps, low - run[0], high - run[0], total)
    for k in range(len(places)):
        pixel = begins[k] + rows[0] * shape[1]
        for first, last in (
            (max(places[k, 1], end[0]), min(places[k, 2], low)),
            (max(places[k, 1], high), min(places[k, 2], end[1])),
        ):
            if last > first:
                _add_frame(film, pixel + first, shape[1], taps, first - run[0], last - run[0], total)


@numba.njit(cache=True, nogil=True)
def _add_ends(film, shape, places, begins, phases, taps, rows, run, common, total):  # type: ignore[no-untyped-def]
    """Write what frames add up to where not all of them reach."""
    for end in ((run[0], common[0]), (common[1], run[1])):
        if end[1] > end[0]:
            total[:, end[0] - run[0] : end[1] - run[0]] = np.float32(0)
            for p in range(len(phases) - 1):
                some = slice(phases[p], phases[p + 1])
                four = taps[4 * p : 4 * p + 4]
                _add_end(film, shape, places[some], begins[some], four, rows, run, end, total)


@numba.njit(cache=True, nogil=True)
def _add_up(film, width, begins, phases, taps, rows, run, common, lines, total):  # type: ignore[no-untyped-def]
    """Write what frames add up to where all of them reach."""
    line, sums = total.shape[1], total.reshape(total.size)
    step, count = lines.size // (len(phases) - 1), common[1] - common[0]
    for j in range(rows[1] - rows[0]):
        first = (rows[0] + j) * width + common[0]
        for p in range(len(phases) - 1):
            frames = phases[p + 1] - phases[p]
            sum_lines(film, begins, phases[p], frames, first, SOON_ROWS * width, lines, p * step, count + 3)
        sum_phases(lines, step, taps, len(phases) - 1, sums, j * line + common[0] - run[0], count)


@numba.njit(cache=True, nogil=True)
def _write(total, share, run, rows, columns):  # type: ignore[no-untyped-def]
    """Write rows of sums as columns of means."""
    height, line = columns.shape[1], columns.reshape(columns.size)
    count, sums = run[1] - run[0], total.reshape(total.size)
    if rows[1] - rows[0] == TILE_ROWS and count >= TILE_ROWS:
        write_as_columns(sums, 0, total.shape[1], share, run[0], count, line, run[0] * height + rows[0], height)
        return
    for x in range(count):
        for j in range(rows[1] - rows[0]):
            columns[run[0] + x, rows[0] + j] = total[j, x] * share[run[0] + x]


@numba.njit(cache=True, nogil=True)
def _clear(line, first, count):  # type: ignore[no-untyped-def]
    """Write black to so many places of a line."""
    here = np.uint64(first)
    for j in range(np.uint64(count)):
        line[here + j] = np.float32(0)


@numba.njit(cache=True, nogil=True)
def _blacken(wanted, columns):  # type: ignore[no-untyped-def]
    """Write black to all tiles that are not wanted, as many at a time as lie below each other."""
    (width, height), flat = columns.shape, columns.reshape(columns.size)
    for tile in range(wanted.shape[1]):
        block = 0
        while block < len(wanted):
            first = block
            while block < len(wanted) and not wanted[block, tile]:
                block += 1
            low, high = first * TILE_ROWS, min(block * TILE_ROWS, height)
            if high > low:
                for x in range(tile * TILE_COLUMNS, min((tile + 1) * TILE_COLUMNS, width)):
                    _clear(flat, x * height + low, high - low)
            else:
                block += 1


@numba.njit(cache=True, nogil=True)
def _overlay(film, shape, places, fraction, share, wanted, columns):  # type: ignore[no-untyped-def]
    """Draw the wanted tiles of frames that lie so far apart in a line of film, in rows of such a width; others are black."""
    tiles = wanted.shape[1]
    phases, taps = _phases(places, fraction)
    begins = places[:, 0] * shape[0] + places[:, 3] - 1
    longest = RUN_TILES * TILE_COLUMNS
    total = single_room(TILE_ROWS * (longest + ROOM)).reshape(TILE_ROWS, longest + ROOM)
    lines = single_room((len(phases) - 1) * (longest + ROOM))
    for block in range(len(wanted)):
        rows = (block * TILE_ROWS, min((block + 1) * TILE_ROWS, columns.shape[1]))
        tile = 0
        while tile < tiles:
            first = tile
            while tile < min(tiles, first + RUN_TILES) and wanted[block, tile]:
                tile += 1
            if tile > first:
                run = (first * TILE_COLUMNS, min(tile * TILE_COLUMNS, columns.shape[0]))
                common = _common(places, run)
                if common[1] > common[0]:
                    _add_up(film, shape[1], begins, phases, taps, rows, run, common, lines, total)
                part = total[: rows[1] - rows[0]]
                _add_ends(film, shape, places, begins, phases, taps, rows, run, common, part)
                _write(total, share, run, rows, columns)
            else:
                tile += 1
    _blacken(wanted, columns)


def all_tiles(shape: tuple[int, int]) -> BoolArray:
    """Return the tiles of a picture, of so many rows and columns, all of them wanted."""
    return np.ones((-(-shape[0] // TILE_ROWS), -(-shape[1] // TILE_COLUMNS)), np.bool_)


def tiles_about(rows: FloatArray, shape: tuple[int, int], *, reach_px: float) -> BoolArray:
    """Return the tiles that lie about some lines.

    Parameters
    ----------
    rows : float64 array, shape (line, column)
        NaN where a line is not wanted.
    shape : (int, int)
        Rows and columns of the picture.
    reach_px : float
        So many rows on each side of a line are wanted.

    Returns
    -------
    bool array, shape (tile of rows, tile of columns)
    """
    wanted = ~all_tiles(shape)
    _mark(rows, float(reach_px), wanted)
    return wanted


@numba.njit(cache=True, nogil=True)
def _mark(rows, reach, wanted):  # type: ignore[no-untyped-def]
    for line in rows:
        for tile in range(wanted.shape[1]):
            lowest, highest = np.inf, -np.inf
            for row in line[tile * TILE_COLUMNS : (tile + 1) * TILE_COLUMNS]:
                if row < lowest:
                    lowest = row
                if row > highest:
                    highest = row
            if highest >= lowest:
                low = max(int(np.floor(lowest - reach)) // TILE_ROWS, 0)
                high = min(int(np.ceil(highest + reach)) // TILE_ROWS, wanted.shape[0] - 1)
                wanted[low : high + 1, tile] = True


def overlay(
    images: ImageArray, shift_px: FloatArray, frame_index: npt.NDArray[np.int64], wanted: BoolArray | None = None
) -> Overlay:
    """Lay frames over each other along their shifts.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
    shift_px : float64 array, shape (frame,)
        How far the record has turned since the first frame; frames whose shifts have the same fraction are quicker to lay
        over each other, see `to_phases`.
    frame_index : int64 array, shape (frame,)
        Number of each frame in running order.
    wanted : bool array, shape (tile of rows, tile of columns), optional
        Which tiles of the overlay are to be drawn; all when left out.

    Returns
    -------
    Overlay
        Columns that no frame covers (one at each end, lost to interpolation) repeat their neighbour.
    """
    height, width = images.shape[1:]
    columns = picture_room(overlay_width(width, shift_px), height)
    tiles = all_tiles((height, len(columns))) if wanted is None else wanted
    film, step = film_line(images)
    counts = np.empty(len(columns), np.int64)
    _draw(film, (step, width), shift_px, tiles, counts, columns)
    return Overlay(columns, counts, shift_px, frame_index)


@numba.njit(cache=True, nogil=True)
def _draw(film, shape, shift_px, wanted, counts, columns):  # type: ignore[no-untyped-def]
    """Draw what `overlay` returns, and write how many frames each column rests on."""
    _count_frames(shift_px, shape[1], counts)
    share = np.empty(counts.size, np.float32)
    for x in range(counts.size):
        share[x] = 1.0 / max(counts[x], 1)
    places, fraction = _by_fraction(shift_px, shape[1], counts.size)
    _overlay(film, shape, places, fraction, share, wanted, columns)
    covered = np.flatnonzero(counts)
    if covered.size > 0:
        for x in range(covered[0]):
            columns[x] = columns[covered[0]]
        for x in range(covered[-1] + 1, counts.size):
            columns[x] = columns[covered[-1]]


@numba.njit(cache=True, nogil=True)
def _by_fraction(shift_px, width, canvas_width):  # type: ignore[no-untyped-def]
    """Return number, first and last but one column, and own column minus theirs, of all frames, and their fractions, sorted."""
    places, fraction = placements(shift_px, width, canvas_width)
    order = np.argsort(fraction, kind="mergesort")
    some = np.empty((order.size, 4), np.int64)
    for k in range(order.size):
        some[k, 0] = order[k]
        some[k, 1:] = places[order[k]]
    return some, fraction[order]


@numba.njit(cache=True, nogil=True)
def placements(shift_px, width, canvas_width):  # type: ignore[no-untyped-def]
    """Return first and last but one column and own column minus theirs, [frame, 3], and fraction of all frames."""
    places, fraction = np.empty((shift_px.size, 3), np.int64), np.empty(shift_px.size)
    for k in range(shift_px.size):
        start, stop, offset, fraction[k] = placement(shift_px[k], width, canvas_width)
        places[k] = start, stop, offset
    return places, fraction


PHASES = 4
"""Frames lie over each other to a quarter of a pixel: at most so many sums of frames are interpolated, in place of all frames.
At a third of a cycle a pixel that costs 1.1 % of the texture's amplitude."""
EXACT_FRAMES = 8
"""So few frames lie over each other as exactly as their shifts are known: the errors of few do not average out."""


def to_phases(shift_px: FloatArray) -> FloatArray:
    """Return shifts that differ by quarters of a pixel, and from what they were by nothing in the mean.

    Frames with the same fraction of a pixel are laid over each other as whole numbers by `overlay`. The mean counts: it is
    where the groove is believed to be along itself, and a group that is off by a tenth of a pixel is heard. A few frames stay
    as they are.
    """
    phases: FloatArray = _to_phases(shift_px)
    return phases


@numba.njit(cache=True, nogil=True)
def _to_phases(shift_px):  # type: ignore[no-untyped-def]
    if shift_px.size <= EXACT_FRAMES:
        return shift_px
    near = np.rint(PHASES * shift_px) / PHASES
    # the same fractions to the last bit
    return near + np.rint((shift_px - near).mean() * 2**20) / 2**20


def frames_in(width: int, shift_px: FloatArray) -> npt.NDArray[np.int64]:
    """Return how many frames of such a width each column of their overlay rests on."""
    counts = np.empty(overlay_width(width, shift_px), np.int64)
    _count_frames(shift_px, width, counts)
    return counts


@numba.njit(cache=True, nogil=True)
def _count_frames(shift_px, width, counts):  # type: ignore[no-untyped-def]
    """Write how many frames cover each column."""
    counts[:] = 0
    for k in range(shift_px.size):
        start, stop, _, _ = placement(shift_px[k], width, counts.size)
        for x in range(start, stop):
            counts[x] += 1


def overlay_width(width: int, shift_px: FloatArray) -> int:
    """Return how many columns an overlay has, of frames that have so many."""
    return width + int(np.floor(shift_px.max(initial=0.0)))


@numba.njit(cache=True, nogil=True)
def _brighter(column, level):  # type: ignore[no-untyped-def]
    count = 0
    for row in range(column.size):
        count += column[row] >= level
    return count


@numba.njit(cache=True, nogil=True)
def places_brighter(columns, level):  # type: ignore[no-untyped-def]
    """Return column and row of all points of a picture, [column, row], that reach a level, shape (place, 2)."""
    counts = np.empty(len(columns), np.int64)
    for x in range(len(columns)):
        counts[x] = _brighter(columns[x], level)
    places, n = np.empty((counts.sum(), 2), np.int64), 0
    for seen in np.flatnonzero(counts):
        for row in range(columns.shape[1]):
            if columns[seen, row] >= level:
                places[n, 0], places[n, 1] = seen, row
                n += 1
    return places


GAUSSIAN_REACH = 4


def _gaussian_taps() -> tuple[Float32Array, Float32Array]:
    """A Gaussian of one pixel from its middle on, and the weights of x₁ − x₋₁ … x₄ − x₋₄ in its derivative."""
    k = np.arange(GAUSSIAN_REACH + 1)
    bell = np.exp(-0.5 * k**2)
    bell /= 2 * bell.sum() - bell[0]
    slope = k[1:] * bell[1:]
    return bell.astype(np.float32), (slope / np.sum(2 * k[1:] * slope)).astype(np.float32)


_BELL, _SLOPE = _gaussian_taps()


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _add_difference(w, after, before, out):  # type: ignore[no-untyped-def]
    for j in range(out.size):
        out[j] += w * (after[j] - before[j])


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _smooth(wide, w, out):  # type: ignore[no-untyped-def]
    """Smooth by five taps from the middle on; `wide` has four more values at either end."""
    n = out.size
    far, mid, near, next_, here = wide[:n], wide[1 : n + 1], wide[2 : n + 2], wide[3 : n + 3], wide[4 : n + 4]
    after, beyond, past, last = wide[5 : n + 5], wide[6 : n + 6], wide[7 : n + 7], wide[8 : n + 8]
    w0, w1, w2, w3, w4 = w[0], w[1], w[2], w[3], w[4]
    for j in range(n):
        inner = w0 * here[j] + w1 * (next_[j] + after[j]) + w2 * (near[j] + beyond[j])
        out[j] = inner + w3 * (mid[j] + past[j]) + w4 * (far[j] + last[j])


@numba.njit(cache=True, nogil=True)
def _slope_of(columns, x, wide, out):  # type: ignore[no-untyped-def]
    """Write the slope in one column."""
    width, height = columns.shape
    reach = GAUSSIAN_REACH
    wide[:] = np.float32(0)
    here = wide[reach : reach + height]
    for k in range(1, reach + 1):
        _add_difference(_SLOPE[k - 1], columns[min(x + k, width - 1)], columns[max(x - k, 0)], here)
    wide[:reach], wide[reach + height :] = here[0], here[-1]
    _smooth(wide, _BELL, out)


@numba.njit(cache=True, nogil=True)
def _slope_along(columns, slope):  # type: ignore[no-untyped-def]
    width, height = columns.shape
    wide, some = np.empty(height + 2 * GAUSSIAN_REACH, np.float32), np.empty((LANES, height), np.float32)
    if width < LANES or height < LANES:
        for x in range(width):
            _slope_of(columns, x, wide, some[0])
            slope[:, x] = some[0]
        return
    once, sums, line = np.ones(height, np.float32), some.reshape(some.size), slope.reshape(slope.size)
    for first in range(0, width, LANES):
        # the last ones end where the picture does
        begin = min(first, width - LANES)
        for k in range(LANES):
            _slope_of(columns, begin + k, wide, some[k])
        write_as_columns(sums, 0, height, once, 0, height, line, begin, width)


def slope_along(columns: Float32Array) -> Float32Array:
    """Return the derivative of a picture along the groove, by that of a Gaussian of one pixel in both directions.

    Parameters
    ----------
    columns : float32 array, shape (column, row)
        Beyond its ends the outermost values are held.

    Returns
    -------
    float32 array, shape (row, column)
        Grey levels a pixel.
    """
    slope = np.empty(columns.shape[::-1], np.float32)
    _slope_along(columns, slope)
    return slope
