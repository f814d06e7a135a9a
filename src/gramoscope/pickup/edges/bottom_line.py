"""The line along the bottom of a groove, where one is seen: bright or dark, thin or broad.

Both walls meet half way between the edges if they are equally steep, wherever the groove winds. So along the middle between
the edges the picture is averaged, in stretches; a line is seen where the mean of the stretches differs from what lies about
it by many times their own scatter. Then it is followed like an edge that is a lone line (`sharpening`).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.edges.edge_band import EdgeBand, edge_band
from gramoscope.pickup.edges.sharpening import Reach, Sharpening
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import StillPicture

SEARCHED = 0.25
"""Share of the width of the groove, on each side of its middle, in which the line is looked for."""
LEAST_REACH_PX = 4
STRETCHES = 16
LEAST_PIXELS = 0.3
"""A mean over a smaller share of the pixels of a stretch is not believed."""
LEAST_SIGNIFICANCE = 8.0
"""Of the line in the mean over all stretches, in standard errors."""
SMOOTH_PX = 1.0
MOST_SIGMA_SHARE = 0.25
"""A line whose place is known no better than this share of the rows that are looked at is not seen."""
Line = tuple[FloatArray, FloatArray]


def bottom_line(
    picture: StillPicture, row_px: FloatArray, *, sharpening: Sharpening, half_px: int, burnt: int, least_seen: float
) -> Line:
    """Return the rows of the line along the bottom and their standard errors, NaN where it is not seen.

    Parameters
    ----------
    picture : StillPicture
    row_px : float64 array, shape (2, column)
        Of both edges; NaN where there is none.
    sharpening : Sharpening
        How places are found to a fraction of a pixel.
    half_px : int
        So many rows on each side of the line are looked at, at most.
    burnt : int
        From this pixel value on a pixel is burnt.
    least_seen : float
        A line of which less than this share of the columns was measured is not seen.
    """
    columns = row_px.shape[1]
    nothing = np.full(columns, np.nan), np.full(columns, np.nan)
    if not np.isfinite(row_px).all():
        return nothing
    middle = 0.5 * (row_px[INNER] + row_px[OUTER])
    reach = int(SEARCHED * float(np.median(row_px[INNER] - row_px[OUTER])))
    if reach < LEAST_REACH_PX:
        return nothing
    aside = line_aside_px(edge_band(picture, middle, wall=INNER, half_px=reach, burnt=burnt))
    if aside is None:
        return nothing
    half_px = min(half_px, reach)
    found = sharpening.sharpen(picture, middle + aside, wall=INNER, reach=Reach(half_px), burnt=burnt, line=True)
    if found is None:
        return nothing
    seen = (found.flags & np.uint16(NOT_MEASURED)) == 0
    if np.mean(seen) < least_seen or np.median(found.row_sigma_px[seen]) > MOST_SIGMA_SHARE * half_px:
        return nothing
    return np.where(seen, found.row_px, np.nan), np.where(seen, found.row_sigma_px, np.nan)


def line_aside_px(band: EdgeBand) -> float | None:
    """Return how many rows aside of the course a line runs in a band, towards larger rows; None where none is seen."""
    places = band.level.shape[1]
    means = []
    for stretch in np.array_split(np.arange(band.level.shape[0]), STRETCHES):
        usable = band.usable[stretch]
        count = usable.sum(axis=0)
        if stretch.size and count.min() > LEAST_PIXELS * stretch.size:
            mean = (band.level[stretch] * usable).sum(axis=0) / count
            means.append(mean / max(float(mean.mean()), 1e-9))
    if len(means) < STRETCHES // 2:
        return None
    place = np.linspace(-1, 1, places)
    smooth = gaussian_filter1d(np.array(means), SMOOTH_PX, axis=1, mode="nearest")
    # walls that get brighter towards the land, or to one side, are no line
    bowl = np.polynomial.polynomial.polyfit(place, smooth.T, 2)
    rest = smooth - np.polynomial.polynomial.polyval(place, bowl)
    error = rest.std(axis=0, ddof=1) / np.sqrt(len(means))
    found = rest.mean(axis=0)
    height = np.abs(found - np.median(found)) / np.maximum(error, 1e-9)
    # at the borders a parabola leaves what it cannot follow
    inner = slice(places // 6, places - places // 6)
    best = places // 6 + int(np.argmax(np.abs(found - np.median(found))[inner]))
    return float(best - (places - 1) / 2) if height[best] > LEAST_SIGNIFICANCE else None
