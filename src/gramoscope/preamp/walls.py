"""What there is to hear in the motion of a groove: the sound of the cut, and each wall for itself.

A 45/45 groove carries one channel in each wall, as the velocity of the wall along its normal; equal channels are a lateral
cut (`gramoscope.conventions`). A mono record has the same sound in both walls, with the dirt and wear of each: archives keep
the two apart, so that the better one can be chosen, or both added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import stereo_of_motion
from gramoscope.disc.formats import Direction
from gramoscope.errors import require
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio, GrooveSound

WALL_CHANNELS = ("outer", "inner")
"""The order of the channels; of a 45/45 groove the outer wall is the right one, the inner wall the left one."""


def in_direction(sound: GrooveSound, direction: Direction) -> Audio:
    """Return the sound of one direction of motion."""
    return sound.lateral if direction == "lateral" else sound.vertical


@dataclass(frozen=True)
class WallSplitter:
    """Tells the two walls of a groove apart.

    Parameters
    ----------
    direction : {"lateral", "vertical"}
        Of the cut, which is always known.
    walls_read : tuple of str
        Which walls the pickup reads: "outer", "inner" or both.
    """

    direction: Direction
    walls_read: tuple[str, ...] = WALL_CHANNELS

    def __post_init__(self) -> None:
        require(
            len(self.walls_read) > 0 and set(self.walls_read) <= set(WALL_CHANNELS),
            f"the walls {self.walls_read}",
            '"outer", "inner" or both',
        )

    def split(self, sound: GrooveSound) -> tuple[Audio, Audio]:
        """Return the velocity of the outer and the inner wall.

        Parameters
        ----------
        sound : GrooveSound

        Returns
        -------
        outer, inner : Audio
            (lateral + vertical)/√2 and (lateral − vertical)/√2. Where both walls are read and the direction across the
            cut is not known (its samples are 0 and `INTERPOLATED`), both are taken to move as the cut does, and carry that
            flag. Where one wall alone is read, the motion of the cut *is* that wall's, by the assumption that it was
            found with, and undone here without loss; the other wall is silent and `INTERPOLATED`, with NaN for sigma.
            `sigma` is that of independent errors of both directions, which errors of walls that are read equally well are.
        """
        outer, inner = (self._wall(sound, name) for name in WALL_CHANNELS)
        return outer, inner

    def _wall(self, sound: GrooveSound, name: str) -> Audio:
        cut = in_direction(sound, self.direction)
        left, right = stereo_of_motion(sound.lateral.samples, sound.vertical.samples)
        samples = right if name == "outer" else left
        history = (*cut.history, f"velocity of the {name} wall along its normal")
        if name not in self.walls_read:
            unseen = np.full(cut.flags.shape, np.uint16(Quality.INTERPOLATED), np.uint16)
            nothing = np.zeros(samples.shape)
            return replace(cut, samples=nothing, sigma=nothing * np.nan, flags=unseen, history=history)
        if len(self.walls_read) == 1:
            return replace(cut, samples=samples, sigma=cut.sigma / np.sqrt(2), history=history)
        sigma = np.hypot(sound.lateral.sigma, sound.vertical.sigma) / np.sqrt(2)
        flags = sound.lateral.flags | sound.vertical.flags
        return replace(cut, samples=samples, sigma=sigma, flags=flags, history=history)
