"""Space-time derivatives taken straight from a film, as the literature on optical flow takes them.

The player differentiates registered frames (`derivatives.group_derivatives`). Published error tables rest on two other
ways, and a flow method is compared with its table only when it is fed in the same way:

- the first differences of Horn and Schunck (Artificial Intelligence 17, 1981), on two frames;
- Gaussian smoothing in space and time, then central differences of four points (Barron, Fleet and Beauchemin, IJCV 12,
  1994).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.pickup.flow.derivatives import FOUR_POINT, Derivatives

SUPPORT_SIGMAS = 3.0
"""Half length of the smoothing kernel; Barron, Fleet and Beauchemin's 11 points at σ = 1.5."""


def first_differences(first: npt.ArrayLike, second: npt.ArrayLike) -> Derivatives:
    """Return the derivatives of two frames by Horn and Schunck's cube of 2 × 2 × 2 points.

    Each derivative is the mean of the four first differences along its edges of the cube, and belongs to the middle of the
    cube, half a pixel and half a frame further on.

    Parameters
    ----------
    first, second : arrays, shape (row, column)
        At least 2 × 2; in grey levels. NaN spreads to the cubes that hold it.

    Returns
    -------
    Derivatives
        Of the same shape; zero in the last row and column, where there is no cube.

    Raises
    ------
    ArgumentError
        If the frames differ in shape.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    require(a.shape == b.shape, f"frames of {a.shape} and {b.shape} pixels", "two of the same shape")
    cube = np.stack([a, b])
    along = _paired(_paired(np.diff(cube, axis=2), axis=0), axis=1)[0]
    down = _paired(_paired(np.diff(cube, axis=1), axis=0), axis=2)[0]
    onward = _paired(_paired(np.diff(cube, axis=0), axis=1), axis=2)[0]
    x, y, t = (np.pad(d, ((0, 1), (0, 1))).astype(np.float32) for d in (along, down, onward))
    return Derivatives(x, y, t)


def _paired(values: FloatArray, *, axis: int) -> FloatArray:
    """Means of neighbours along an axis."""
    count = values.shape[axis]
    return (values.take(range(count - 1), axis) + values.take(range(1, count), axis)) / 2


def gaussian_derivatives(frames: npt.ArrayLike, *, sigma: float) -> Derivatives:
    """Return the derivatives of a film at its middle frame, smoothed in space and time first.

    Parameters
    ----------
    frames : array, shape (frame, row, column)
        An odd number of frames, at least `frames_needed`; in grey levels. NaN spreads as far as the kernels reach.
    sigma : float
        Standard deviation of the Gaussian, in pixels and in frames; positive.

    Returns
    -------
    Derivatives
        Zero along the border as far as the kernels reach beyond the picture: a zero says nothing, and the flow there is
        what its neighbours suggest.

    Raises
    ------
    ArgumentError
        If there are too few frames, or an even number of them.
    """
    film = np.asarray(frames, np.float64)
    needed = frames_needed(sigma)
    require(
        film.shape[0] % 2 == 1 and film.shape[0] >= needed,
        f"{film.shape[0]} frames for a Gaussian of {sigma} frames",
        f"an odd number, at least {needed}",
    )
    margin = (film.shape[0] - needed) // 2
    smooth = film[margin : margin + needed]
    for axis in range(3):
        smooth = ndimage.correlate1d(smooth, _gaussian(sigma), axis=axis, mode="nearest")
    return four_point_derivatives(smooth, border_px=needed // 2)


def four_point_derivatives(film: FloatArray, *, border_px: int) -> Derivatives:
    """Return the derivatives of a film at its middle frame, by central differences of four points.

    Parameters
    ----------
    film : float64 array, shape (frame, row, column)
        An odd number of frames, at least five; smoothed already.
    border_px : int
        How much of each border is not to be believed; the derivatives are zero there.

    Returns
    -------
    Derivatives
    """
    middle = film.shape[0] // 2
    kernel = FOUR_POINT.astype(np.float64)
    onward = np.tensordot(kernel, film[middle - 2 : middle + 3], axes=1)
    along, down = (ndimage.correlate1d(film[middle], kernel, axis=axis, mode="nearest") for axis in (1, 0))
    height, width = film.shape[1:]
    inside = np.zeros((height, width), np.bool_)
    inside[border_px : height - border_px, border_px : width - border_px] = True
    x, y, t = (np.where(inside, d, 0.0).astype(np.float32) for d in (along, down, onward))
    return Derivatives(x, y, t)


def frames_needed(sigma: float) -> int:
    """Return how many frames the smoothing of `gaussian_derivatives` and its differences reach over: 15 for σ = 1.5."""
    require(sigma > 0, f"a Gaussian of {sigma} frames", "a positive standard deviation")
    return 2 * (_reach(sigma) + FOUR_POINT.size // 2) + 1


def _reach(sigma: float) -> int:
    return int(SUPPORT_SIGMAS * sigma + 0.5)


def _gaussian(sigma: float) -> FloatArray:
    place = np.arange(-_reach(sigma), _reach(sigma) + 1)
    kernel = np.exp(-(place**2) / (2 * sigma**2))
    return np.asarray(kernel / kernel.sum())
