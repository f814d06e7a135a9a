"""Blur by discs of changing size: every point of light spreads its energy over a disc of its own.

The light of a point that is out of focus by dz reaches the picture spread over a disc of radius |dz| tan α (α the half
angle of the aperture). Here each source pixel has its own radius, and its energy is *scattered*. A row cuts a disc in a
box, so a source needs two edges in each row, O(R) work in place of O(R²): the edges are added to a row of differences, at
fractions of a pixel, and one running sum turns the row into the picture. Nothing is lost except over the border.

*Tilted surfaces.* A matt wall that slopes by k = dz/dl sends the ray of slope t an intensity proportional to 1 − kt, which
makes up for the crowding of its points seen along that ray: a wall of even brightness looks even, however blurred. The
disc of each source therefore carries a ramp across the rows, 1 + m·dy with m = k tan α · q/R² (q the signed radius); over
a whole disc it sums to one.

*Diffraction.* A disc never gets smaller than `floor_px`: R² = q² + floor². A uniform disc of radius 0.42 λ/NA has the second
moment of the Gaussian that is nearest to the Airy disc.

*Two grids.* Large discs leave no detail, so their sources are gathered into 4 × 4 blocks first and spread on a coarser
grid; the radius is reduced so that block, disc and interpolation together have exactly the second moment of the disc.
Between `SMALL_PX` and `LARGE_PX` a source gives a smoothly changing share to both.

Rays cut off by the opposite wall or by the edge of the groove are not considered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray

Picture = npt.NDArray[np.float32]

COARSE = 4
SMALL_PX = 10.0
LARGE_PX = 14.0
BINS_PER_PX = 64
LARGEST_PX = 144
"""Discs are not made larger than this; a multiple of `COARSE`. The light of a surface so far off has no detail at all."""

# variance along one axis, in pixels², that the coarse grid adds: points gathered into a block, the coarse pixel's box, and
# linear interpolation between coarse pixels
_GRID_VARIANCE = (COARSE**2 - 1) / 12 + COARSE**2 / 12 + COARSE**2 / 6


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs of all radii, row by row.

    Attributes
    ----------
    half_px : float32 array, shape (|dy|, radius bin)
        Half the length of the disc in the row dy away from its centre.
    density : float32 array, same shape
        Share of the energy for each pixel of that length; 0 where the disc does not reach.
    """

    half_px: Picture
    density: Picture


def disc_table(largest_px: float) -> Discs:
    """Tabulate discs of radius 0 … `largest_px` in steps of 1/`BINS_PER_PX`."""
    radius = np.maximum(np.arange(int(largest_px * BINS_PER_PX) + 2) / BINS_PER_PX, 0.5 / BINS_PER_PX)[:, None]
    row = np.arange(int(largest_px) + 2)[None, :]
    low, high = np.clip(row - 0.5, -radius, radius), np.clip(row + 0.5, -radius, radius)
    area = _area_below(high, radius) - _area_below(low, radius)
    reached = high - low
    half = np.divide(area, 2 * reached, out=np.zeros_like(area), where=reached > 0)
    # a box of height `reached` and of the same area; its share of the disc, spread over its length
    density = np.where(reached > 0, reached / (np.pi * radius**2), 0.0)
    return Discs(np.ascontiguousarray(half.T, np.float32), np.ascontiguousarray(density.T, np.float32))


def _area_below(y: FloatArray, radius: FloatArray) -> FloatArray:
    """Return the area of a disc between its centre line and the height y."""
    return np.asarray(y * np.sqrt(np.maximum(radius**2 - y**2, 0)) + radius**2 * np.arcsin(np.clip(y / radius, -1, 1)))


FINE_DISCS = disc_table(LARGE_PX + 1)
COARSE_DISCS = disc_table(LARGEST_PX / COARSE + 1)


@dataclass(frozen=True, eq=False)
class Sources:
    """Points of light on a grid, each with its disc.

    Attributes
    ----------
    energy : float32 array, shape (2, row, column)
        Of the surface as it is, and of the same surface with brightness 1 everywhere.
    bin : int16 array, shape (row, column)
        Radius × `BINS_PER_PX`.
    ramp : float32 array, shape (row, column)
        m, for a pixel of this grid.
    """

    energy: Picture
    bin: npt.NDArray[np.int16]
    ramp: Picture


