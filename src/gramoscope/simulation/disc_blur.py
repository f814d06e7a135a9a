"""Blur by discs of changing size: every point of light spreads its energy over a disc of its own.

The light of a point that is out of focus by dz reaches the picture spread over a disc of radius |dz| tan α (α the half
angle of the aperture). Here each source has its own radius, and its energy is *scattered*. A row cuts a disc in a box (of
the same area and second moment), so a source needs two edges in each row, O(R) work in place of O(R²): the edges are added
to a row of differences, at fractions of a pixel, and one running sum turns the row into the picture. Nothing is lost
except over the border.

*Tilted surfaces.* A matt wall that slopes by k = dz/dl sends the ray of slope t an intensity proportional to 1 − kt, which
makes up for the crowding of its points seen along that ray: a wall of even brightness looks even, however blurred. The
disc of each source therefore carries a ramp across the rows, 1 + m·dy with m = k tan α · q/R² (q the signed radius); over
a whole disc it sums to one.

*Diffraction.* A disc never gets smaller than `floor_px`: R² = q² + floor². A uniform disc of radius 0.42 λ/NA has the second
moment of the Gaussian that is nearest to the Airy disc.

*Two sources a row.* A wall is seen foreshortened: at 45° a row shows 1.4 times as much of it as a column, and one source a
row would be too few for its grains. They would be false before any blur, and differently so wherever the wall lies between
two rows. So there are `PER_ROW` sources for each row of the picture (and one for each column).

*Three grids.* Large discs leave less detail, and need fewer sources. Those with small discs are spread singly, each as a
strip of two parts with a disc of its own, for on a wall radii change from row to row. Those with middle ones are gathered into
blocks one row high, those with large ones into square blocks. Discs are made smaller, as ellipses, by just so much that
block, grid and interpolation together have the second moments of disc and pixel. From grid to grid a source's share changes
smoothly with its radius (`TO_MIDDLE_PX`, `TO_LARGE_PX`), so late that the raster of the rows is not seen when a groove moves
by part of a row. Along the groove blocks may be wider, because that raster is fixed to the record.

Rays cut off by the opposite wall or by the edge of the groove are not considered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray

Picture = npt.NDArray[np.float32]

PER_ROW = 2
PARTS = 2
"""Parts of a source with a small disc."""
COARSE = 4
"""All sides of a picture are multiples of the largest blocks."""
TO_MIDDLE_PX = (8.0, 11.0)
TO_LARGE_PX = (44.0, 56.0)
LARGEST_PX = 144
"""Discs are not made larger than this; a multiple of `COARSE`. The light of a surface so far off has no detail at all."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A raster of sources and of the picture they are spread on, and discs of all radii for it.

    Attributes
    ----------
    tall_px, wide_px : int
        Size of a pixel of this picture.
    per_row : int
        Parts of sources in each of its rows.
    bins_per_px : int
        How finely radii are told apart.
    half : float32 array, shape (place, radius bin)
        Half the length, in pixels of this picture, of the box that stands for the disc in a row whose distance from the disc's
        centre is 0, 1, 2 … rows for one part a row, 1/8, 3/8, 5/8 … for four.
    density : float32 array, same shape
        Share of the energy for each pixel of that length; 0 where the disc does not reach.
    lever_px : float32 array, same shape
        How far the light that falls into the row lies from the disc's centre, in the mean.
    """

    tall_px: int
    wide_px: int
    per_row: int
    bins_per_px: int
    half: Picture
    density: Picture
    lever_px: Picture


def grid(tall_px: int, wide_px: int, *, per_row: int, largest_px: float, bins_per_px: int) -> Grid:
    """Tabulate discs of radius 0 … `largest_px` for a raster; `per_row` is 1 or even."""
    radius = (np.maximum(np.arange(int(largest_px * bins_per_px) + 2), 0.5) / bins_per_px)[:, None]
    upright, sideways = (
        np.sqrt(np.maximum(radius**2 - 4 * added, (radius / 2) ** 2)) for added in _added_px2(tall_px, wide_px, per_row)
    )
    place = np.arange(per_row * (int(largest_px / tall_px) + 2))
    row = (place + (0.5 if per_row > 1 else 0)) / per_row
    low, high = (np.clip((row + side) * tall_px / upright, -1, 1) for side in (-0.5, 0.5))
    area, moment, cubes = (part(high) - part(low) for part in (_area_below, _moment_below, _cubes_below))
    reached = high - low > 1e-6
    length, lever = (np.divide(sums, area, out=np.zeros_like(area), where=reached) for sums in (cubes, moment))
    half = np.sqrt(length) * sideways / wide_px
    density = np.divide(area, 2 * np.pi * half, out=np.zeros_like(area), where=reached)
    tables = (np.ascontiguousarray(table.T, np.float32) for table in (half, density, lever * radius))
    return Grid(tall_px, wide_px, per_row, bins_per_px, *tables)


def _added_px2(tall_px: int, wide_px: int, per_row: int) -> tuple[float, float]:
    """Return the variances that a grid adds to a disc, down the rows and along them, in pixels².

    Those of sources gathered into a block, of the block in place of a pixel, and of linear interpolation between blocks.
    """
    gathered = (tall_px**2 - 1 / PER_ROW**2) / 12 if per_row == 1 else (1 / PER_ROW**2 - 1 / per_row**2) / 12
    # box side²/12, interpolation side²/6 + 1/12, less the pixel's own box
    shown = [side**2 / 4 if side > 1 else 0.0 for side in (tall_px, wide_px)]
    return gathered + shown[0], (wide_px**2 - 1) / 12 + shown[1]


# of a disc of radius 1 with the half length h = √(1 − y²) at the height y, between its centre line and y:


def _area_below(y: FloatArray) -> FloatArray:
    """Return ∫ 2h dy."""
    return np.asarray(y * np.sqrt(1 - y**2) + np.arcsin(y))


def _moment_below(y: FloatArray) -> FloatArray:
    """Return ∫ 2h y dy."""
    return np.asarray(2 / 3 * (1 - (1 - y**2) ** 1.5))


def _cubes_below(y: FloatArray) -> FloatArray:
    """Return ∫ 2h³ dy."""
    return np.asarray(y * (5 - 2 * y**2) / 4 * np.sqrt(1 - y**2) + 3 / 4 * np.arcsin(y))


SMALL = grid(1, 1, per_row=PARTS * PER_ROW, largest_px=TO_MIDDLE_PX[1] + 1, bins_per_px=256)
MIDDLE = grid(1, 4, per_row=1, largest_px=TO_LARGE_PX[1], bins_per_px=64)
LARGE = grid(COARSE, COARSE, per_row=1, largest_px=LARGEST_PX, bins_per_px=16)
# for the kernels
SMALL_BINS_PER_PX = SMALL.bins_per_px
MIDDLE_ROWS, LARGE_ROWS = MIDDLE.tall_px * PER_ROW, LARGE.tall_px * PER_ROW


@dataclass(frozen=True, eq=False)
class Sources:
    """Points of light on the raster of a grid, each with its disc.

    Attributes
    ----------
    energy : float32 array, shape (2, row, column)
        Of each part, of the surface as it is, and of the same surface with brightness 1 everywhere.
    bin : int16 array, shape (part, row, column)
        Radius × `Grid.bins_per_px`.
    ramp : float32 array, shape (row, column)
        m, for a pixel.
    """

    energy: Picture
    bin: npt.NDArray[np.int16]
    ramp: Picture


def scatter(light: Picture, radius_px: Picture, slope_tan: Picture, *, floor_px: float, margin_px: int) -> Picture:
    """Return the energy that points of light, each blurred by its own disc, send to the pixels of a picture.

    Parameters
    ----------
    light : float32 array, shape (source row, column)
        Brightness of each source, `PER_ROW` of them in each row of pixels; source row j lies at row (j + 1/2) / `PER_ROW`
        − 1/2. Rows of pixels and columns are multiples of `COARSE`.
    radius_px : float32 array, same shape
        Signed radius q = dz tan α of each source's disc, in pixels; positive nearer to the lens than the sharp plane.
    slope_tan : float32 array, same shape
        k tan α, slope of the surface along the rows times the aperture; limited to ± 1.
    floor_px : float
        Radius that diffraction leaves in focus, positive.
    margin_px : int
        Rows and columns of pixels that only serve as sources, a multiple of `COARSE`; the picture has twice as many fewer.

    Returns
    -------
    float32 array, shape (2, source row / `PER_ROW` − 2 margin, column − 2 margin)
        Of the surface as it is, and of the same surface with brightness 1 everywhere.
    """
    picture = np.zeros((2, light.shape[0] // PER_ROW - 2 * margin_px, light.shape[1] - 2 * margin_px), np.float32)
    sources = split(light, radius_px, slope_tan, np.float32(floor_px))
    for on, points in zip((SMALL, MIDDLE, LARGE), sources, strict=True):
        _add_grid(on, points, margin_px, picture)
    return picture


def _add_grid(on: Grid, sources: Sources, margin_px: int, picture: Picture) -> None:
    """Spread sources on their own grid and add what they show to a picture that the caller owns."""
    above, before = margin_px // on.tall_px, margin_px // on.wide_px
    # one block more on every side where the picture lies between blocks
    up, back = min(above, int(on.tall_px > 1)), min(before, int(on.wide_px > 1))
    rows, columns = picture.shape[1] // on.tall_px + 2 * up, picture.shape[2] // on.wide_px + 2 * back
    shown = np.empty((2, rows, columns), np.float32)
    discs = on.half, on.density, on.lever_px, on.per_row
    _spread(sources.energy, sources.bin, sources.ramp, discs, above - up, before - back, shown)
    for kind in range(2):
        _add_interpolated(shown[kind], up, back, on.tall_px, on.wide_px, picture[kind])


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


def split(light: Picture, radius_px: Picture, slope_tan: Picture, floor_px: np.float32) -> tuple[Sources, ...]:
    """Divide points of light into those with small discs, on their own grid, and those with larger ones, in blocks."""
    shape = light.shape
    small = Sources(np.empty((2, *shape), np.float32), np.empty((PARTS, *shape), np.int16), np.empty(shape, np.float32))
    middle, large = (
        np.zeros((4, shape[0] // (PER_ROW * on.tall_px), shape[1] // on.wide_px), np.float32) for on in (MIDDLE, LARGE)
    )
    _split(light, radius_px, slope_tan, floor_px, small.energy, small.bin, small.ramp, middle, large)
    return small, _block_sources(middle, MIDDLE), _block_sources(large, LARGE)


def _block_sources(sums: Picture, on: Grid) -> Sources:
    """Turn the sums over blocks of light, share, share × R² and share × slope into the blocks' own discs."""
    share = 1 / np.maximum(sums[1], np.float32(1e-6))
    largest = (on.half.shape[1] - 1) / on.bins_per_px
    radius = np.clip(np.sqrt(sums[2] * share), np.float32(1), np.float32(largest))
    bins = np.round(radius * np.float32(on.bins_per_px)).astype(np.int16)[None]
    return Sources(sums[:2] / np.float32(PER_ROW * on.tall_px * on.wide_px), bins, sums[3] * share / radius)


