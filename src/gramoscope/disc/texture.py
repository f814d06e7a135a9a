"""The texture of the surface: what the microscope sees of the material, apart from light and shade.

A stationary random field over place s and arc length u of the section, fixed to the material. White noise, made tile by
tile from a hashed seed so that any stretch can be rendered in any order and is always the same record, is smoothed to the
size of the grains by a Gaussian and passed through an exponential that turns it into bright grains on a darker ground,

    albedo = 1 + c (exp(κg − κ²/2) − 1) / √(exp κ² − 1),        g standard normal,

which has mean 1 and standard deviation c. Across the groove the field repeats every `ACROSS` texels (0.4 mm at 0.39 µm),
further than walls and bottom reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require

ACROSS = 1024
"""Texels across the groove before the field repeats; a power of two, so that wrapping is cheap."""
TILE = 128
"""Texels along the groove that share a seed."""
FIRST_TILE = 1 << 30
"""Tiles are numbered from here, because seeds cannot be negative and places can."""
STREAM = 0x7E87

TAPS = 8
"""Texels that take part in looking up a place between them."""
PHASES = 256
"""Places that are told apart between two texels; 1.5 nm at 0.39 µm."""

Field = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Texture:
    """How a surface is grained.

    Parameters
    ----------
    grain_m : float
        Diameter of a grain (full width at half maximum), positive.
    contrast : float
        Standard deviation of the albedo, relative to its mean, before the microscope blurs it; 0 or more.
    skewness : float
        κ of the exponential, positive: small for a soft Gaussian field, about 1 for bright grains on a dark ground.
    """

    grain_m: float
    contrast: float
    skewness: float = 0.8

    def __post_init__(self) -> None:
        require(self.grain_m > 0, f"grains of {self.grain_m} m", "a positive size")
        require(self.contrast >= 0, f"a contrast of {self.contrast}", "zero or more")
        require(self.skewness > 0, f"a skewness of {self.skewness}", "a positive number")

    def field(self, first_column: int, columns: int, *, pitch_m: float, seed: int) -> Field:
        """Return the albedo of a stretch.

        Parameters
        ----------
        first_column : int
            Place of the first texel along the groove, in pitches from s = 0; may be negative.
        columns : int
            How many.
        pitch_m : float
            From texel to texel, both ways.
        seed : int
            Which record this is.

        Returns
        -------
        float32 array, shape (`ACROSS`, columns)
            Mean 1; arc length u = 0 lies at row `ACROSS` / 2, and the rows wrap around.
        """
        taps = _gaussian_taps(self.grain_m / pitch_m)
        reach = len(taps) // 2
        noise = _white(first_column - reach, columns + 2 * reach, seed=seed)
        return _grained(noise, taps, np.float32(self.skewness), np.float32(self.contrast))


POWDER = Texture(grain_m=1.2e-6, contrast=0.55, skewness=0.8)
"""Aluminium powder of about a micrometre (paper, section 1): strong contrast. Strength and skewness are chosen by eye."""
SHELLAC = Texture(grain_m=0.8e-6, contrast=0.22, skewness=0.5)
"""The mineral filler of natural shellac: finer and weaker. A guess."""
POLISHED = Texture(grain_m=1.2e-6, contrast=0.05, skewness=0.3)
"""A wall that has hardly any texture left. A guess."""

TEXTURES = {"powder": POWDER, "shellac": SHELLAC, "polished": POLISHED}


def _gaussian_taps(width_px: float) -> Field:
    """Return a Gaussian of that full width at half maximum, with unit sum of squares so that noise stays of unit size."""
    sigma = width_px / np.sqrt(8 * np.log(2))
    reach = max(1, int(np.ceil(3.5 * sigma)))
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(taps / np.sqrt(np.sum(taps**2)), np.float32)


def _white(first_column: int, columns: int, *, seed: int) -> Field:
    first_tile, last_tile = first_column // TILE, (first_column + columns - 1) // TILE
    tiles = [_white_tile(tile, seed=seed) for tile in range(first_tile, last_tile + 1)]
    start = first_column - first_tile * TILE
    return np.ascontiguousarray(np.concatenate(tiles, axis=1)[:, start : start + columns])


def _white_tile(tile: int, *, seed: int) -> Field:
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, STREAM, FIRST_TILE + tile])))
    return rng.standard_normal((ACROSS, TILE), dtype=np.float32)


@numba.njit(cache=True, nogil=True)
def _grained(noise: Field, taps: Field, skewness: np.float32, contrast: np.float32) -> Field:
    rows, wide = noise.shape
    columns = wide - len(taps) + 1
    along = np.empty((rows, columns), np.float32)
    for row in range(rows):
        _smooth_along(noise[row], taps, along[row])
    albedo = np.zeros((rows, columns), np.float32)
    for row in range(rows):
        for tap in range(len(taps)):
            _add_row(along[(row + tap - len(taps) // 2) % rows], taps[tap], albedo[row])
        _brighten(albedo[row], skewness, contrast)
    return albedo


@numba.njit(cache=True, nogil=True, fastmath=True)
def _smooth_along(noise: Field, taps: Field, out: Field) -> None:
    out[:] = np.float32(0)
    for tap in range(len(taps)):
        _add_row(noise[tap : tap + len(out)], taps[tap], out)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _add_row(row: Field, weight: np.float32, out: Field) -> None:
    for i in range(len(out)):
        out[i] += weight * row[i]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _brighten(row: Field, skewness: np.float32, contrast: np.float32) -> None:
    square = skewness * skewness
    scale = contrast / np.float32(np.sqrt(np.exp(square) - 1))
    for i in range(len(row)):
        row[i] = max(np.float32(0), 1 + scale * (np.exp(skewness * row[i] - square / 2) - 1))


def sample_across(field: Field, along_m: FloatArray, *, pitch_m: float) -> Field:
    """Return the albedo at arc lengths u, one a column (the reference of the renderer's own look-up).

    Parameters
    ----------
    field : float32 array, shape (`ACROSS`, column)
    along_m : float64 array, shape (column,)

    Returns
    -------
    float32 array, shape (column,)
        By the weights of `texel_weights`.
    """
    phase = np.floor(along_m / pitch_m * PHASES + 0.5).astype(np.int64)
    first = phase // PHASES + ACROSS // 2 - (TAPS // 2 - 1)
    texels = field[(first + np.arange(TAPS)[:, None]) % ACROSS, np.arange(field.shape[1])]
    return np.asarray(np.sum(texel_weights()[phase % PHASES].T * texels, axis=0), np.float32)


def texel_weights() -> Field:
    """Return how much each of `TAPS` texels counts at each of `PHASES` places between the middle two.

    A sinc under a Kaiser window (β = 5), scaled to sum 1: waves of up to 0.3 cycles a texel come out within 0.5 %, and their
    false images beyond 0.7 stay below that. A cubic through four texels
    loses a tenth at 0.3 and lets a tenth through at 0.7.

    Returns
    -------
    float32 array, shape (`PHASES`, `TAPS`)
    """
    away = np.arange(TAPS) - (TAPS // 2 - 1) - np.arange(PHASES)[:, None] / PHASES
    weights = np.sinc(away) * np.i0(5.0 * np.sqrt(np.maximum(0, 1 - (away / (TAPS / 2)) ** 2)))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), np.float32)