def scatter(light: Picture, radius_px: Picture, slope_tan: Picture, *, floor_px: float, margin_px: int) -> Picture:
    """Return the energy that points of light, each blurred by its own disc, send to the pixels of a picture.

    Parameters
    ----------
    light : float32 array, shape (row, column)
        Brightness of each source; both sides multiples of `COARSE`.
    radius_px : float32 array, same shape
        Signed radius q = dz tan α of each source's disc, in pixels; positive nearer to the lens than the sharp plane.
    slope_tan : float32 array, same shape
        k tan α, slope of the surface along the rows times the aperture; limited to ± 1.
    floor_px : float
        Radius that diffraction leaves in focus, positive.
    margin_px : int
        Rows and columns that only serve as sources, a multiple of `COARSE`; the picture has twice as many fewer.

    Returns
    -------
    float32 array, shape (2, row − 2 margin, column − 2 margin)
        Of the surface as it is, and of the same surface with brightness 1 everywhere.
    """
    fine, coarse = split(light, radius_px, slope_tan, np.float32(floor_px))
    rows, columns = light.shape[0] - 2 * margin_px, light.shape[1] - 2 * margin_px
    picture = np.empty((2, rows, columns), np.float32)
    _spread(fine.energy, fine.bin, fine.ramp, FINE_DISCS.half_px, FINE_DISCS.density, margin_px, picture)
    # one coarse pixel more on every side, for the interpolation
    around = min(margin_px // COARSE, 1)
    blocks = np.empty((2, rows // COARSE + 2 * around, columns // COARSE + 2 * around), np.float32)
    inset = margin_px // COARSE - around
    _spread(coarse.energy, coarse.bin, coarse.ramp, COARSE_DISCS.half_px, COARSE_DISCS.density, inset, blocks)
    for kind in range(2):
        _add_interpolated(blocks[kind], around, picture[kind])
    return picture


def blur(light: Picture, radius_px: Picture, slope_tan: Picture, *, floor_px: float, margin_px: int) -> Picture:
    """Return the picture of a surface, each point blurred by its own disc; parameters as for `scatter`.

    A lens does not change radiance: a pixel shows the mean brightness of the surface over its cone of rays, and a surface
    of even brightness looks even. The scattered energy is therefore divided by that of a surface of brightness 1, which
    takes away what is left of the pixels' raster, and the loss over the border.

    Returns
    -------
    float32 array, shape (row − 2 margin, column − 2 margin)
        NaN where no source sends any light.
    """
    energy = scatter(light, radius_px, slope_tan, floor_px=floor_px, margin_px=margin_px)
    picture: Picture = np.full_like(energy[0], np.nan)
    np.divide(energy[0], energy[1], out=picture, where=energy[1] > 0)
    return picture


def split(light: Picture, radius_px: Picture, slope_tan: Picture, floor_px: np.float32) -> tuple[Sources, Sources]:
    """Divide points of light into those with small discs, on their own grid, and those with large ones, in blocks."""
    shape = light.shape
    fine = Sources(np.empty((2, *shape), np.float32), np.empty(shape, np.int16), np.empty(shape, np.float32))
    large = np.zeros((4, shape[0] // COARSE, shape[1] // COARSE), np.float32)
    _split(light, radius_px, slope_tan, floor_px, fine.energy, fine.bin, fine.ramp, large)
    return fine, _coarse_sources(large)


def _coarse_sources(large: Picture) -> Sources:
    """Turn the sums over blocks of light, share, share × R² and share × slope into the blocks' own discs."""
    share = 1 / np.maximum(large[1], np.float32(1e-6))
    square = np.maximum(large[2] * share - np.float32(4 * _GRID_VARIANCE), np.float32(1))
    radius = np.minimum(np.sqrt(square), np.float32(LARGEST_PX)) / np.float32(COARSE)
    bins = np.round(radius * np.float32(BINS_PER_PX)).astype(np.int16)
    return Sources(large[:2] / np.float32(COARSE**2), bins, large[3] * share / radius)


@numba.njit(cache=True, nogil=True)
def _split(
    light: Picture,
    radius_px: Picture,
    slope_tan: Picture,
    floor_px: np.float32,
    energy: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
    large: Picture,
) -> None:
    for row in range(light.shape[0]):
        lit, even = energy[0, row], energy[1, row]
        _split_row(light[row], radius_px[row], slope_tan[row], floor_px, lit, even, bins[row], ramp[row])
        _gather_row(light[row], even, radius_px[row], slope_tan[row], floor_px, large[:, row // COARSE])


@numba.njit(cache=True, nogil=True)
def _split_row(
    light: Picture,
    radius_px: Picture,
    slope_tan: Picture,
    floor_px: np.float32,
    lit: Picture,
    even: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
) -> None:
    one, zero = np.float32(1), np.float32(0)
    for column in range(len(light)):
        signed = radius_px[column]
        square = signed * signed + floor_px * floor_px
        radius = np.sqrt(square)
        part = min(max((np.float32(LARGE_PX) - radius) / np.float32(LARGE_PX - SMALL_PX), zero), one)
        even[column] = part * part * (np.float32(3) - np.float32(2) * part)
        lit[column] = light[column] * even[column]
        bins[column] = np.int16(min(radius, np.float32(LARGE_PX)) * np.float32(BINS_PER_PX) + np.float32(0.5))
        ramp[column] = min(max(slope_tan[column], -one), one) * signed / square


@numba.njit(cache=True, nogil=True)
def _gather_row(
    light: Picture, even: Picture, radius_px: Picture, slope_tan: Picture, floor_px: np.float32, large: Picture
) -> None:
    one = np.float32(1)
    for column in range(len(light)):
        rest = one - even[column]
        signed = radius_px[column]
        tilt = min(max(slope_tan[column], -one), one)
        block = column // COARSE
        large[0, block] += rest * light[column]
        large[1, block] += rest
        large[2, block] += rest * (signed * signed + floor_px * floor_px)
        large[3, block] += rest * (tilt if signed > 0 else -tilt)


@numba.njit(cache=True, nogil=True)
def _spread(
    energy: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
    half_px: Picture,
    density: Picture,
    margin: int,
    picture: Picture,
) -> None:
    """Scatter the discs of all sources into a picture that begins a margin inside the grid of sources."""
    rows, columns = bins.shape
    reach = half_px.shape[0] - 1
    first, last = _active_columns(energy[1])
    steps = np.zeros((columns + 2 * reach + 4, 2))
    for row in range(picture.shape[1]):
        steps[:] = 0
        centre = row + margin
        for source in range(max(0, centre - reach), min(rows, centre + reach + 1)):
            away = centre - source
            span = slice(first[source], last[source])
            _add_edges(
                energy[:, source, span],
                bins[source, span],
                ramp[source, span],
                away,
                half_px[abs(away)],
                density[abs(away)],
                steps[first[source] :],
                reach,
            )
        _running_sum(steps, margin + reach, picture[:, row])


@numba.njit(cache=True, nogil=True)
def _active_columns(energy: Picture) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return where in each row the first and behind the last source lie that send any light."""
    rows, columns = energy.shape
    first, last = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
    for row in range(rows):
        start, stop = 0, columns
        while start < columns and energy[row, start] == 0:
            start += 1
        while stop > start and energy[row, stop - 1] == 0:
            stop -= 1
        first[row], last[row] = start, stop
    return first, last


@numba.njit(cache=True, nogil=True)
def _add_edges(
    energy: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
    away: int,
    half_px: Picture,
    density: Picture,
    steps: FloatArray,
    reach: int,
) -> None:
    """Add the two edges that each source's disc has in the row `away` rows further on; `steps` begins `reach` earlier."""
    for column in range(len(bins)):
        disc = bins[column]
        share = density[disc] * max(np.float32(1) + ramp[column] * np.float32(away), np.float32(0))
        if share > 0:
            lit, even = energy[0, column] * share, energy[1, column] * share
            middle = np.float64(column + reach) + 0.5
            _add_step(steps, middle - half_px[disc], lit, even)
            _add_step(steps, middle + half_px[disc], -lit, -even)


@numba.njit(cache=True, nogil=True, inline="always")
def _add_step(steps: FloatArray, place: float, lit: float, even: float) -> None:
    """Let both running sums rise at a place that may lie inside a pixel (which covers i … i + 1)."""
    i = int(place)
    after = place - i
    steps[i, 0] += lit * (1 - after)
    steps[i, 1] += even * (1 - after)
    steps[i + 1, 0] += lit * after
    steps[i + 1, 1] += even * after


@numba.njit(cache=True, nogil=True)
def _running_sum(steps: FloatArray, skip: int, out: Picture) -> None:
    lit, even = 0.0, 0.0
    for i in range(skip):
        lit += steps[i, 0]
        even += steps[i, 1]
    for column in range(out.shape[1]):
        lit += steps[skip + column, 0]
        even += steps[skip + column, 1]
        out[0, column] = lit
        out[1, column] = even


@numba.njit(cache=True, nogil=True)
def _add_interpolated(blocks: Picture, around: int, picture: Picture) -> None:
    """Add a coarse picture, linearly interpolated, to a fine one; coarse pixel `around` covers the first `COARSE` rows."""
    rows, columns = blocks.shape
    between = np.empty(columns, np.float32)
    for row in range(picture.shape[0]):
        place = min(max((row + 0.5) / COARSE - 0.5 + around, 0.0), rows - 1.0)
        low = min(int(place), rows - 2)
        share = np.float32(place - low)
        for column in range(columns):
            between[column] = blocks[low, column] * (1 - share) + blocks[low + 1, column] * share
        _add_row_interpolated(between, around, picture[row])


@numba.njit(cache=True, nogil=True)
def _add_row_interpolated(blocks: Picture, around: int, out: Picture) -> None:
    for column in range(len(out)):
        place = min(max((column + 0.5) / COARSE - 0.5 + around, 0.0), len(blocks) - 1.0)
        low = min(int(place), len(blocks) - 2)
        share = np.float32(place - low)
        out[column] += blocks[low] * (1 - share) + blocks[low + 1] * share