@numba.njit(cache=True, nogil=True)
def _split(
    light: Picture,
    radius_px: Picture,
    slope_tan: Picture,
    floor_px: np.float32,
    energy: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
    middle: Picture,
    large: Picture,
) -> None:
    shares = np.empty((2, light.shape[1]), np.float32)
    for row in range(light.shape[0]):
        lit, even = energy[0, row], energy[1, row]
        _split_row(light[row], radius_px[row], slope_tan[row], floor_px, lit, even, bins[:, row], ramp[row], shares)
        _gather_row(light[row], shares[0], radius_px[row], slope_tan[row], floor_px, middle[:, row // MIDDLE_ROWS])
        _gather_row(light[row], shares[1], radius_px[row], slope_tan[row], floor_px, large[:, row // LARGE_ROWS])


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
    shares: Picture,
) -> None:
    """Give each source its energy, disc and ramp on the smallest grid, and its shares in the other two."""
    one, share = np.float32(1), np.float32(1 / (PARTS * PER_ROW))
    for column in range(len(light)):
        signed = radius_px[column]
        square = signed * signed + floor_px * floor_px
        radius = np.sqrt(square)
        tilt = min(max(slope_tan[column], -one), one)
        large = _rise(radius, TO_LARGE_PX)
        small = one - _rise(radius, TO_MIDDLE_PX)
        even[column] = small * share
        lit[column] = light[column] * even[column]
        ramp[column] = tilt * signed / square
        for part in range(PARTS):
            aside = tilt * np.float32((part + 0.5) / PARTS - 0.5) / np.float32(PER_ROW)
            bins[part, column] = _small_bin(signed + aside, floor_px)
        shares[0, column] = one - small - large
        shares[1, column] = large


@numba.njit(cache=True, nogil=True, inline="always")
def _small_bin(signed: np.float32, floor_px: np.float32) -> np.int16:
    radius = np.sqrt(signed * signed + floor_px * floor_px)
    return np.int16(min(radius, np.float32(TO_MIDDLE_PX[1] + 1)) * np.float32(SMALL_BINS_PER_PX) + np.float32(0.5))


@numba.njit(cache=True, nogil=True, inline="always")
def _rise(radius: np.float32, between_px: tuple[float, float]) -> np.float32:
    """Rise smoothly from 0 to 1 between two radii."""
    low, high = np.float32(between_px[0]), np.float32(between_px[1])
    part = min(max((radius - low) / (high - low), np.float32(0)), np.float32(1))
    return part * part * (np.float32(3) - np.float32(2) * part)


@numba.njit(cache=True, nogil=True)
def _gather_row(
    light: Picture,
    share: Picture,
    radius_px: Picture,
    slope_tan: Picture,
    floor_px: np.float32,
    sums: Picture,
) -> None:
    one, wide = np.float32(1), len(light) // sums.shape[1]
    for column in range(len(light)):
        rest = share[column]
        if rest > 0:
            signed = radius_px[column]
            tilt = min(max(slope_tan[column], -one), one)
            block = column // wide
            sums[0, block] += rest * light[column]
            sums[1, block] += rest
            sums[2, block] += rest * (signed * signed + floor_px * floor_px)
            sums[3, block] += rest * (tilt if signed > 0 else -tilt)


@numba.njit(cache=True, nogil=True)
def _spread(
    energy: Picture,
    bins: npt.NDArray[np.int16],
    ramp: Picture,
    discs: tuple[Picture, Picture, Picture, int],
    above: int,
    before: int,
    picture: Picture,
) -> None:
    """Scatter the discs of all sources into a picture that begins some rows and columns inside their raster."""
    half, density, lever_px, per_row = discs
    parts, rows, columns = bins.shape
    reach, beyond = len(half) // per_row, int(np.ceil(np.max(half)))
    first, last = _active_columns(energy[1])
    tallest = _tallest(bins, energy[1], density)
    steps = np.zeros((columns + 2 * beyond + 4, 2))
    for row in range(picture.shape[1]):
        steps[:] = 0
        centre = row + above
        for part in range(max(0, (centre - reach) * per_row), min(rows * parts, (centre + reach + 1) * per_row)):
            # in parts, from the centre of this one to the centre of the row
            away = (centre + 0.5) * per_row - (part + 0.5)
            place, source = int(abs(away)), part // parts
            if place >= tallest[source]:
                continue
            span = slice(first[source], last[source])
            _add_edges(
                energy[:, source, span],
                bins[part % parts, source, span],
                ramp[source, span],
                half[place],
                density[place],
                lever_px[place] * np.float32(np.sign(away)),
                steps[first[source] :],
                beyond,
            )
        _running_sum(steps, before + beyond, picture[:, row])


@numba.njit(cache=True, nogil=True)
def _tallest(bins: npt.NDArray[np.int16], energy: Picture, density: Picture) -> npt.NDArray[np.int64]:
    """Return for each row of sources how many places of the table its largest disc reaches; 0 for rows without light."""
    places = np.zeros(density.shape[1], np.int64)
    for place in range(len(density)):
        places[density[place] > 0] = place + 1
    tallest = np.zeros(len(energy), np.int64)
    for part in range(len(bins)):
        for row in range(len(energy)):
            tallest[row] = max(tallest[row], _tallest_of_row(bins[part, row], energy[row], places))
    return tallest


@numba.njit(cache=True, nogil=True)
def _tallest_of_row(bins: npt.NDArray[np.int16], energy: Picture, places: npt.NDArray[np.int64]) -> int:
    largest = -1
    for column in range(len(bins)):
        if energy[column] > 0:
            largest = max(largest, bins[column])
    return places[largest] if largest >= 0 else 0


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
    half: Picture,
    density: Picture,
    lever_px: Picture,
    steps: FloatArray,
    beyond: int,
) -> None:
    """Add the two edges that each source's disc has in one row; `steps` begins `beyond` earlier."""
    for column in range(len(bins)):
        disc = bins[column]
        share = density[disc] * max(np.float32(1) + ramp[column] * lever_px[disc], np.float32(0))
        if share > 0:
            lit, even = energy[0, column] * share, energy[1, column] * share
            middle = np.float64(column + beyond) + 0.5
            _add_step(steps, middle - half[disc], lit, even)
            _add_step(steps, middle + half[disc], -lit, -even)


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
def _add_interpolated(blocks: Picture, above: int, before: int, tall: int, wide: int, picture: Picture) -> None:
    """Add blocks, linearly interpolated, to pixels, which begin some blocks further down and on."""
    rows, columns = blocks.shape
    between = np.empty(columns, np.float32)
    for row in range(picture.shape[0]):
        place = min(max((row + 0.5) / tall - 0.5 + above, 0.0), rows - 1.0)
        low = min(int(place), rows - 2)
        share = np.float32(place - low)
        for column in range(columns):
            between[column] = blocks[low, column] * (1 - share) + blocks[low + 1, column] * share
        _add_row_interpolated(between, before, wide, picture[row])


@numba.njit(cache=True, nogil=True)
def _add_row_interpolated(blocks: Picture, before: int, wide: int, out: Picture) -> None:
    for column in range(len(out)):
        place = min(max((column + 0.5) / wide - 0.5 + before, 0.0), len(blocks) - 1.0)
        low = min(int(place), len(blocks) - 2)
        share = np.float32(place - low)
        out[column] += blocks[low] * (1 - share) + blocks[low + 1] * share
