"""Frames that show nothing: black ones, blank ones and burnt-out ones."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup

Frame = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


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
        mean, contrast = float(frame.mean()), float(frame.std(dtype=np.float32))
        return mean < self.least_mean * white_level or contrast < self.least_contrast * white_level

    def is_saturated(self, frame: Frame, *, white_level: int) -> bool:
        """Tell whether too much of a frame, shape (row, column), is at full scale."""
        return bool(np.count_nonzero(frame >= white_level) > self.saturated_share * frame.size)

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
            # every third pixel either way tells enough
            flag, reason = self._fault(group.images[k, ::3, ::3], group.white_level)
            if flag:
                valid[k] = False
                flags |= flag
                problems.append(f"group {group.number}, frame {k}: {reason}")
        return dataclasses.replace(group, valid=valid, problems=tuple(problems)), flags

    def _fault(self, frame: Frame, white_level: int) -> tuple[Quality, str]:
        if self.is_saturated(frame, white_level=white_level):
            return Quality.SATURATED, f"too bright, more than {self.saturated_share:.0%} at full scale"
        if self.is_dark(frame, white_level=white_level):
            return Quality.DARK, "no light or no contrast"
        return Quality(0), ""
