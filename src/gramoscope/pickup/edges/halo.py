"""The halo about burnt light: by how much specks, dust and writing brighten what lies beside them.

What shines more than the camera can hold is spread by the lens, and farther along one axis of the picture than along the
other where its pixels are not square. Straight out of what is burnt, grey levels go back to what lies farther off as

    I(d) = I(∞) + (burnt − I(∞)) exp(−d / L),

with the same L beside dark walls and on bright land (so it is on both practice micrographs, for shares from 0.6 down to
0.03; about large patches L is half as large again, and one L stands for all). L is told by the sum of the shares over whole
pixels, Σ exp(−d / L) = 1 / (exp(1 / L) − 1).

An edge beside a speck would be drawn towards the wall, which the halo brightens. So the halo is counted as an error of the
pixels (`column_places`), as large as it is on average: it is not taken off, for no two are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from gramoscope.conventions import BoolArray, FloatArray, Scalar
from gramoscope.signal_path import StillPicture

NEAR_PX, FAR_PX = 8, 12
"""Up to the first distance light goes back; from there to the second it is what lies farther off."""
FEWEST_RUNS = 100
"""Fewer ways out of what is burnt tell nothing of a halo."""
MOST_RUNS = 100_000
"""So many ways out are looked at, evenly spread."""
LEAST_SHARE = 0.01
"""A halo that adds less than this share is none."""


@dataclass(frozen=True)
class Halo:
    """How far what is burnt shines.

    Parameters
    ----------
    along_px, across_px : float
        L from column to column, and from row to row; 0 for no halo.
    """

    along_px: float = 0.0
    across_px: float = 0.0

    def share(self, burnt: BoolArray) -> FloatArray:
        """Return the share of the way to the burnt level by which each pixel is brightened.

        Parameters
        ----------
        burnt : bool array, shape (column, row)

        Returns
        -------
        float64 array, shape (column, row)
            exp(−D), with D the distance to the nearest burnt pixel, along each axis in units of its own L.
        """
        if min(self.along_px, self.across_px) <= 0 or not burnt.any():
            return np.zeros(burnt.shape)
        distance = distance_transform_edt(~burnt, sampling=(1 / self.along_px, 1 / self.across_px))
        share = np.exp(-np.asarray(distance, np.float64))
        return np.where(share > LEAST_SHARE, share, 0.0)


NO_HALO = Halo()


def learn_halo(picture: StillPicture, burnt: int) -> Halo:
    """Return how far what is burnt shines in a picture; `NO_HALO` where too little is burnt to tell.

    Parameters
    ----------
    picture : StillPicture
    burnt : int
        From this pixel value on a pixel is burnt.
    """
    along_px, across_px = (
        _length_px(np.concatenate([_runs(image[::way], seen[::way], burnt) for way in (1, -1)], axis=1), burnt)
        for image, seen in ((picture.image.T, picture.seen.T), (picture.image, picture.seen))
    )
    return Halo(along_px, across_px) if min(along_px, across_px) > 0 else NO_HALO


def _runs(image: npt.NDArray[Scalar], seen: BoolArray, burnt: int) -> FloatArray:
    """Grey levels 1 … `FAR_PX` rows after what is burnt, where nothing else is burnt on the way, shape (distance, run)."""
    if image.shape[0] <= FAR_PX:
        return np.zeros((FAR_PX, 0))
    scorched = np.greater_equal(image, burnt)
    row, column = np.nonzero(scorched[:-FAR_PX] & ~scorched[1 : 1 - FAR_PX])
    some = slice(None, None, max(1, row.size // MOST_RUNS))
    after = row[some] + np.arange(1, FAR_PX + 1)[:, None]
    level = image[after, column[some]].astype(np.float64)
    clear = ((level < burnt) & seen[after, column[some]]).all(axis=0)
    return np.asarray(level[:, clear])


def _length_px(runs: FloatArray, burnt: int) -> float:
    """L of runs of grey levels, shape (distance, run); 0 where they tell of none."""
    if runs.shape[1] < FEWEST_RUNS:
        return 0.0
    farther = runs[NEAR_PX:].mean(axis=0)
    total = float((runs[:NEAR_PX] - farther).sum() / (burnt - farther).sum())
    return float(1 / np.log1p(1 / total)) if total > LEAST_SHARE else 0.0
