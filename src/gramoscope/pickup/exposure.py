"""Frames that show nothing: black ones and burnt-out ones."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup


@dataclass(frozen=True)
class Exposure:
    """When a frame counts as dark or saturated.

    Parameters
    ----------
    least_contrast : float
        Least standard deviation of the pixels, as a share of full scale: below it the frame is dark (or blank).
    saturated_share : float
        Share of pixels at full scale above which the texture is lost.
    """

    least_contrast: float = 0.002
    saturated_share: float = 0.2

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
            pixels = group.images[k, ::3, ::3]
            share = float(np.count_nonzero(pixels >= group.white_level)) / pixels.size
            reason = None
            if share > self.saturated_share:
                reason, flag = f"saturated: {share:.0%} of its pixels at full scale", Quality.SATURATED
            elif float(pixels.std()) < self.least_contrast * group.white_level:
                reason, flag = f"dark or blank: mean {float(pixels.mean()):.1f} of {group.white_level}", Quality.DARK
            if reason is not None:
                valid[k] = False
                flags |= flag
                problems.append(f"group {group.number} frame {k} is {reason}")
        return dataclasses.replace(group, valid=valid, problems=tuple(problems)), flags
