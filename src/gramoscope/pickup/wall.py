"""The orientation of a wall from its centroid lines (paper, section 6).

The centroid lines of one wall lie at known depths z_i = −q_i, so every column gives a point (s, l_i, z_i) of the wall for
each line. Within a neighbourhood of about 100 columns the wall is a plane,

    l = c + m s + n z,

and m = ∂l/∂s is what a pickup calls velocity (over the groove speed), n = ∂l/∂z = ∓ cot φ the angle of the wall. With two
depths, giving c + n z₁ and c + n z₂ is the same as giving c and n; so the plane is fitted as lines of *one* slope m with an
intercept for each depth, and with a single line the angle of the wall is simply not measured.

The paper calls its estimator robust and refers to an earlier report for it; the report could not be found, so this one is
ours. It starts from the *repeated median* (Siegel, Biometrika 69, 1982), which withstands just under half of the points
being wrong, taken over the whole neighbourhood and over either half, because damage comes in one piece. It ends with a few
rounds of reweighted least squares with Tukey's biweight (c = 4.685 robust standard deviations), which is 95 % as efficient
as least squares when nothing is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require

TUKEY = 4.685
MAD_TO_SIGMA = 1.4826
START_POINTS = 25
"""Points of each line that take part in the repeated median: enough for a start."""
SCALE_FLOOR_PX = 0.02
"""Residuals are never taken to be smaller than this: rounding noise of a perfect line must not count as outliers."""


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes fitted to a wall, one at each station.

    Attributes
    ----------
    slope, slope_sigma : float64 arrays, shape (station,)
        m and its standard error, assuming independent errors of the columns (Huber, *Robust Statistics*, 1981, section
        7.6). NaN where too few points were measured.
    row : float64 array, shape (line, station)
        Row of the plane at each depth; NaN for a line without points in the neighbourhood.
    scatter_px : float64 array, shape (station,)
        Robust standard deviation of the centroids about the plane.
    points, kept : float64 arrays, shape (station,)
        Measured points in the neighbourhood, and the sum of their final weights.
    """

    slope: FloatArray
    slope_sigma: FloatArray
    row: FloatArray
    scatter_px: FloatArray
    points: FloatArray
    kept: FloatArray


@numba.njit(cache=True, nogil=True)
def _repeated_median(x, y, count):  # type: ignore[no-untyped-def]
    """Median over i of the median over j of the slopes from point i to point j, on at most START_POINTS points."""
    used = min(count, START_POINTS)
    outer = np.empty(used)
    inner = np.empty(used - 1)
    for a in range(used):
        i = a * (count - 1) // (used - 1)
        filled = 0
        for b in range(used):
            j = b * (count - 1) // (used - 1)
            if j != i:
                inner[filled] = (y[j] - y[i]) / (x[j] - x[i])
                filled += 1
        outer[a] = np.median(inner[:filled])
    return np.median(outer)


@numba.njit(cache=True, nogil=True)
def _intercepts(x, y, line, weight, slope, intercept):  # type: ignore[no-untyped-def]
    total = np.zeros(intercept.size)
    share = np.zeros(intercept.size)
    for k in range(x.size):
        total[line[k]] += weight[k] * (y[k] - slope * x[k])
        share[line[k]] += weight[k]
    for i in range(intercept.size):
        intercept[i] = total[i] / share[i] if share[i] > 0 else np.nan


@numba.njit(cache=True, nogil=True)
def _common_slope(x, y, line, weight, lines):  # type: ignore[no-untyped-def]
    """Weighted least squares of lines with one slope; returns slope, Σ w (x − x̄)² and the intercepts."""
    share = np.zeros(lines)
    mean_x = np.zeros(lines)
    mean_y = np.zeros(lines)
    for k in range(x.size):
        share[line[k]] += weight[k]
        mean_x[line[k]] += weight[k] * x[k]
        mean_y[line[k]] += weight[k] * y[k]
    for i in range(lines):
        if share[i] > 0:
            mean_x[i] /= share[i]
            mean_y[i] /= share[i]
    square = 0.0
    cross = 0.0
    for k in range(x.size):
        dx = x[k] - mean_x[line[k]]
        square += weight[k] * dx * dx
        cross += weight[k] * dx * (y[k] - mean_y[line[k]])
    slope = cross / square if square > 0 else np.nan
    intercept = np.where(share > 0, mean_y - slope * mean_x, np.nan)
    return slope, square, intercept


