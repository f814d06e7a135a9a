"""From the planes of one wall to samples with honest errors and flags.

A plane's standard error assumes that columns err independently; neighbouring centroids share texture grains, so it is
widened by the square root of the correlation length of the residuals; and since a few points can lie on a line by chance,
no scatter is believed that is smaller than the median of the stretch. Where too few columns were measured for an
orientation, the slope of the Hough line stands in, flagged, with an error as large as the music.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.pickup.wall import Planes, correlation_length_px
from gramoscope.quality import FlagArray, Quality, no_flags

UNSEEN_SLOPE_SIGMA = 0.05
"""Least standard error given to the slope of a Hough line where no orientation could be measured; 0.05 is 4.7 cm/s at
78 rpm and 115 mm, of the order of the music itself. A steep line is more likely to be a false one, so its slope is added in
quadrature: it then weighs next to nothing. A guess."""


@dataclass(frozen=True, eq=False)
class WallSamples:
    """One wall of one stretch at its stations.

    Attributes
    ----------
    row_px, row_sigma_px : float64 arrays, shape (station,)
        Row of the wall (the mean over its stripes at their expected distances), and its standard error.
    slope, slope_sigma : float64 arrays, shape (station,)
    flags : uint16 array, shape (station,)
    wall_angle_rad : float
        Angle of the wall against the land, NaN when it shows one stripe only.
    """

    row_px: FloatArray
    row_sigma_px: FloatArray
    slope: FloatArray
    slope_sigma: FloatArray
    flags: FlagArray
    wall_angle_rad: float = float("nan")


def residuals(planes: Planes, rows: FloatArray, measured: npt.NDArray[np.bool_], stations: FloatArray) -> FloatArray:
    """Return centroids minus the plane of the nearest station, shape (line, column); NaN where not measured."""
    columns = np.arange(rows.shape[1])
    nearest = np.abs(columns[:, None] - stations[None, :]).argmin(axis=1)
    plane = planes.row[:, nearest] + planes.slope[nearest] * (columns - stations[nearest])
    residual = rows - plane
    inlier = np.abs(residual) < 4 * planes.scatter_px[nearest]
    return np.asarray(np.where(measured & inlier, residual, np.nan))


def samples_of_wall(
    planes: Planes,
    rows: FloatArray,
    measured: npt.NDArray[np.bool_],
    stations: FloatArray,
    *,
    line_slope: FloatArray,
    expected_row: FloatArray,
) -> WallSamples:
    """Return the samples of one wall.

    Parameters
    ----------
    planes : Planes
    rows, measured : arrays, shape (line, column)
        The centroid lines that the planes were fitted to.
    stations : float64 array, shape (station,)
    line_slope : float64 array, shape (station,)
        Slope of the Hough lines, NaN where there is none.
    expected_row : float64 array, shape (line,)
        Where the bench expects the stripes; only their distances matter.

    Returns
    -------
    WallSamples
        NaN and ``NO_STRIPE | INTERPOLATED`` where neither plane nor Hough line is known; the Hough line's slope and
        ``SPARSE | INTERPOLATED`` where only that is.
    """
    seen = np.isfinite(planes.slope)
    correlation = correlation_length_px(residuals(planes, rows, measured, stations))
    slope = np.where(seen, planes.slope, line_slope)
    lucky = np.maximum(np.nanmedian(planes.scatter_px) / planes.scatter_px, 1.0) if seen.any() else 1.0
    sigma = np.where(seen, planes.slope_sigma * lucky * np.sqrt(correlation), np.hypot(UNSEEN_SLOPE_SIGMA, slope))
    flags = no_flags(stations.size)
    flags[~seen] |= np.uint16(Quality.SPARSE | Quality.INTERPOLATED)
    nothing = ~np.isfinite(slope)
    flags[nothing] = np.uint16(Quality.NO_STRIPE | Quality.INTERPOLATED)
    aligned = planes.row - (expected_row - expected_row.mean())[:, None]
    known = np.isfinite(aligned)
    with np.errstate(invalid="ignore", divide="ignore"):
        row = np.where(known, aligned, 0.0).sum(axis=0) / known.sum(axis=0)
        row_sigma = planes.scatter_px * np.sqrt(correlation / planes.kept)
    return WallSamples(row, row_sigma, slope, np.where(nothing, np.nan, sigma), flags)
