"""Space-time derivatives of a group of frames, the input of every differential flow method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from gramoscope.conventions import Float32Array
from gramoscope.pickup.registration import Canvas

FOUR_POINT = (np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12).astype(np.float32)
"""Central differences exact for polynomials up to the fourth degree (Barron, Fleet and Beauchemin, IJCV 12, 1994)."""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """I_x, I_y and I_t on the points of one picture.

    Attributes
    ----------
    x, y : float32 arrays, shape (row, column)
        Along the columns and along the rows, in grey levels a pixel (or, scaled, without unit).
    t : float32 array, shape (row, column)
        Grey levels a frame.
    """

    x: Float32Array
    y: Float32Array
    t: Float32Array

    def scaled(self, factor: float) -> Derivatives:
        """Return the derivatives of the pictures times a factor."""
        f = np.float32(factor)
        return Derivatives(self.x * f, self.y * f, self.t * f)


def group_derivatives(canvas: Canvas, *, smoothing_px: float) -> Derivatives:
    """Return the derivatives of frames laid over each other.

    Parameters
    ----------
    canvas : Canvas
    smoothing_px : float
        Standard deviation of the Gaussian that smooths mean and trend first, 0 for none.

    Returns
    -------
    Derivatives
        Spatial ones by `FOUR_POINT` differences of the mean, the temporal one is the trend over all frames. Beyond the
        border the picture is taken to repeat its last pixel.
    """
    mean, trend = canvas.mean, canvas.trend
    if smoothing_px > 0:
        mean, trend = (ndimage.gaussian_filter(a, smoothing_px, mode="nearest", truncate=3.0) for a in (mean, trend))
    along, across = (ndimage.correlate1d(mean, FOUR_POINT, axis=axis, mode="nearest") for axis in (1, 0))
    return Derivatives(along, across, trend)


def texture_contrast(gradient: Float32Array, *, rows: int = 4, blocks: int = 8) -> float:
    """Return the root mean square gradient where a stretch is sharpest.

    Parameters
    ----------
    gradient : float32 array, shape (row, column)
        Along the groove.
    rows : int
        Height of the window that slides over the rows.
    blocks : int
        The picture is cut into so many blocks of columns; each finds its own sharpest window, and the median over the
        blocks stands, so that neither a scratch nor a chip decides. The height of the picture does not matter.

    Returns
    -------
    float
        Same unit as `gradient`; 0 for a picture without texture.
    """
    width = gradient.shape[1] // blocks * blocks
    power = (gradient[:, :width] ** 2).reshape(gradient.shape[0], blocks, -1).mean(axis=2)
    windowed = ndimage.uniform_filter1d(power, rows, axis=0)
    return float(np.sqrt(np.median(windowed.max(axis=0))))
