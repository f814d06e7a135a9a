"""Places of neighbouring columns pooled, where the edge runs too smoothly for them to differ.

What an edge does faster than its smooth course resolves lies below the noise of its columns. The course passes waves up to
about the wavenumber k at which prior and errors weigh the same, λ k⁶ = w. Deviations from the course are averaged under a
Gaussian window of standard deviation σ, which takes 1 − exp(−k²σ²/2) off a wave, and only off the part of it that the course
has not followed. σ is half of 1/k, and never more than a few columns: one loud passage must not suffer for the quiet ones
that the smoothness was learned from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray

POOL_OF_RESOLUTION = 0.5
LEAST_POOL_COLUMNS = 0.4
"""A narrower window holds one column."""
REACH = 3.0
"""The window ends so many standard deviations from its middle."""


@dataclass(frozen=True, eq=False)
class Pooled:
    """Pooled deviations.

    Attributes
    ----------
    value, variance : float64 arrays, shape (column,)
        Variance by the errors of the columns and their likeness.
    correlation_samples : float
        How many neighbouring columns share one error now.
    """

    value: FloatArray
    variance: FloatArray
    correlation_samples: float


def pool_columns(weight: float, stiffness: float, *, most: float) -> float:
    """Return the standard deviation of the window, in columns: half of what the course resolves, at most `most`."""
    return float(min(POOL_OF_RESOLUTION * (stiffness / weight) ** (1 / 6), most))


def pooled(
    value: FloatArray, variance: FloatArray, measured: BoolArray, likeness: FloatArray, *, columns: float
) -> Pooled:
    """Return deviations averaged over neighbouring columns.

    Parameters
    ----------
    value, variance : float64 arrays, shape (column,)
        Deviations from the smooth course, and their variances.
    measured : bool array, shape (column,)
        Only these are pooled; at others the answer is what it was.
    likeness : float64 array, shape (lag,)
        Correlation of errors so many columns apart, from lag 0, where it is 1.
    columns : float
        Standard deviation of the Gaussian window.
    """
    shared = 1 + 2 * float(likeness[1:].sum())
    if columns < LEAST_POOL_COLUMNS or not measured.any():
        return Pooled(value, variance, shared)
    reach = int(np.ceil(REACH * columns))
    offset = np.arange(-reach, reach + 1)
    weight = np.where(measured, 1 / np.where(measured, variance, 1.0), 0.0)
    share = np.exp(-0.5 * (offset / columns) ** 2) * _neighbours(weight, reach)
    total = share.sum(axis=1, keepdims=True)
    share = np.where(measured[:, None], share / np.where(total > 0, total, 1.0), 0.0)
    mean = (share * _neighbours(np.where(measured, value, 0.0), reach)).sum(axis=1)
    error = share * _neighbours(np.sqrt(np.where(measured, variance, 0.0)), reach)
    spread = (error**2).sum(axis=1)
    for lag in range(1, min(likeness.size, offset.size)):
        spread += 2 * likeness[lag] * (error[:, lag:] * error[:, :-lag]).sum(axis=1)
    # a window that adds up to one keeps the information of many columns: shared errors grow as variances shrink
    kept = float(np.median(spread[measured] / variance[measured]))
    return Pooled(
        np.where(measured, mean, value), np.where(measured, spread, variance), max(1.0, shared / max(kept, 1e-6))
    )


def _neighbours(value: FloatArray, reach: int) -> FloatArray:
    """The values about each column, shape (column, 2 `reach` + 1); 0 beyond the ends. A view."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(value, reach), 2 * reach + 1)
