"""The smooth course through places with errors, as smooth as the places themselves say.

Third differences of the course are taken for independent with one variance 1/λ, and the places for the course plus errors
of variance s²/w, with s² at least one: places may scatter more than their errors say, not less. Then the course of greatest
probability is that of Whittaker and Henderson,

    (W + κ D'D) x = W y,       κ = λ s²,

and κ and s² are those of greatest marginal likelihood, with m places of weight above 0 among n columns,

    −2 ln p(y) = R/s² + (m − 3) ln s² + ln |W + κ D'D| − (n − 3) ln κ + …,     R = (y − x)'W(y − x) + κ |D x|²,

which the Cholesky factor of the banded matrix gives along the way. Its inverse has the variances of the course on its
diagonal (Takahashi's recursion). A gap has w = 0: it is bridged, and its variance grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from gramoscope.conventions import FloatArray
from gramoscope.errors import ArgumentError

ORDER = 3
STIFFNESS_DECADES = (-3.0, 7.0)
IMPOSSIBLE = 1e12
"""κ over the median weight: between places that are followed one by one and a parabola."""
FEWEST_PLACES = 8
WAVES = 513
MOST_TENS = 16
Solution = tuple[FloatArray, FloatArray, float]
"""Factor, course and misfit."""


@dataclass(frozen=True, eq=False)
class SteadyCourse:
    """A smooth course.

    Attributes
    ----------
    row : float64 array, shape (column,)
    variance : float64 array, shape (column,)
        Of the course, given the errors of the places, s² and the stiffness.
    stiffness : float
        κ.
    """

    row: FloatArray
    variance: FloatArray
    stiffness: float


def _roughness_bands(n: int) -> FloatArray:
    """D'D in the lower form of SciPy's banded matrices, shape (ORDER + 1, n)."""
    taps = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((ORDER + 1, n))
    for lag in range(ORDER + 1):
        for i in range(ORDER + 1 - lag):
            bands[lag, i : n - ORDER + i] += taps[i] * taps[i + lag]
    return bands


@numba.njit(cache=True, nogil=True)
def _inverse_diagonal(factor):  # type: ignore[no-untyped-def]
    """Diagonal of the inverse of L L', with L in the lower banded form."""
    reach, n = factor.shape[0] - 1, factor.shape[1]
    band = np.zeros((reach + 1, n))
    for j in range(n - 1, -1, -1):
        far = min(reach, n - 1 - j)
        for i in range(far, -1, -1):
            total = 1.0 / factor[0, j] if i == 0 else 0.0
            for k in range(1, far + 1):
                low, high = min(i, k), max(i, k)
                total -= factor[k, j] * band[high - low, j + low]
            band[i, j] = total / factor[0, j]
    return band[0]


def steady_course(row: FloatArray, weight: FloatArray, *, stiffness: float | None = None) -> SteadyCourse:
    """Return the smooth course through places with errors.

    Parameters
    ----------
    row : float64 array, shape (column,)
        Places; not looked at where the weight is 0.
    weight : float64 array, shape (column,)
        Inverse variance of each place; at least `FEWEST_PLACES` above 0.
    stiffness : float, optional
        κ; by the greatest marginal likelihood when left out. Softer by tens where a wide gap leaves nothing to solve.

    Returns
    -------
    SteadyCourse
    """
    roughness = _roughness_bands(row.size)
    place = np.where(weight > 0, row, 0.0)
    # about their mean, for the solution is as exact as the largest number in it
    origin = float(np.average(place, weights=weight))
    place = np.where(weight > 0, place - origin, 0.0)
    scale = float(np.median(weight[weight > 0]))
    free = max(int(np.count_nonzero(weight)) - ORDER, 1)

    def solved(stiffness: float) -> Solution:
        matrix = stiffness * roughness
        matrix[0] += weight
        factor = cholesky_banded(matrix, lower=True, check_finite=False)
        course = cho_solve_banded((factor, True), weight * place, check_finite=False)
        misfit = float(np.sum(weight * (place - course) ** 2) + stiffness * np.sum(np.diff(course, ORDER) ** 2))
        return factor, course, misfit

    def surprise(decades: float) -> float:
        stiffness = scale * 10**decades
        try:
            factor, _, misfit = solved(stiffness)
        except LinAlgError:
            # a groove that leaves the picture: over so many columns without a place nothing this stiff can be solved
            return IMPOSSIBLE * (1 + decades - STIFFNESS_DECADES[0])
        spread = max(1.0, misfit / free)
        volume = 2 * float(np.sum(np.log(factor[0]))) - (row.size - ORDER) * float(np.log(stiffness))
        return misfit / spread + free * float(np.log(spread)) + volume

    if stiffness is None:
        best = minimize_scalar(surprise, bounds=STIFFNESS_DECADES, method="bounded", options={"xatol": 0.1})
        stiffness = scale * 10 ** float(best.x)
    stiffness, (factor, course, misfit) = _softened(solved, stiffness)
    return SteadyCourse(course + origin, _inverse_diagonal(factor) * max(1.0, misfit / free), stiffness)


def _softened(solved: Callable[[float], Solution], stiffness: float) -> tuple[float, Solution]:
    """Solve with a stiffness, or with the first tenth, hundredth … of it that can be solved."""
    for softer in 10.0 ** -np.arange(MOST_TENS):
        try:
            return softer * stiffness, solved(softer * stiffness)
        except LinAlgError:
            pass
    raise ArgumentError("places and weights of which no course can be made", "numbers, and weights of 0 or more")


def left_by_course(likeness: FloatArray, weight: float, stiffness: float) -> float:
    """Return the share of the variance of errors that is left between the places and a course through them.

    A course takes part of the errors for the edge and follows them, the more so the wider neighbours are alike, and what is
    left tells of the others only. Waves of k radians a column are followed by w / (w + κ (2 − 2 cos k)³).

    Parameters
    ----------
    likeness : float64 array, shape (lag,)
        Correlation of the errors of columns so far apart, from lag 0, where it is 1.
    weight : float
        w of a place.
    stiffness : float
        κ of the course.
    """
    wave = np.linspace(0, np.pi, WAVES)
    errors = np.maximum(2 * np.cos(np.outer(wave, np.arange(likeness.size))) @ likeness - 1, 0.0)
    rough = stiffness * (2 - 2 * np.cos(wave)) ** ORDER
    return float((errors * (rough / (weight + rough)) ** 2).sum() / errors.sum())
