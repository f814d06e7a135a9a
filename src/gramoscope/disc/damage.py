"""What time did to the record: scratches, chips, dust.

Each is a small change of the surface, its height and its albedo, at a fixed place of the record; where they lie is drawn
from a hashed seed millimetre by millimetre, so that any stretch can be rendered in any order. A *scratch* is a shallow
ploughed line. A *chip* is a piece of wall that broke away (paper, figure 7: "nearly half of the groove walls is missing"):
what it leaves is rough, of another brightness, and not at the depth where the wall was. *Dust* lies on top and throws
most light away. How often and how big is guesswork; shapes were chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from gramoscope.conventions import FloatArray
from gramoscope.errors import require

Picture = npt.NDArray[np.float32]

TILE_M = 1e-3
FIRST_TILE = 1 << 30
STREAM = 0xDA3A
ACROSS_M = 350e-6
"""Scratches and dust lie up to this far from the middle of the groove."""
REACH_M = 0.6e-3
"""No mark reaches further along the groove from where it lies."""


class Mark(Protocol):
    """One place where the surface is not as it was pressed."""

    @property
    def centre_m(self) -> tuple[float, float]:
        """Where it lies, (s, l)."""

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far it reaches from there along s and l."""

    def spoil(self, height_m: Picture, albedo: Picture, arc_m: FloatArray, lateral_m: FloatArray) -> None:
        """Change a patch of surface in place; `arc_m` has shape (1, column), `lateral_m` (row, 1)."""


@dataclass(frozen=True)
class Scratch:
    """A straight ploughed line; `angle_rad` from the direction of the groove, `gain` the change of albedo along it."""

    centre_m: tuple[float, float]
    angle_rad: float
    length_m: float
    width_m: float
    depth_m: float
    gain: float

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far it reaches from its centre along s and l."""
        half, room = self.length_m / 2, 3 * self.width_m
        return half * abs(np.cos(self.angle_rad)) + room, half * abs(np.sin(self.angle_rad)) + room

    def spoil(self, height_m: Picture, albedo: Picture, arc_m: FloatArray, lateral_m: FloatArray) -> None:
        """Plough the line into a patch of surface."""
        ahead, left = arc_m - self.centre_m[0], lateral_m - self.centre_m[1]
        cosine, sine = np.cos(self.angle_rad), np.sin(self.angle_rad)
        along, beside = ahead * cosine + left * sine, left * cosine - ahead * sine
        past_end = np.maximum(np.abs(along) - self.length_m / 2, 0)
        profile = np.exp(-(beside**2 + past_end**2) / self.width_m**2)
        height_m -= (self.depth_m * profile).astype(np.float32)
        albedo *= (1 + self.gain * profile).astype(np.float32)


@dataclass(frozen=True)
class Chip:
    """A piece broken out of a wall, with ragged edges; `tint` is the brightness of the break, `seed` its roughness."""

    centre_m: tuple[float, float]
    length_m: float
    width_m: float
    depth_m: float
    tint: float
    seed: int

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far it reaches from its centre along s and l."""
        return 0.75 * self.length_m, 0.75 * self.width_m

    def spoil(self, height_m: Picture, albedo: Picture, arc_m: FloatArray, lateral_m: FloatArray) -> None:
        """Break the piece out of a patch of surface."""
        ahead, left = arc_m - self.centre_m[0], lateral_m - self.centre_m[1]
        ragged, coarse, fine = (
            _roughness(ahead, left, cell_m=cell_m, seed=self.seed + i) for i, cell_m in enumerate((14e-6, 9e-6, 2.5e-6))
        )
        # a superellipse is nearly a rectangle with round corners
        inside = 1 - (2 * ahead / self.length_m) ** 4 - (2 * left / self.width_m) ** 4 + 0.35 * ragged
        missing = 1 / (1 + np.exp(-np.clip(12 * inside, -40, 40)))
        height_m -= (missing * self.depth_m * np.maximum(0.2, 1 + 0.5 * coarse + 0.1 * fine)).astype(np.float32)
        albedo *= (1 + missing * (self.tint * np.maximum(0.1, 1 + 0.3 * coarse + 0.25 * fine) - 1)).astype(np.float32)


