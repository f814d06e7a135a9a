"""In which tone a picture is read: its grey levels as they are, or their logarithms.

How the rows of a wall hang together is linear in the light: a blurred row is a sum of sharp ones. But where bright grains
lie on a dark ground a few of them say everything, truth and error alike, and the rest is not heard. The logarithm, of light
over its mean, hears them all, and pays with relations that are no longer quite linear. Which is better is for the passage to
say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.errors import require

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
        # as a logarithm of 1 − q + q x/m it is four times as quick as one near 1
        seen = np.maximum(grey, np.float32(0))
        seen *= np.float32(self.compression / self.level)
        seen += np.float32(1 - self.compression)
        np.log(seen, out=seen)
        seen *= np.float32(self.level / self.compression)
        return seen


def mean_level(pictures: list[Float32Array]) -> float:
    """Return the median of the pictures' mean grey levels, at least a hundredth of a level."""
    means: FloatArray = np.array([float(np.mean(picture)) for picture in pictures])
    return max(float(np.median(means)), 0.01)
