"""The outline of a sound: peaks a window, as in the paper's figures 6c–d and 8c–d, and extremes for drawing.

The paper does not say how long its window is; here the caller says.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.errors import require


def _starts(count: int, *, window_samples: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    require(window_samples >= 1, f"a window of {window_samples} samples", "at least one")
    return np.arange(0, count, window_samples, dtype=np.intp)


def peak_envelope(samples: FloatArray, *, window_samples: int) -> FloatArray:
    """Return the largest magnitude in each window; windows follow each other without overlap.

    Parameters
    ----------
    samples : float64 array, shape (sample,)
        Any unit. NaN is passed over; a window of nothing but NaN gives NaN.
    window_samples : int
        At least 1; the last window holds what remains.

    Returns
    -------
    float64 array, shape (window,)
        max |x|, same unit.

    Raises
    ------
    ArgumentError
        If the window is empty.
    """
    starts = _starts(len(samples), window_samples=window_samples)
    return np.fmax.reduceat(np.abs(samples), starts) if len(samples) else np.empty(0)


def extremes(samples: FloatArray, *, window_samples: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest sample of each window, for drawing more samples than there are dots.

    Parameters, NaN and errors as in `peak_envelope`.

    Returns
    -------
    lowest, highest : float64 arrays, shape (window,)
    """
    starts = _starts(len(samples), window_samples=window_samples)
    if len(samples) == 0:
        return np.empty(0), np.empty(0)
    return np.fmin.reduceat(samples, starts), np.fmax.reduceat(samples, starts)
