"""The smooth course through places with errors, as smooth as the places themselves say.

Third differences of the course are taken for independent with one variance 1/λ, and the places for the course plus errors
of known variance 1/w. Then the course of greatest probability is that of Whittaker and Henderson,

    (W + λ D'D) x = W y,

and λ is that of greatest marginal likelihood,

    −2 ln p(y) = (y − x)'W(y − x) + λ |D x|² + ln |W + λ D'D| − (n − 3) ln λ + …,

which the Cholesky factor of the banded matrix gives along the way. Its inverse has the variances of the course on its
diagonal (Takahashi's recursion). A gap has w = 0: it is bridged, and its variance grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from gramoscope.conventions import FloatArray

ORDER = 3
STIFFNESS_DECADES = (-3.0, 7.0)
"""λ over the median weight: between places that are followed one by one and a parabola."""
FEWEST_PLACES = 8


@dataclass(frozen=True, eq=False)
class SteadyCourse:
    """A smooth course.

    Attributes
    ----------
    row : float64 array, shape (column,)
    variance : float64 array, shape (column,)
        Of the course, given the errors of the places and the stiffness.
    stiffness : float
        λ.
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
        λ; by the greatest marginal likelihood when left out.

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

    def solved(stiffness: float) -> tuple[FloatArray, FloatArray]:
        matrix = stiffness * roughness
        matrix[0] += weight
        factor = cholesky_banded(matrix, lower=True, check_finite=False)
        return factor, cho_solve_banded((factor, True), weight * place, check_finite=False)

    def surprise(decades: float) -> float:
        stiffness = scale * 10**decades
        factor, course = solved(stiffness)
        misfit = float(np.sum(weight * (place - course) ** 2) + stiffness * np.sum(np.diff(course, ORDER) ** 2))
        return misfit + 2 * float(np.sum(np.log(factor[0]))) - (row.size - ORDER) * float(np.log(stiffness))

    if stiffness is None:
        best = minimize_scalar(surprise, bounds=STIFFNESS_DECADES, method="bounded", options={"xatol": 0.1})
        stiffness = scale * 10 ** float(best.x)
    factor, course = solved(stiffness)
    return SteadyCourse(course + origin, _inverse_diagonal(factor), stiffness)
