"""Many simulated walls at once: centroid lines with noise and outliers, and what the estimators make of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.wall import fit_planes

TRIALS = 400
TRUE_SLOPE = 0.02
APART_PX = 95.7
"""Between the two lines of a wall at 45°."""


@dataclass(frozen=True, eq=False)
class Walls:
    """Centroid lines of many walls side by side, one neighbourhood each."""

    rows: FloatArray
    measured: BoolArray
    neighbourhood_px: int

    @property
    def stations(self) -> FloatArray:
        """The middle of each neighbourhood."""
        count = self.rows.shape[1] // self.neighbourhood_px
        return np.asarray((np.arange(count) + 0.5) * self.neighbourhood_px - 0.5)

    def robust_slopes(self) -> FloatArray:
        """Return the slope of each wall by the robust estimator."""
        size = self.neighbourhood_px
        return fit_planes(self.rows, self.measured, self.stations, neighbourhood_px=size - 1, least_points=5).slope

    def least_squares_slopes(self) -> FloatArray:
        """Return the slope of each wall by least squares: two lines of one slope."""
        x = np.arange(self.neighbourhood_px) - (self.neighbourhood_px - 1) / 2
        blocks = self.rows.reshape(2, -1, self.neighbourhood_px)
        return np.asarray((blocks @ x).sum(axis=0) / (2 * (x @ x)))


def walls(
    *, noise_px: float, outliers: float = 0.0, together: bool = False, neighbourhood_px: int = 100, seed: int = 1
) -> Walls:
    """Return `TRIALS` walls with noise, and with a share of centroids that are 10 to 40 pixels too high.

    Parameters
    ----------
    noise_px : float
        Standard deviation of each centroid.
    outliers : float
        Share of the centroids that are wrong.
    together : bool
        Wrong ones lie in one piece at one end of the neighbourhood, as a chip makes them; otherwise anywhere.
    neighbourhood_px : int
    seed : int
    """
    rng = np.random.default_rng(seed)
    n, wrong = neighbourhood_px, round(outliers * neighbourhood_px)
    x = np.arange(TRIALS * n)
    rows = TRUE_SLOPE * x + np.array([[211.3], [211.3 + APART_PX]]) + noise_px * rng.normal(size=(2, x.size))
    blocks = rows.reshape(2, TRIALS, n)
    order = np.arange(n) if together else None
    for trial in range(TRIALS):
        for line in range(2):
            places = (order if order is not None else rng.permutation(n))[:wrong]
            # the rim of a chip is rough, and lies to one side
            blocks[line, trial, places] += rng.uniform(10, 40, size=wrong)
    return Walls(rows, np.ones(rows.shape, np.bool_), n)


def rms_error(slopes: FloatArray) -> float:
    """Return the root mean square error of slopes whose true value is `TRUE_SLOPE`."""
    return float(np.sqrt(np.mean((slopes - TRUE_SLOPE) ** 2)))


def bound(noise_px: float, neighbourhood_px: int) -> float:
    """Return the least standard error of the slope of two lines, σ √(12 / 2N(N²−1)) (Cramér and Rao, Gaussian noise)."""
    n = neighbourhood_px
    return noise_px * float(np.sqrt(12 / (2 * n * (n**2 - 1))))
