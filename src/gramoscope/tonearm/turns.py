"""Which groove of one picture is which groove of the next: by where their edges run in what both show.

The same serves for neighbouring pictures of a row and for the end of a whole turn, which shows what its start shows: there the
groove that ends as number k is the one that starts as number k + 1, because a spiral runs inwards by one groove a turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import FloatArray

NEAR_PX = 32
"""Where two pictures do not overlap, so many columns on each side tell where a groove is."""


@dataclass(frozen=True, eq=False)
class GrooveEnds:
    """The edges of all grooves of a picture in some of its columns.

    Attributes
    ----------
    first_px : int
        Column of the first of them, counted along the whole row of pictures.
    row_px : float64 array, shape (groove, 2, column)
        Rows of both walls, counted from one origin for all pictures; NaN where nothing was seen.
    """

    first_px: int
    row_px: FloatArray


def continued(before: GrooveEnds, after: GrooveEnds) -> tuple[int | None, ...]:
    """Return, for each groove of one picture, as which groove of the next it goes on.

    Parameters
    ----------
    before, after : GrooveEnds
        Where they overlap, both show the same stretch of each groove.

    Returns
    -------
    tuple of int or None
        None where it leaves the pictures. No groove is named twice: a pair is one where each is nearest to the other, and
        nearer than half the distance of neighbouring grooves.
    """
    distance = _distances(before, after)
    if distance.size == 0:
        return (None,) * len(before.row_px)
    limit = _spacing(before, after) / 2
    nearest = np.argmin(distance, axis=1)
    back = np.argmin(distance, axis=0)
    return tuple(
        int(there) if distance[here, there] < limit and back[there] == here else None
        for here, there in enumerate(nearest)
    )


def _distances(before: GrooveEnds, after: GrooveEnds) -> FloatArray:
    """Distance of each groove of one to each of the other, infinite where nothing can be compared."""
    offset = after.first_px - before.first_px
    shared = min(before.row_px.shape[2] - offset, after.row_px.shape[2]) if offset >= 0 else 0
    if shared > 0:
        left, right = before.row_px[:, :, offset : offset + shared], after.row_px[:, :, :shared]
    else:
        left, right = (
            _median(part)[:, :, None] for part in (before.row_px[:, :, -NEAR_PX:], after.row_px[:, :, :NEAR_PX])
        )
    apart = np.full((len(left), len(right)), np.inf)
    for here, there in np.ndindex(apart.shape):
        found = np.abs(left[here] - right[there])
        if np.isfinite(found).any():
            apart[here, there] = np.nanmedian(found)
    return apart


def _median(rows: FloatArray) -> FloatArray:
    """Median over the columns, NaN where there is none."""
    out = np.full(rows.shape[:2], np.nan)
    for place in np.ndindex(out.shape):
        known = rows[place][np.isfinite(rows[place])]
        if known.size:
            out[place] = np.median(known)
    return out


def _spacing(before: GrooveEnds, after: GrooveEnds) -> float:
    """Least distance of neighbouring grooves; the width of the groove where there is one alone."""
    medians = [_median(ends.row_px) for ends in (before, after)]
    steps = np.concatenate([np.diff(rows, axis=0).ravel() for rows in medians])
    widths = np.concatenate([np.abs(rows[:, 0] - rows[:, 1]) for rows in medians])
    known = steps[np.isfinite(steps) & (steps > 0)]
    if known.size:
        return float(np.median(known))
    known = widths[np.isfinite(widths)]
    return float(known.max()) if known.size else 0.0


def levels_of(row_px: FloatArray) -> FloatArray:
    """Return about which row each groove runs, the median over what is seen of its walls; NaN where nothing is.

    Parameters
    ----------
    row_px : float64 array, shape (groove, 2, column)
    """
    medians = _median(row_px)
    return np.array([np.mean(level[np.isfinite(level)]) if np.isfinite(level).any() else np.nan for level in medians])


def half_spacing(levels: FloatArray) -> float:
    """Return half the usual distance of neighbouring grooves; 0 where there are not two."""
    steps = np.diff(np.sort(levels[np.isfinite(levels)]))
    return float(np.median(steps)) / 2 if steps.size else 0.0


def nearest_level(level: float, levels: Mapping[int, float], limit: float) -> int | None:
    """Return which of some levels is nearest, if it is nearer than the limit."""
    known = {key: abs(one - level) for key, one in levels.items() if np.isfinite(one)}
    best = min(known, key=lambda key: known[key], default=None)
    return best if best is not None and known[best] < limit else None