@dataclass(frozen=True)
class Dust:
    """A speck or a short fibre on the surface; `elongation` is its length over its breadth."""

    centre_m: tuple[float, float]
    radius_m: float
    elongation: float
    angle_rad: float
    tint: float

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far it reaches from its centre along s and l."""
        reach = 1.5 * self.radius_m * self.elongation
        return reach, reach

    def spoil(self, height_m: Picture, albedo: Picture, arc_m: FloatArray, lateral_m: FloatArray) -> None:
        """Lay the speck on a patch of surface."""
        ahead, left = arc_m - self.centre_m[0], lateral_m - self.centre_m[1]
        cosine, sine = np.cos(self.angle_rad), np.sin(self.angle_rad)
        along, beside = (ahead * cosine + left * sine) / self.elongation, left * cosine - ahead * sine
        around = np.arctan2(beside, along)
        outline = self.radius_m * (1 + 0.2 * np.cos(2 * around + self.angle_rad) + 0.1 * np.cos(5 * around))
        closeness = np.clip(1 - (along**2 + beside**2) / outline**2, 0, 1)
        height_m += (self.radius_m * np.sqrt(closeness)).astype(np.float32)
        albedo *= (1 + (self.tint - 1) * np.minimum(1, 4 * closeness)).astype(np.float32)


@dataclass(frozen=True)
class Damage:
    """How badly a record has suffered: marks of each kind on a metre of groove, and the usual size of a chip.

    Parameters
    ----------
    scratches_per_m, chips_per_m, dust_per_m : float
        Zero or more, in a band of ± `ACROSS_M` about the groove; chips lie on the walls.
    chip_length_m, chip_depth_m : float
        Mean of their spread, positive; no chip is longer than twice the mean.
    """

    scratches_per_m: float = 0.0
    chips_per_m: float = 0.0
    dust_per_m: float = 0.0
    chip_length_m: float = 150e-6
    chip_depth_m: float = 14e-6

    def __post_init__(self) -> None:
        rates = (self.scratches_per_m, self.chips_per_m, self.dust_per_m)
        require(min(rates) >= 0, f"marks on a metre: {rates}", "zero or more of each kind")
        require(self.chip_depth_m > 0, f"chips {self.chip_depth_m} m deep", "a positive depth")
        longest_m = REACH_M / 1.5
        require(0 < self.chip_length_m <= longest_m, f"chips {self.chip_length_m} m long", f"up to {longest_m} m")

    def marks(
        self, arc_from_m: float, arc_to_m: float, *, groove_width_m: float, groove_middle_m: float, seed: int
    ) -> Iterator[Mark]:
        """Yield the marks that reach into a stretch of groove, in the order in which they were suffered.

        Parameters
        ----------
        arc_from_m, arc_to_m : float
            The stretch.
        groove_width_m, groove_middle_m : float
            Where the walls are: chips lie on them.
        seed : int
            Which record this is.
        """
        first, last = (int(np.floor(place / TILE_M)) for place in (arc_from_m - REACH_M, arc_to_m + REACH_M))
        for tile in range(first, last + 1):
            for mark in self._marks_of_tile(tile, groove_width_m, groove_middle_m, seed):
                reach_m = mark.reach_m[0]
                if arc_from_m - reach_m <= mark.centre_m[0] <= arc_to_m + reach_m:
                    yield mark

    def _marks_of_tile(self, tile: int, width_m: float, middle_m: float, seed: int) -> Iterator[Mark]:
        sequence = np.random.SeedSequence([seed, STREAM, FIRST_TILE + tile])
        # a stream for each kind: more dust must not move the chips
        chips, scratches, dust = (np.random.default_rng(child) for child in sequence.spawn(3))
        for _ in range(chips.poisson(self.chips_per_m * TILE_M)):
            yield self._chip(chips, tile, width_m, middle_m)
        for _ in range(scratches.poisson(self.scratches_per_m * TILE_M)):
            yield _scratch(scratches, tile, middle_m)
        for _ in range(dust.poisson(self.dust_per_m * TILE_M)):
            yield _dust(dust, tile, middle_m)

    def _chip(self, rng: np.random.Generator, tile: int, groove_width_m: float, middle_m: float) -> Chip:
        wall_m = groove_width_m / 2
        width_m = wall_m * rng.uniform(0.4, 0.8)
        from_middle_m = wall_m - width_m * rng.uniform(0.4, 0.6)
        return Chip(
            centre_m=((tile + rng.random()) * TILE_M, middle_m + from_middle_m * rng.choice((-1, 1))),
            length_m=self.chip_length_m * rng.uniform(0.4, 1.6),
            width_m=width_m,
            depth_m=self.chip_depth_m * rng.uniform(0.6, 1.4),
            tint=rng.uniform(0.6, 1.4),
            seed=int(rng.integers(2**31)),
        )


NO_DAMAGE = Damage()
LIGHT_DAMAGE = Damage(scratches_per_m=300, chips_per_m=40, dust_per_m=600, chip_length_m=100e-6)
HEAVY_DAMAGE = Damage(scratches_per_m=1200, chips_per_m=250, dust_per_m=2500, chip_length_m=180e-6)

DAMAGES = {"none": NO_DAMAGE, "light": LIGHT_DAMAGE, "heavy": HEAVY_DAMAGE}


def spoil_surface(
    height_m: Picture, albedo: Picture, marks: Iterator[Mark], *, arc_m: FloatArray, lateral_m: FloatArray
) -> None:
    """Lay marks on a surface that the caller owns, in place.

    Parameters
    ----------
    height_m, albedo : float32 arrays, shape (row, column)
    marks : iterable of Mark
    arc_m, lateral_m : float64 arrays, shape (column,) and (row,), evenly spaced and rising
    """
    for mark in marks:
        columns = _window(arc_m, mark.centre_m[0], mark.reach_m[0])
        rows = _window(lateral_m, mark.centre_m[1], mark.reach_m[1])
        if rows.stop > rows.start and columns.stop > columns.start:
            mark.spoil(height_m[rows, columns], albedo[rows, columns], arc_m[None, columns], lateral_m[rows, None])


def _window(places_m: FloatArray, centre_m: float, reach_m: float) -> slice:
    first, last = np.searchsorted(places_m, [centre_m - reach_m, centre_m + reach_m])
    return slice(int(first), int(last))


def _scratch(rng: np.random.Generator, tile: int, middle_m: float) -> Scratch:
    return Scratch(
        centre_m=((tile + rng.random()) * TILE_M, middle_m + rng.uniform(-ACROSS_M, ACROSS_M)),
        angle_rad=rng.uniform(0, np.pi),
        length_m=rng.uniform(50e-6, 500e-6),
        width_m=rng.uniform(1e-6, 4e-6),
        depth_m=rng.uniform(0.5e-6, 4e-6),
        gain=rng.uniform(-0.4, 0.8),
    )


def _dust(rng: np.random.Generator, tile: int, middle_m: float) -> Dust:
    fibre = rng.random() < 0.2
    return Dust(
        centre_m=((tile + rng.random()) * TILE_M, middle_m + rng.uniform(-ACROSS_M, ACROSS_M)),
        radius_m=rng.uniform(2e-6, 4e-6) if fibre else 3e-6 * float(np.exp(rng.exponential(0.6))),
        elongation=rng.uniform(6, 15) if fibre else rng.uniform(1, 1.8),
        angle_rad=rng.uniform(0, np.pi),
        tint=rng.uniform(0.15, 0.6),
    )


def _roughness(ahead_m: FloatArray, left_m: FloatArray, *, cell_m: float, seed: int) -> FloatArray:
    """Return a smooth random field of about unit size, fixed to the record, at the crossings of s and l."""
    rng = np.random.default_rng(seed)
    cells = int(np.ceil(REACH_M / cell_m)) + 2
    grid = rng.standard_normal((2 * cells, 2 * cells))
    rows, columns = np.broadcast_arrays(left_m / cell_m + cells, ahead_m / cell_m + cells)
    return np.asarray(map_coordinates(grid, np.stack([rows, columns]), order=3, mode="nearest"), np.float64)
