"""What is believed of the paths that the coarse search found for both walls, before they are read.

A groove that is cut laterally or vertically moves both walls alike; what they do against each other is warp, focus or a hole
off the centre, and changes little along a stretch. So where the two paths part at once, one of them has left its wall for
something beside it that is as sharp, as the floor of a fracture may be; and what else their distance does is jitter.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from gramoscope.conventions import INNER, OUTER, BoolArray, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.pickup.texture.smoothing import smoothed

MOST_PARTED_PX = 7.0
"""Further than this from their usual distance, in rows, walls are not: one of the paths has gone astray."""
LEAST_PARTED_COLUMNS = 24
"""Over fewer columns paths only jitter; and so far on either side of where they part they are not believed."""
LEAST_JUDGED_COLUMNS = 100
"""With both walls in sight, below which nobody can tell what distance is usual."""


def sign_of(cut: Cut) -> FloatArray:
    """Return how the walls move when the groove moves in the direction of its cut, lateral or vertical; shape (2,)."""
    return np.array([1.0, 1.0] if cut == "lateral" else [-1.0, 1.0])


def astray(displacement_px: FloatArray, support: FloatArray, cut: Cut, *, least_support: float) -> BoolArray:
    """Tell where the path of a wall follows something else.

    Where the walls are further from their usual distance (the median over the stretch) than they can be, the one with
    less support, in the mean of such a part, has left its wall.

    Parameters
    ----------
    displacement_px, support : float64 arrays, shape (2, column)
        From the coarse search: where each wall was found, and how sharp.
    cut : {"lateral", "vertical", "stereo"}
        A stereo cut moves each wall by itself, and nothing can be told.
    least_support : float
        Walls with no more than this are out of sight, and do not judge.

    Returns
    -------
    bool array, shape (2, column)
    """
    lost = np.zeros(displacement_px.shape, np.bool_)
    seen = (support > least_support).all(axis=0)
    if cut == "stereo" or seen.sum() < LEAST_JUDGED_COLUMNS:
        return lost
    inner, outer = sign_of(cut)[:, np.newaxis] * displacement_px
    parted = seen & (np.abs(outer - inner - np.median((outer - inner)[seen])) > MOST_PARTED_PX)
    for (part,) in ndimage.find_objects(ndimage.label(parted)[0]):
        if part.stop - part.start >= LEAST_PARTED_COLUMNS:
            weaker = int(np.argmin(support[:, part].mean(axis=1)))
            lost[weaker, max(part.start - LEAST_PARTED_COLUMNS, 0) : part.stop + LEAST_PARTED_COLUMNS] = True
    return lost


def settled(displacement_px: FloatArray, support: FloatArray, cut: Cut, *, smooth_px: float) -> FloatArray:
    """Return coarse paths without the jitter of single walls: the difference that the cut does not use is smoothed.

    Parameters
    ----------
    displacement_px, support : float64 arrays, shape (2, column)
        From the coarse search, and how sharp each wall was found; the wall with the better support counts for more, and
        one without any goes along with the other.
    cut : {"lateral", "vertical", "stereo"}
        Walls of a stereo cut are left alone.
    smooth_px : float
        Standard deviation of the smoothing of that difference.
    """
    if cut == "stereo":
        return displacement_px
    sign = sign_of(cut)[:, np.newaxis]
    signed = sign * displacement_px
    weight = support**2 + 1e-4
    inner, outer = weight
    both = inner * outer / (inner + outer)
    apart = smoothed(both * (signed[OUTER] - signed[INNER]) / 2, smooth_px)
    apart = apart / smoothed(both, smooth_px)
    middle = (weight * (signed + np.array([[1.0], [-1.0]]) * apart)).sum(axis=0) / weight.sum(axis=0)
    return np.asarray(sign * (middle + np.array([[-1.0], [1.0]]) * apart))
