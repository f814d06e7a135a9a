"""How a sample is stored in a sound file: as a whole number of 16, 24 or 32 bits, or as a 32-bit float.

Whole numbers of b bits count steps of 2^(1−b); samples are rounded to the nearest. Rounding is an error of uniform
density, one step wide, as long as the sound's own noise is a step or more; where it is not (16 bits under a quiet sound),
the error follows the sound, unless dither is added before rounding: a sum of two numbers that are uniform between −½ and ½
(triangular density), which makes the mean and the power of the error independent of the sound.

References
----------
S. P. Lipshitz, R. A. Wannamaker, J. Vanderkooy, Quantization and dither: a theoretical survey, J. Audio Eng. Soc. 40 (1992).
"""

from __future__ import annotations

from enum import Enum

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray


class SampleFormat(Enum):
    """The ways to store a sample, little-endian: kind and bits."""

    PCM_16 = ("whole", 16)
    PCM_24 = ("whole", 24)
    PCM_32 = ("whole", 32)
    FLOAT_32 = ("float", 32)

    @property
    def bits(self) -> int:
        """Bits of one sample."""
        return self.value[1]

    @property
    def is_float(self) -> bool:
        """Whether samples are floats, which clip nothing and are not dithered."""
        return self is SampleFormat.FLOAT_32


def rounded(samples: FloatArray, *, bits: int, dither: np.random.Generator | None = None) -> npt.NDArray[np.int32]:
    """Round samples to whole steps.

    Parameters
    ----------
    samples : float64 array, shape (sample, channel)
        Full scale is ±1; finite.
    bits : int
        16, 24 or 32.
    dither : Generator, optional
        Adds dither of triangular density, ±1 step; two numbers are drawn for each sample, in order.

    Returns
    -------
    int32 array, same shape
        −2^(bits−1) … 2^(bits−1) − 1; what lies beyond is held there.
    """
    full = 2.0 ** (bits - 1)
    steps = samples * full
    if dither is not None:
        steps = steps + (dither.random((*samples.shape, 2)) - 0.5).sum(axis=-1)
    return np.clip(np.rint(steps), -full, full - 1).astype(np.int32)


def packed(steps: npt.NDArray[np.int32], *, bits: int) -> bytes:
    """Return whole samples as they stand in a file, channel by channel of each sample, little-endian."""
    wide = np.ascontiguousarray(steps, "<i4")
    return wide.view(np.uint8).reshape(-1, 4)[:, : bits // 8].tobytes()
