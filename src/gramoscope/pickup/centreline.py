"""The centroid line of a stripe (paper, section 5.2).

In every column the row of a stripe is the centroid of its in-focus points, each weighted by the power of its gradient
along the groove. A column without points is a void: it is filled from the line of the Hough peak, and says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray


@dataclass(frozen=True, eq=False)
class Centreline:
    """Where a stripe runs.

    Attributes
    ----------
    row : float64 array, shape (column,)
        Centroid, or the Hough line in a void; NaN where there is neither.
    measured : bool array, shape (column,)
        False in a void.
    """

    row: FloatArray
    measured: npt.NDArray[np.bool_]


def centroids(
    rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64], weights: FloatArray, *, width: int
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted mean row of the points in each column.

    Parameters
    ----------
    rows, columns : int arrays, shape (point,)
    weights : float64 array, shape (point,)
        Positive.
    width : int
        Number of columns.

    Returns
    -------
    row : float64 array, shape (column,)
        NaN in a column without points.
    weight : float64 array, shape (column,)
        Sum of the weights.
    """
    weight = np.asarray(np.bincount(columns, weights, width), np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        row = np.bincount(columns, weights * rows, width) / weight
    return np.asarray(row, np.float64), weight


def fill_voids(row: FloatArray, line_row: FloatArray) -> Centreline:
    """Fill the columns without a centroid from the line of the peak.

    Parameters
    ----------
    row, line_row : float64 arrays, shape (column,)
        Centroids and Hough line, either with NaN.
    """
    measured = np.isfinite(row)
    return Centreline(np.where(measured, row, line_row), measured)


def discard_damaged_columns(
    label: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int64],
    *,
    width: int,
    most_outside: int = 12,
    margin_px: int = 4,
) -> npt.NDArray[np.int64]:
    """Set aside the points of columns in which damage runs across the stripes.

    The rim of a chip or a scratch across the groove is a vertical line of sharp points. The Hough transform ignores it,
    but where it crosses a stripe its points lie in the region of the peak and pull the centroid to the line.

    Parameters
    ----------
    label : int array, shape (point,)
        Stripe of each point, negative outside the regions.
    columns : int array, shape (point,)
    width : int
    most_outside : int
        A column with more points than this outside all regions is damaged.
    margin_px : int
        So are its neighbours, so far to either side.

    Returns
    -------
    int array, shape (point,)
        −3 for the points in damaged columns.
    """
    outside = np.bincount(columns[label == -1], minlength=width)
    damaged = np.convolve(outside > most_outside, np.ones(2 * margin_px + 1, np.int64), "same") > 0
    return np.where(damaged[columns], -3, label)
