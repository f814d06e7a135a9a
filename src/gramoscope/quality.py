"""One bit for each way in which a sample can be bad.

Flags travel with the samples from the pickup to the report. A sample without flags is a measurement; `INTERPOLATED` means
that nobody saw the groove there and the value comes from its surroundings, `DECLICKED` that somebody chose to do without what
was seen. Several bits can stand together, as cause and consequence: ``NO_STRIPE | INTERPOLATED``.
"""

from __future__ import annotations

from enum import IntFlag

import numpy as np
import numpy.typing as npt

FlagArray = npt.NDArray[np.uint16]


class Quality(IntFlag):
    """The flags of a sample; `describe` has their long meanings."""

    INTERPOLATED = 1
    FRAME_LOST = 2
    DARK = 4
    SATURATED = 8
    NO_STRIPE = 16
    SPARSE = 32
    OUTLIER = 64
    NO_OVERLAP = 128
    EDGE = 256
    DECLICKED = 512
    DECRACKLED = 1024
    SILENCE = 2048


_MEANINGS: dict[Quality, str] = {
    Quality.INTERPOLATED: "no measurement here: the value was filled in from its surroundings",
    Quality.FRAME_LOST: "frames of this stretch are missing, truncated or of the wrong size",
    Quality.DARK: "the frames show no light or no contrast",
    Quality.SATURATED: "so many pixels are at full scale that the texture is lost",
    Quality.NO_STRIPE: "the sharp stripes that belong here were not found",
    Quality.SPARSE: "too few in-focus points in the neighbourhood for an orientation of its own",
    Quality.OUTLIER: "the measurement disagreed with its surroundings and was given no weight",
    Quality.NO_OVERLAP: "this stretch could not be matched to its neighbour: its place is the encoder's",
    Quality.EDGE: "at the very start or end of the passage, where only one side supports the value",
    Quality.DECLICKED: "repaired: a click stood here, and the value is what its surroundings predict",
    Quality.DECRACKLED: "repaired: crackle was taken off the measurement here",
    Quality.SILENCE: "between two passages: no groove is shown, and the sound is silent",
}

NOT_MEASURED = Quality.INTERPOLATED | Quality.DECLICKED
REPAIRS = Quality.DECLICKED | Quality.DECRACKLED
"""Flags that a repair sets; a reading, and `flat.wav`, never has them."""


def describe(flag: Quality) -> str:
    """Return the long meaning of one flag.

    Parameters
    ----------
    flag : Quality
        A single bit.

    Returns
    -------
    str
        A sentence for a report.

    Raises
    ------
    KeyError
        If `flag` is none or a combination of bits.
    """
    return _MEANINGS[flag]


def no_flags(*shape: int) -> FlagArray:
    """Return an array of unflagged samples."""
    return np.zeros(shape, np.uint16)


def count(flags: FlagArray) -> dict[str, int]:
    """Count the samples that carry each flag.

    Parameters
    ----------
    flags : uint16 array, any shape

    Returns
    -------
    dict
        Lower-case flag name → number of samples, for every flag, zeros included.
    """
    there = int(np.bitwise_or.reduce(flags, axis=None))
    return {
        str(flag.name).lower(): int(np.count_nonzero(flags & np.uint16(flag))) if there & flag else 0
        for flag in Quality
    }


def interpolated_share(flags: FlagArray) -> float:
    """Return the share of samples (0 … 1) that nobody measured; NaN when there are none."""
    if flags.size == 0:
        return float("nan")
    return float(np.count_nonzero(flags & np.uint16(NOT_MEASURED)) / flags.size)