@numba.njit(cache=True, nogil=True)
def _start_within(x, y, line, lines, low, high):  # type: ignore[no-untyped-def]
    """Slope from the repeated median of each line over low ≤ x ≤ high, intercepts and median residual over all x."""
    slope = 0.0
    weight = 0
    for i in range(lines):
        mine = (line == i) & (x >= low) & (x <= high)
        count = int(mine.sum())
        if count >= 3:
            slope += count * _repeated_median(x[mine], y[mine], count)
            weight += count
    slope = slope / weight if weight > 0 else np.nan
    residual = y - slope * x
    intercept = np.full(lines, np.nan)
    for i in range(lines):
        mine = line == i
        if mine.sum() > 0:
            intercept[i] = np.median(residual[mine])
    for k in range(x.size):
        residual[k] = abs(residual[k] - intercept[line[k]])
    return slope, intercept, np.median(residual)


@numba.njit(cache=True, nogil=True)
def _robust_start(x, y, line, lines):  # type: ignore[no-untyped-def]
    """The start with the least median residual, from the whole neighbourhood or from either half.

    Damage comes in one piece: a chip over a third of the neighbourhood biases the repeated median although it does not
    break it, and one of the halves is then nearly free of it.
    """
    slope, intercept, best = _start_within(x, y, line, lines, -np.inf, np.inf)
    for low, high in ((-np.inf, 0.0), (0.0, np.inf)):
        m, at, spread = _start_within(x, y, line, lines, low, high)
        if spread < best:
            slope, intercept, best = m, at, spread
    return slope, intercept


@numba.njit(cache=True, nogil=True)
def _fit(x, y, line, lines, rounds):  # type: ignore[no-untyped-def]
    slope, intercept = _robust_start(x, y, line, lines)
    weight = np.ones(x.size)
    residual = np.empty(x.size)
    square = 0.0
    scale = SCALE_FLOOR_PX
    for _ in range(rounds):
        for k in range(x.size):
            residual[k] = y[k] - slope * x[k] - intercept[line[k]]
        scale = max(MAD_TO_SIGMA * np.median(np.abs(residual)), SCALE_FLOOR_PX)
        for k in range(x.size):
            u = residual[k] / (TUKEY * scale)
            weight[k] = (1 - u * u) ** 2 if abs(u) < 1 else 0.0
        slope, square, intercept = _common_slope(x, y, line, weight, lines)
    return slope, square, intercept, scale, weight


@numba.njit(cache=True, nogil=True)
def _slope_sigma(residual, weight, scale, square, parameters):  # type: ignore[no-untyped-def]
    """Standard error of the slope, over the points with weight: Huber's √(Σψ²/(n − p)) / mean ψ′ / √Σ(x − x̄)², ψ = w r."""
    points, share, psi2, steepness = 0, 0.0, 0.0, 0.0
    for k in range(residual.size):
        if weight[k] > 0:
            u2 = (residual[k] / (TUKEY * scale)) ** 2
            points += 1
            share += weight[k]
            psi2 += (weight[k] * residual[k]) ** 2
            steepness += (1 - u2) * (1 - 5 * u2)
    if square <= 0 or steepness <= 0:
        return np.nan
    # `square` is weighted; where a point stands tells nothing of its weight
    spread = square * points / share
    return np.sqrt(psi2 / max(points - parameters, 1) / spread) * points / steepness


@numba.njit(cache=True, nogil=True)
def _fit_stations(rows, measured, stations, half, least, rounds, slope, sigma, at, scatter, points, kept):  # type: ignore[no-untyped-def]
    lines, width = rows.shape
    for n in range(stations.size):
        centre = stations[n]
        start, stop = max(0, int(np.ceil(centre - half))), min(width, int(np.floor(centre + half)) + 1)
        count = 0
        for i in range(lines):
            count += int(measured[i, start:stop].sum())
        points[n] = count
        if count < least:
            continue
        x, y, line = np.empty(count), np.empty(count), np.empty(count, np.int64)
        filled = 0
        for i in range(lines):
            for c in range(start, stop):
                if measured[i, c]:
                    x[filled], y[filled], line[filled] = c - centre, rows[i, c], i
                    filled += 1
        m, square, intercept, scale, weight = _fit(x, y, line, lines, rounds)
        slope[n], at[:, n], scatter[n], kept[n] = m, intercept, scale, weight.sum()
        for k in range(count):
            y[k] -= m * x[k] + intercept[line[k]]
        sigma[n] = _slope_sigma(y, weight, scale, square, lines + 1)


