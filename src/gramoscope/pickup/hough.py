"""The Hough transform: three stripes found as three lines (paper, section 5.2).

A line is all points with  x cos θ + y sin θ = ρ,  where x is the *row* and y the *column* (the stripes run along the
columns, so the paper's x is the row), both counted from the middle of the stretch. θ runs from −45° to 45° in steps of 1°.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Line:
    """A line x cos θ + y sin θ = ρ in rows x and columns y.

    Attributes
    ----------
    theta_rad, rho_px : float
    votes : float
        How many points its cell of the accumulator holds.
    row_origin, column_origin : float
        The point from which x and y are counted.
    """

    theta_rad: float
    rho_px: float
    votes: float
    row_origin: float
    column_origin: float

    def row_at(self, column: npt.ArrayLike) -> FloatArray:
        """Return the row of the line at a column."""
        y = np.asarray(column, np.float64) - self.column_origin
        return np.asarray(
            self.row_origin + (self.rho_px - y * np.sin(self.theta_rad)) / np.cos(self.theta_rad), np.float64
        )

    @property
    def slope(self) -> float:
        """d(row)/d(column) = −tan θ."""
        return float(-np.tan(self.theta_rad))


@dataclass(frozen=True, eq=False)
class Accumulator:
    """The votes for every line.

    Attributes
    ----------
    votes : int array, shape (theta, rho)
    theta_rad, rho_px : float64 arrays
        The axes.
    row_origin, column_origin : float
    """

    votes: IntArray
    theta_rad: FloatArray
    rho_px: FloatArray
    row_origin: float
    column_origin: float


@numba.njit(cache=True, nogil=True)
def _vote(x, y, cosine, sine, rho_start, votes):  # type: ignore[no-untyped-def]
    for i in range(cosine.size):
        row, c, s = votes[i], cosine[i], sine[i]
        for k in range(x.size):
            row[int(np.floor(x[k] * c + y[k] * s - rho_start + 0.5))] += 1


def accumulate(
    rows: npt.ArrayLike, columns: npt.ArrayLike, *, row_origin: float, column_origin: float, theta_rad: FloatArray
) -> Accumulator:
    """Let points vote for the lines through them.

    Parameters
    ----------
    rows, columns : array_like, shape (point,)
        Finite.
    row_origin, column_origin : float
        Where x and y are counted from.
    theta_rad : float64 array
        The angles tried, within ±π/2.

    Returns
    -------
    Accumulator
        ρ in steps of one pixel.
    """
    x = np.asarray(rows, np.float64) - row_origin
    y = np.asarray(columns, np.float64) - column_origin
    reach = int(np.ceil(np.hypot(np.abs(x).max(initial=0), np.abs(y).max(initial=0)))) + 1
    votes = np.zeros((theta_rad.size, 2 * reach + 1), np.int64)
    _vote(x, y, np.cos(theta_rad), np.sin(theta_rad), float(-reach), votes)
    return Accumulator(votes, theta_rad, np.arange(-reach, reach + 1, dtype=np.float64), row_origin, column_origin)


def _windowed(votes: IntArray, window_px: int) -> FloatArray:
    """Sum of the votes over a window of ρ."""
    total = np.cumsum(np.pad(votes, ((0, 0), (window_px // 2 + 1, window_px // 2))), axis=1)
    return np.asarray(total[:, window_px:] - total[:, :-window_px], np.float64)


def peaks(
    accumulator: Accumulator,
    *,
    count: int,
    separation_px: float,
    window_px: int = 7,
    least_share: float = 0.2,
    least_votes: float = 0.0,
) -> list[Line]:
    """Return the strongest lines, strongest first.

    Parameters
    ----------
    accumulator : Accumulator
    count : int
        At most so many.
    separation_px : float
        Two lines are nowhere in the middle of the stretch closer than this.
    window_px : int
        Votes are counted over a window of ρ this wide (odd): a stripe is not one pixel thin.
    least_share : float
        A line with fewer votes than this share of the strongest is no peak.
    least_votes : float
        Nor is one with fewer votes than this.

    Returns
    -------
    list of Line
        Empty when nothing voted.
    """
    score = _windowed(accumulator.votes, window_px)
    row = accumulator.rho_px[None, :] / np.cos(accumulator.theta_rad)[:, None]
    found: list[Line] = []
    best = score.max(initial=0.0)
    while len(found) < count and score.max(initial=0.0) > max(least_share * best, least_votes):
        i, j = np.unravel_index(int(np.argmax(score)), score.shape)
        found.append(
            Line(
                float(accumulator.theta_rad[i]),
                float(accumulator.rho_px[j]),
                float(score[i, j]),
                accumulator.row_origin,
                accumulator.column_origin,
            )
        )
        score[np.abs(row - row[i, j]) < separation_px] = 0.0
    return found


def belongs(
    rows: npt.ArrayLike, columns: npt.ArrayLike, line: Line, *, theta_reach_rad: float, rho_reach_px: float
) -> BoolArray:
    """Return which points lie in the region of a peak.

    A point belongs to the peak (θ₀, ρ₀) when one of the lines through it does: |θ − θ₀| ≤ `theta_reach_rad` and
    |ρ − ρ₀| ≤ `rho_reach_px`. Since ρ(θ) of a point is a sinusoid, it passes the box exactly when its value at θ₀ is
    nearer to ρ₀ than the reach plus its largest change within the box (second order is left out: under 1 % here).
    """
    x = np.asarray(rows, np.float64) - line.row_origin
    y = np.asarray(columns, np.float64) - line.column_origin
    c, s = np.cos(line.theta_rad), np.sin(line.theta_rad)
    change = np.abs(-x * s + y * c) * theta_reach_rad
    return np.asarray(np.abs(x * c + y * s - line.rho_px) <= rho_reach_px + change)


def segment(
    rows: npt.ArrayLike, columns: npt.ArrayLike, lines: list[Line], *, theta_reach_rad: float, rho_reach_px: float
) -> IntArray:
    """Give each point to the one line whose region it lies in.

    Returns
    -------
    int array, shape (point,)
        Number of the line; −1 for a point in no region, −2 for a disputed one, in two or more.
    """
    label = np.full(np.asarray(rows).shape, -1, np.int64)
    claims = np.zeros(label.shape, np.int64)
    for number, line in enumerate(lines):
        inside = belongs(rows, columns, line, theta_reach_rad=theta_reach_rad, rho_reach_px=rho_reach_px)
        label[inside] = number
        claims += inside
    return np.where(claims > 1, -2, label)
