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

*Three grids.* Large discs leave less detail, and need fewer sources; see `blur_grids`.

Rays cut off by the opposite wall or by the edge of the groove are not considered.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.simulation.blur_grids import LARGE, MIDDLE, PER_ROW, SMALL, Grid, Picture, Sources, split


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
    opposite_px = -lever_px
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
                lever_px[place] if away > 0 else opposite_px[place],
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