def fit_planes(
    rows: FloatArray,
    measured: npt.NDArray[np.bool_],
    stations: FloatArray,
    *,
    neighbourhood_px: float,
    least_points: int,
    rounds: int = 6,
) -> Planes:
    """Fit a plane to the centroid lines of one wall at each station.

    Parameters
    ----------
    rows : float64 array, shape (line, column)
        Centroids; values that were not measured are not looked at.
    measured : bool array, shape (line, column)
    stations : float64 array, shape (station,)
        Columns at which to fit.
    neighbourhood_px : float
        Width of the neighbourhood, over which the slope is a constant: wide for little noise, narrow for treble.
    least_points : int
        With fewer measured points than this the station gets NaN.
    rounds : int
        Rounds of reweighting.

    Returns
    -------
    Planes
    """
    lines, n = rows.shape[0], stations.size
    slope, sigma, scatter = (np.full(n, np.nan) for _ in range(3))
    at = np.full((lines, n), np.nan)
    points, kept = np.zeros(n), np.zeros(n)
    _fit_stations(
        np.ascontiguousarray(rows), np.ascontiguousarray(measured), stations, neighbourhood_px / 2,
        max(least_points, lines + 2), rounds, slope, sigma, at, scatter, points, kept,
    )  # fmt: skip
    return Planes(slope, sigma, at, scatter, points, kept)


def wall_angle_rad(planes: Planes, *, depth_below_land_m: FloatArray, pixel_pitch_m: float) -> float:
    """Return the angle of a wall against the land, φ = atan(Δq/Δl), from its two stripes.

    Parameters
    ----------
    planes : Planes
        Fitted to two lines.
    depth_below_land_m : float64 array, shape (2,)
        Depth q of each line.
    pixel_pitch_m : float

    Returns
    -------
    float
        0 … π/2, the median over the stations; NaN when no station saw both lines, or for a wall with one.
    """
    if planes.row.shape[0] != 2:
        return float("nan")
    apart_m = np.abs(planes.row[1] - planes.row[0]) * pixel_pitch_m
    apart_m = apart_m[np.isfinite(apart_m)]
    if apart_m.size == 0:
        return float("nan")
    return float(np.arctan2(abs(depth_below_land_m[1] - depth_below_land_m[0]), np.median(apart_m)))


def correlation_length_px(residual: FloatArray, *, reach_px: int = 12) -> float:
    """Return 1 + 2 Σ ρ_k: over how many columns the errors of a centroid line are one and the same.

    Parameters
    ----------
    residual : float64 array, shape (line, column)
        Centroids minus planes, NaN where not measured.
    reach_px : int
        Largest lag considered.

    Returns
    -------
    float
        At least 1; the sum stops at the first negative correlation (Geyer's initial positive sequence).
    """
    known = np.isfinite(residual)
    value = np.where(known, residual, 0.0)
    power = float((value**2).sum()) / max(int(known.sum()), 1)
    total = 1.0
    for lag in range(1, reach_px + 1):
        pairs = int((known[:, lag:] & known[:, :-lag]).sum())
        if pairs == 0 or power == 0:
            break
        rho = float((value[:, lag:] * value[:, :-lag]).sum()) / pairs / power
        if rho <= 0:
            break
        total += 2 * rho
    return total


@dataclass(frozen=True)
class WallOrientation:
    """The robust orientation estimator.

    Parameters
    ----------
    neighbourhood_px : float
        Columns about a station that share one plane; 100 in the paper.
    stride_px : int
        From one station to the next.
    least_share : float
        A station with less than this share of its neighbourhood measured is not believed.
    """

    neighbourhood_px: float = 100.0
    stride_px: int = 10
    least_share: float = 0.3

    def __post_init__(self) -> None:
        require(self.neighbourhood_px >= 5, f"a neighbourhood of {self.neighbourhood_px} pixels", "at least 5")
        require(self.stride_px >= 1, f"a stride of {self.stride_px} pixels", "at least 1")
        require(0 < self.least_share <= 1, f"a least share of {self.least_share}", "above 0, at most 1")

    @property
    def correlation_samples(self) -> float:
        """Over how many stations errors count as one and the same: half a neighbourhood.

        The slopes of two neighbourhoods that overlap share errors when they overlap much, and err the opposite way when
        they overlap little, because a centroid that tilts the one up tilts the other down. Half leaves the smallest
        errors after smoothing; the smoothed error bars are then too wide on rendered grooves, by a half and more
        (`tests/recovery`).
        """
        return max(0.5 * self.neighbourhood_px / self.stride_px, 1.0)

    def stations(self, width: int) -> FloatArray:
        """Return the columns at which planes are fitted, for a stretch of some width."""
        return np.arange(0.0, width, self.stride_px)

    def fit(self, rows: FloatArray, measured: npt.NDArray[np.bool_]) -> Planes:
        """Fit planes to the centroid lines of one wall, shape (line, column)."""
        return fit_planes(
            rows,
            measured,
            self.stations(rows.shape[1]),
            neighbourhood_px=self.neighbourhood_px,
            least_points=int(self.least_share * self.neighbourhood_px),
        )
