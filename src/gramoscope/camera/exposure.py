"""Frames that show nothing: black ones, blank ones and burnt-out ones."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.camera.film_line import film_line
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup, ImageArray

Frame = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


EVERY_ROW = 33
"""Of so many rows one is looked at, which tells enough."""


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _sums(row, white_level):  # type: ignore[no-untyped-def]
    """Sum and sum of squares of the pixels of a row, and how many are at full scale."""
    total, square, full = np.float32(0), np.float32(0), np.uint32(0)
    for x in range(row.size):
        value = np.float32(row[x])
        total += value
        square += value * value
        full += np.uint32(value >= white_level)
    return total, square, full


@numba.njit(cache=True, nogil=True)
def _levels_along(film, step, shape, every, white_level):  # type: ignore[no-untyped-def]
    frames, height, width = shape
    levels = np.empty((frames, 3))
    for k in range(frames):
        total, square, full, pixels = 0.0, 0.0, 0, 0
        for y in range(0, height, every):
            first = k * step + y * width
            row_total, row_square, row_full = _sums(film[first : first + width], np.float32(white_level))
            total += row_total
            square += row_square
            full += row_full
            pixels += width
        mean = total / pixels
        levels[k] = mean, np.sqrt(max(square / pixels - mean * mean, 0.0)), full / pixels
    return levels


def _levels(frames: ImageArray, every: int, white_level: int) -> FloatArray:
    """Mean and standard deviation of the pixels of each frame, and the share of those at full scale, in some of its rows."""
    return np.asarray(_levels_along(*film_line(frames), frames.shape, every, white_level))


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
        mean, contrast, _ = _levels(frame[np.newaxis], 1, white_level).T
        return bool(self._dark(mean, contrast, white_level)[0])

    def is_saturated(self, frame: Frame, *, white_level: int) -> bool:
        """Tell whether too much of a frame, shape (row, column), is at full scale."""
        return bool(_levels(frame[np.newaxis], 1, white_level)[0, 2] > self.saturated_share)

    def sort_out(self, group: FrameGroup) -> tuple[FrameGroup, Quality]:
        """Return the group without its useless frames, and why they are useless.

        Returns
        -------
        group : FrameGroup
            `valid` is False for the frames sorted out, `problems` has a line for each.
        flags : Quality
            `FRAME_LOST` for frames that could not be read, `DARK`, `SATURATED`; none when all frames are good.
        """
        flags = Quality(0) if group.valid.all() else Quality.FRAME_LOST
        levels = _levels(group.images, EVERY_ROW, group.white_level)
        faulty = group.valid & self._faulty(levels, group.white_level)
        if not faulty.any():
            return group, flags
        valid, problems = group.valid.copy(), list(group.problems)
        for k in np.flatnonzero(faulty):
            flag, reason = self._fault(levels[k])
            valid[k] = False
            flags |= flag
            problems.append(f"group {group.number}, frame {k}: {reason}")
        return dataclasses.replace(group, valid=valid, problems=tuple(problems)), flags

    def _faulty(self, levels: FloatArray, white_level: int) -> BoolArray:
        mean, contrast, full = levels.T
        return np.asarray((full > self.saturated_share) | self._dark(mean, contrast, white_level))

    def _dark(self, mean: FloatArray, contrast: FloatArray, white_level: int) -> BoolArray:
        return np.asarray((mean < self.least_mean * white_level) | (contrast < self.least_contrast * white_level))

    def _fault(self, levels: FloatArray) -> tuple[Quality, str]:
        if levels[2] > self.saturated_share:
            return Quality.SATURATED, f"too bright, more than {self.saturated_share:.0%} at full scale"
        return Quality.DARK, "no light or no contrast"
