"""Where a picture is sharp: the energy of its texture, in cells of a few columns by one row.

Texture in focus has strong differences from column to column, blurred texture has weak ones, and shading has none. What
every cell has anyway (camera noise) is measured in the quietest rows, and the root of the energy above it is what the search
for the groove adds up: a stripe is a ridge in it, three rows or so wide on either side. A scratch or a speck is brighter than
any stripe, so the root is cut off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from gramoscope.camera.film_line import film_line
from gramoscope.conventions import Float32Array, FloatArray, IntArray
from gramoscope.pickup.film_lanes import PIXELS, sum_lines, write_energies
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.overlay import overlay_width
from gramoscope.quantile import quantile
from gramoscope.signal_path import ImageArray

CELL_PX = 8
"""Columns in a cell; `film_lanes.write_energies` adds so many."""
ROWS = 16
"""So many rows are looked at before their energies are written."""
SOON_ROWS = 2
"""Rows of film are called for so many rows ahead."""
CEILING = 1.5
SOME_FRAMES = 4
"""So many frames at most, the first and the last among them, show where the picture is sharp: most of what is uncertain is the
texture, the same in all."""


@numba.njit(cache=True, nogil=True)
def _pieces(offset, width, canvas_width):  # type: ignore[no-untyped-def]
    """Return where the same frames lie over each other: first frame, last but one, first column, last but one.

    Pieces where fewer frames lie come first, and reach into those where more do, so that they can be added in vectors.
    """
    edges = np.unique(np.concatenate((offset, offset + width)))
    pieces = np.empty((edges.size - 1, 4), np.int64)
    for i in range(edges.size - 1):
        low, high = edges[i], min(edges[i + 1], canvas_width)
        first = np.searchsorted(offset + width, low, side="right")
        stop = np.searchsorted(offset, low, side="right")
        if stop > first and high - low < PIXELS:
            if stop < offset.size and first == 0 and low + PIXELS <= offset[0] + width:
                high = low + PIXELS
            elif first > 0 and stop == offset.size and high - PIXELS >= offset[-1]:
                low = high - PIXELS
        pieces[i] = first, stop, low, high
    return pieces[np.argsort(pieces[:, 1] - pieces[:, 0], kind="mergesort")]


@numba.njit(cache=True, nogil=True)
def _add_few(film, begins, first, stop, line, place, count):  # type: ignore[no-untyped-def]
    """Write sums of some lines of a film, each of few pixels."""
    for x in range(count):
        total = 0.0
        for k in range(first, stop):
            total += film[begins[k] + x]
        line[place + x] = total


@numba.njit(cache=True, nogil=True)
def _scale(line, place, count, gain):  # type: ignore[no-untyped-def]
    here = np.uint64(place)
    for x in range(np.uint64(count)):
        line[here + x] *= gain


@numba.njit(cache=True, nogil=True)
def _add_row(film, begins, offset, row, width, pieces, line, place):  # type: ignore[no-untyped-def]
    """Write what a row of all frames adds up to; where some of them are missing, what it would have been with them."""
    for first, stop, low, high in pieces:
        if high - low >= PIXELS:
            there = row * width + low
            sum_lines(film, begins, first, stop - first, there, SOON_ROWS * width, line, place + low, high - low)
        else:
            _add_few(film, begins + row * width + low, first, stop, line, place + low, high - low)
        if stop - first < offset.size:
            _scale(line, place + low, high - low, np.float32(offset.size / max(stop - first, 1)))


@numba.njit(cache=True, nogil=True)
def cell_energy(film, step, width, frames, offset, canvas_width, energy):  # type: ignore[no-untyped-def]
    """Write the energy of each cell of the mean of some frames of a line of film, laid over each other by whole pixels."""
    cells, height = energy.shape
    order = np.argsort(offset)
    frames, offset = frames[order], offset[order]
    pieces, begins = _pieces(offset, width, canvas_width), frames * step - offset
    weight = np.zeros(max(canvas_width, 2 * CELL_PX), np.float32)
    # beyond, the derivative would need columns that are not there
    weight[3 : canvas_width - 3] = np.float32(1 / frames.size)
    line = weight.size + 2 * LANES
    lines = np.zeros(ROWS * line, np.float32)
    part = np.empty((max(cells, 2), ROWS), np.float32)
    flat, some = energy.reshape(energy.size), part.reshape(part.size)
    for first in range(0, height, ROWS):
        rows = min(ROWS, height - first)
        for j in range(rows):
            _add_row(film, begins, offset, first + j, width, pieces, lines, j * line + LANES)
        if rows == ROWS and cells >= 2:
            write_energies(lines, LANES, line, weight, cells, flat, first, height)
        else:
            write_energies(lines, LANES, line, weight, len(part), some, 0, ROWS)
            energy[:, first : first + rows] = part[:cells, :rows]


FAINTEST = 0.25
"""A stretch whose stripes are so many times as sharp as is usual in its passage shows stripes yet."""


@dataclass(frozen=True, eq=False)
class Sharpness:
    """How sharp the picture of a group is.

    Attributes
    ----------
    relative : float32 array, shape (cell, row)
        Root of the energy above the noise, a little smoothed, in units of `typical`.
    typical : float
        That of the sharpest row of a typical cell, in grey levels.
    """

    relative: Float32Array
    typical: float

    def among(self, usual: float) -> Float32Array:
        """Return `relative`, and less of it where nothing is seen but noise: of a passage whose stretches have this usually."""
        least = FAINTEST * usual
        return self.relative if self.typical >= least else self.relative * np.float32(self.typical / least)


def sharpness(images: ImageArray, shift_px: FloatArray, *, ceiling: float = CEILING) -> Sharpness:
    """Return how sharp the picture of a group is, cell by cell.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
    shift_px : float64 array, shape (frame,)
        ≥ 0, how far the record has turned since the first frame; here to whole pixels.
    ceiling : float
        Cells are not believed to be sharper than so many times the picture's sharpest row.

    Returns
    -------
    Sharpness
    """
    frames, offset, share = whole_pixels(images.shape[2], shift_px)
    energy = np.empty((share.size // CELL_PX, images.shape[1]), np.float32)
    cell_energy(*film_line(images), images.shape[2], frames, offset, share.size, energy)
    return sharpness_of(energy, ceiling=ceiling)


def whole_pixels(frame_width: int, shift_px: FloatArray) -> tuple[IntArray, IntArray, Float32Array]:
    """Return which frames are looked at, where each begins, by whole pixels, and one over how many lie in each column."""
    width = overlay_width(frame_width, shift_px)
    frames = _some_of(shift_px.size)
    offset, share = np.empty(frames.size, np.int64), np.empty(width, np.float32)
    _lay_whole(shift_px, frames, frame_width, offset, share)
    return frames, offset, share


@lru_cache(maxsize=64)
def _some_of(frames: int) -> IntArray:
    """Return the numbers of frames that are looked at, of so many."""
    return np.unique(np.rint(np.linspace(0, frames - 1, min(SOME_FRAMES, frames))).astype(np.int64))


@numba.njit(cache=True, nogil=True)
def _lay_whole(shift_px, frames, frame_width, offset, share):  # type: ignore[no-untyped-def]
    """Write where frames begin, and one over how many lie in each column."""
    width = share.size
    share[:] = 0
    for i, frame in enumerate(frames):
        offset[i] = min(int(np.rint(shift_px[frame])), width - frame_width)
        for x in range(offset[i], offset[i] + frame_width):
            share[x] += 1
    for x in range(width):
        share[x] = 1 / max(np.float64(share[x]), 1.0)


def sharpness_of(energy: Float32Array, *, ceiling: float = CEILING) -> Sharpness:
    """Return how sharp cells of such energies are, see `sharpness`."""
    sharp = np.empty_like(energy)
    return Sharpness(sharp, float(_sharpen(energy, np.float32(ceiling), sharp)))


QUIETEST = 0.1
"""A tenth of the rows are quieter than where nothing is sharp."""
LEAST_WHOLE = 0.15
"""Of the cells, that must show stripes; those of a whole stretch differ by less than 2 in how bright they are."""
EVERY = 8
"""Of so many cells one is looked at to find out how quiet the quietest rows are."""


@numba.njit(cache=True, nogil=True)
def _smooth_cell(far_before, before, here, after, far_after, out):  # type: ignore[no-untyped-def]
    ninth = np.float32(1 / 9)
    for row in range(out.size):
        beside = far_before[row] + far_after[row] + np.float32(2) * (before[row] + after[row])
        out[row] = ninth * (beside + np.float32(3) * here[row])


@numba.njit(cache=True, nogil=True)
def _smooth(energy, out):  # type: ignore[no-untyped-def]
    """A triangle of three cells along the groove: texture is random, and one cell is a poor witness."""
    last = len(energy) - 1
    for cell in range(last + 1):
        before, after = max(cell - 1, 0), min(cell + 1, last)
        far_before, far_after = max(cell - 2, 0), min(cell + 2, last)
        _smooth_cell(energy[far_before], energy[before], energy[cell], energy[after], energy[far_after], out[cell])


@numba.njit(cache=True, nogil=True)
def _sharpen(energy, ceiling, sharp):  # type: ignore[no-untyped-def]
    """Write how sharp cells of such energies are, and return what is typical; see `sharpness`."""
    _smooth(energy, sharp)
    cells, height = sharp.shape
    looked_at = (cells + EVERY - 1) // EVERY
    # a row is quiet all along the stretch, or it is not
    some, usual = np.empty((looked_at, height), np.float32), np.empty(height, np.float32)
    for k in range(looked_at):
        some[k] = sharp[k * EVERY]
    # neighbours change places until all rows are sorted, so many rows at a time as a processor's vector holds
    for turn in range(looked_at):
        for k in range(turn % 2, looked_at - 1, 2):
            _exchange(some[k], some[k + 1])
    _mean_of_two(some[(looked_at - 1) // 2], some[looked_at // 2], usual)
    return _relate(sharp, usual, ceiling)


@numba.njit(cache=True, nogil=True)
def _exchange(one, other):  # type: ignore[no-untyped-def]
    """Write the smaller ones to the first, the larger ones to the second."""
    for row in range(one.size):
        here, there = one[row], other[row]
        one[row], other[row] = min(here, there), max(here, there)


@numba.njit(cache=True, nogil=True)
def _mean_of_two(one, other, out):  # type: ignore[no-untyped-def]
    for row in range(out.size):
        out[row] = np.float32(0.5) * (one[row] + other[row])


@numba.njit(cache=True, nogil=True)
def _root_above(values, noise):  # type: ignore[no-untyped-def]
    for row in range(values.size):
        values[row] = np.sqrt(max(values[row] - noise, np.float32(0)))


@numba.njit(cache=True, nogil=True)
def _limit(cell, gain, ceiling):  # type: ignore[no-untyped-def]
    for row in range(cell.size):
        cell[row] = min(cell[row] * gain, ceiling)


@numba.njit(cache=True, nogil=True)
def _relate(sharp, usual, ceiling):  # type: ignore[no-untyped-def]
    """Turn energies into amplitudes above the noise (what quiet rows usually have), a typical cell's largest being 1.

    Where most of a stretch is chipped off, its typical cell shows nothing, and what is left of the stripes would be too
    bright to stand out; so the brightest cells have a word.
    """
    noise = np.float32(quantile(usual, QUIETEST))
    peak = np.empty(len(sharp), np.float32)
    for cell in range(len(sharp)):
        _root_above(sharp[cell], noise)
        peak[cell] = sharp[cell].max()
    reference = max(quantile(peak, 0.5), 0.5 * quantile(peak, 1 - LEAST_WHOLE))
    gain = np.float32(1 / reference) if reference > 0 else np.float32(0)
    for cell in range(len(sharp)):
        _limit(sharp[cell], gain, ceiling)
    return reference


@numba.njit(cache=True, nogil=True)
def _sums(wide, count, out):  # type: ignore[no-untyped-def]
    """Write sums of so many neighbours, of at least four."""
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for row in range(np.uint64(out.size)):
        out[row] = wide[row] + wide[row + one] + wide[row + two] + wide[row + three]
    added = 4
    while added + 3 <= count:
        here = np.uint64(added)
        for row in range(np.uint64(out.size)):
            out[row] = out[row] + wide[here + row] + wide[here + row + one] + wide[here + row + two]
        added += 3
    for k in range(added, count):
        here = np.uint64(k)
        for row in range(np.uint64(out.size)):
            out[row] += wide[here + row]


@numba.njit(cache=True, nogil=True)
def _less(crest, first, share, flank, far, flank_share, out):  # type: ignore[no-untyped-def]
    begin, beyond = np.uint64(first), np.uint64(far)
    for row in range(np.uint64(out.size)):
        out[row] = share * crest[begin + row] - flank_share * (flank[row] + flank[beyond + row])


@numba.njit(cache=True, nogil=True)
def _ridges(sharp, half, near, far, out):  # type: ignore[no-untyped-def]
    cells, height = sharp.shape
    wide = np.empty(height + 2 * far, np.float32)
    crest = np.empty(height + 2 * (far - half), np.float32)
    flank = np.empty(height + far + near, np.float32)
    share, flank_share = np.float32(1 / (2 * half + 1)), np.float32(0.5 / (far - near + 1))
    for cell in range(cells):
        wide[:far], wide[far : far + height], wide[far + height :] = sharp[cell, 0], sharp[cell], sharp[cell, -1]
        _sums(wide, 2 * half + 1, crest)
        _sums(wide, far - near + 1, flank)
        _less(crest, far - half, share, flank, far + near, flank_share, out[cell])


def ridges(sharp: Float32Array, *, half_px: int = 3, flank_px: tuple[int, int] = (8, 16)) -> Float32Array:
    """Return how much sharper each place is than the rows on either side of it.

    Parameters
    ----------
    sharp : float32 array, shape (cell, row)
    half_px : int
        Half width of a ridge.
    flank_px : (int, int)
        Nearest and furthest row of the flanks.

    Returns
    -------
    float32 array, same shape
        Mean over the ridge minus mean over both flanks; rows beyond the picture repeat the outermost.
    """
    out = np.empty(sharp.shape, np.float32)
    _ridges(sharp, half_px, *flank_px, out)
    return out
