"""Frames that show nothing: black ones, blank ones and burnt-out ones."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup

Frame = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


EVERY_ROW = 17
"""Of so many rows one is looked at, which tells enough."""


@numba.njit(cache=True, nogil=True)
def _levels(frame, white_level):  # type: ignore[no-untyped-def]
    """Mean and standard deviation of the pixels, and the share of those at full scale."""
    total, square, full = 0.0, 0.0, 0
    for row in frame:
        row_total, row_square, row_full = np.int64(0), np.int64(0), 0
        for x in range(row.size):
            value = np.int64(row[x])
            row_total += value
            row_square += value * value
            row_full += value >= white_level
        total += row_total
        square += row_square
        full += row_full
    mean = total / frame.size
    return mean, np.sqrt(max(square / frame.size - mean * mean, 0.0)), full / frame.size


@dataclass(frozen=True)
class Exposure:
    """When a frame counts as dark or saturated. All three are guesses that suit a microscope's pictures.

    Parameters
    ----------
    least_mean, least_contrast : float
        Least mean and least standard deviation of the pixels, as shares of full scale: below either the frame is dark.
    saturated_share : float
        Share of pixels at full scale above which the texture is lost.
    """

    least_mean: float = 0.01
    least_contrast: float = 0.002
    saturated_share: float = 0.1

    def is_dark(self, frame: Frame, *, white_level: int) -> bool:
        """Tell whether a frame, shape (row, column), shows no light or no contrast."""
        mean, contrast, _ = _levels(frame, white_level)
        return self._dark(mean, contrast, white_level)

    def is_saturated(self, frame: Frame, *, white_level: int) -> bool:
        """Tell whether too much of a frame, shape (row, column), is at full scale."""
        return bool(_levels(frame, white_level)[2] > self.saturated_share)

    def _dark(self, mean: float, contrast: float, white_level: int) -> bool:
        return bool(mean < self.least_mean * white_level or contrast < self.least_contrast * white_level)

    def sort_out(self, group: FrameGroup) -> tuple[FrameGroup, Quality]:
        """Return the group without its useless frames, and why they are useless.

        Returns
        -------
        group : FrameGroup
            `valid` is False for the frames sorted out, `problems` has a line for each.
        flags : Quality
            `FRAME_LOST` for frames that could not be read, `DARK`, `SATURATED`; none when all frames are good.
        """
        valid = group.valid.copy()
        flags = Quality(0) if valid.all() else Quality.FRAME_LOST
        problems = list(group.problems)
        for k in np.flatnonzero(valid):
            flag, reason = self._fault(group.images[k, ::EVERY_ROW], group.white_level)
            if flag:
                valid[k] = False
                flags |= flag
                problems.append(f"group {group.number}, frame {k}: {reason}")
        return dataclasses.replace(group, valid=valid, problems=tuple(problems)), flags

    def _fault(self, frame: Frame, white_level: int) -> tuple[Quality, str]:
        mean, contrast, full = _levels(frame, white_level)
        if full > self.saturated_share:
            return Quality.SATURATED, f"too bright, more than {self.saturated_share:.0%} at full scale"
        if self._dark(mean, contrast, white_level):
            return Quality.DARK, "no light or no contrast"
        return Quality(0), ""
