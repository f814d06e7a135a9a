"""In which tone a picture is read: its grey levels as they are, or their logarithms.

How the rows of a wall hang together is linear in the light: a blurred row is a sum of sharp ones. But where bright grains
lie on a dark ground a few of them say everything, truth and error alike, and the rest is not heard. The logarithm, of light
over its mean, hears them all, and pays with relations that are no longer quite linear. Which is better is for the passage to
say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.errors import require
from gramoscope.pickup.film_lanes import PIXELS, SERIES, write_in_tone
from gramoscope.pickup.picture_room import picture_room

LEAST_COMPRESSION = 0.01
"""Weaker ones would be lost in single precision."""


@dataclass(frozen=True)
class Tone:
    """A tone curve with slope 1 at the mean level.

    Parameters
    ----------
    level : float
        Mean grey level m of the passage, positive.
    compression : float
        q, 0 or 0.01 … below 1: grey x is seen as (m/q) log(1 + q (x/m − 1)). 0 leaves pictures as they are.
    """

    level: float = 1.0
    compression: float = 0.0

    def __post_init__(self) -> None:
        require(self.level > 0, f"a mean level of {self.level}", "a positive one")
        possible = self.compression == 0 or LEAST_COMPRESSION <= self.compression < 1
        require(possible, f"a compression of {self.compression}", f"0, or {LEAST_COMPRESSION} … below 1")

    def __call__(self, grey: Float32Array) -> Float32Array:
        """Return how grey levels are seen, float32 array of the same shape; levels below 0 count as 0."""
        if self.compression == 0:
            return grey
        seen = picture_room(len(grey), grey[:1].size).reshape(grey.shape)
        _compress(np.ascontiguousarray(grey).reshape(-1), self.level, self.compression, seen.reshape(-1))
        return seen


def _series() -> Float32Array:
    """Coefficients of log(1 + x)/x between √½ and √2, the lowest power first; good to 2e-7."""
    near = Chebyshev.interpolate(lambda x: np.log1p(x) / x, SERIES - 1, domain=[np.sqrt(0.5) - 1, np.sqrt(2) - 1])
    return near.convert(kind=Polynomial).coef.astype(np.float32)


_SERIES = _series()


@numba.njit(cache=True, nogil=True)
def _compress(grey, level, compression, seen):  # type: ignore[no-untyped-def]
    """Write how grey levels are seen."""
    curve = np.array([compression / level, 1 - compression, level / compression], np.float32)
    if grey.size >= PIXELS:
        write_in_tone(grey, grey.size, curve, _SERIES, seen)
        return
    few, some = np.zeros(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    few[: grey.size] = grey
    write_in_tone(few, PIXELS, curve, _SERIES, some)
    seen[:] = some[: grey.size]


def mean_level(pictures: list[Float32Array]) -> float:
    """Return the median of the pictures' mean grey levels, at least a hundredth of a level.

    Only the parts of a picture that were drawn count (`overlay`): the others are black.
    """
    means: FloatArray = np.array(
        [float(picture.sum()) / max(int(np.count_nonzero(picture)), 1) for picture in pictures]
    )
    return max(float(np.median(means)), 0.01)
