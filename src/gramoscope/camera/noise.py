"""Photon and read noise of a sensor, and its quantisation: light in, numbers out.

A pixel that on average catches λ photo-electrons catches a Poisson number of them; the amplifier adds Gaussian noise. The
Poisson number is drawn through its Cornish–Fisher expansion to second order,

    n ≈ λ + √λ g + (g² − 1)/6,       g standard normal,

which has Poisson's mean and skewness; its variance is λ + 1/18, within 1 % for λ ≥ 6. Below that the counts are no longer
whole numbers as they ought to be, which no camera with read noise could tell.

Every pixel's deviates come from a hash of seed and pixel number (SplitMix64), so that a frame is the same whoever renders
it, and in whatever order. A hash gives four 16-bit numbers, each looked up among the 65 536 equally likely values of a
standard normal distribution (which ends at ± 4.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from gramoscope.errors import require
from gramoscope.signal_path import ImageArray

Deviates = npt.NDArray[np.float32]


def _equally_likely() -> Deviates:
    """Return the middles of 65 536 equally likely parts of a standard normal distribution, rescaled to unit variance."""
    middles = ndtri((np.arange(65536) + 0.5) / 65536)
    return np.asarray(middles / middles.std(), np.float32)


NORMAL = _equally_likely()


@dataclass(frozen=True)
class SensorNoise:
    """How noisy a camera is.

    Parameters
    ----------
    full_well_electrons : float
        Photo-electrons at full scale, positive: the fewer, the noisier.
    read_electrons : float
        Read noise, one standard deviation; zero or more.
    """

    full_well_electrons: float = 5000.0
    read_electrons: float = 22.0

    def __post_init__(self) -> None:
        require(
            self.full_well_electrons > 0, f"a full well of {self.full_well_electrons} electrons", "a positive number"
        )
        require(self.read_electrons >= 0, f"a read noise of {self.read_electrons} electrons", "zero or more")

    def expose(self, light: Deviates, *, white_level: int, seed: int) -> ImageArray:
        """Return the picture that a camera takes.

        Parameters
        ----------
        light : float32 array, shape (row, column)
            Share of full scale, 0 … 1; more is clipped, NaN gives black.
        white_level : int
            Pixel value of full scale.
        seed : int
            Of this frame, 0 … 2**64 − 1.

        Returns
        -------
        uint8 or uint16 array, same shape
        """
        picture = np.empty(light.shape, np.uint8 if white_level < 256 else np.uint16)
        _expose(
            np.ascontiguousarray(light, np.float32),
            np.float32(self.full_well_electrons),
            np.float32(self.read_electrons),
            np.float32(white_level),
            np.uint64(seed),
            NORMAL,
            picture,
        )
        return picture


@numba.njit(cache=True, nogil=True)
def hashed(seed: np.uint64, number: np.uint64) -> np.uint64:
    """Return 64 well-mixed bits of a seed and a number (G. Steele et al., SplitMix64, OOPSLA 2014)."""
    z = seed + (number + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@numba.njit(cache=True, nogil=True)
def _expose(
    light: Deviates,
    full_well: np.float32,
    read: np.float32,
    white: np.float32,
    seed: np.uint64,
    normal: Deviates,
    picture: ImageArray,
) -> None:
    rows, columns = light.shape
    for row in range(rows):
        first = np.uint64(row) * np.uint64(columns)
        _expose_row(light[row], full_well, read, white, seed, first, normal, picture[row])


@numba.njit(cache=True, nogil=True)
def _expose_row(
    light: Deviates,
    full_well: np.float32,
    read: np.float32,
    white: np.float32,
    seed: np.uint64,
    first: np.uint64,
    normal: Deviates,
    out: npt.NDArray[np.uint8],
) -> None:
    mask = np.uint64(0xFFFF)
    scale = white / full_well
    for column in range(len(light)):
        bits = hashed(seed, first + np.uint64(column))
        photon = normal[bits & mask]
        amplifier = normal[(bits >> np.uint64(16)) & mask]
        expected = max(light[column] * full_well, np.float32(0))
        caught = expected + np.sqrt(expected) * photon + (photon * photon - np.float32(1)) * np.float32(1 / 6)
        value = (max(caught, np.float32(0)) + read * amplifier) * scale + np.float32(0.5)
        # written so that NaN gives black
        out[column] = np.uint16(min(value, white)) if value > 0 else np.uint16(0)
