"""Which discs of light are spread on which grid: small ones singly, larger ones in blocks.

Large discs leave less detail, and need fewer sources. Those with small discs are spread singly, each as a strip of two parts
with a disc of its own, for on a wall radii change from row to row. Those with middle ones are gathered into blocks one row
high, those with large ones into square blocks. Discs are made smaller, as ellipses, by just so much that block, grid and
interpolation together have the second moments of disc and pixel. From grid to grid a source's share changes smoothly with
its radius (`TO_MIDDLE_PX`, `TO_LARGE_PX`), so late that the raster of the rows is not seen when a groove moves by part of a
row. Along the groove blocks may be wider, because that raster is fixed to the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray

Picture = npt.NDArray[np.float32]

PER_ROW = 2
"""Sources across each row of a picture."""
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
SMALLS_LAST_BIN = SMALL.half.shape[1] - 1
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
            bins[part, column] = _small_bin(signed + aside, floor_px) if small > 0 else SMALLS_LAST_BIN
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
