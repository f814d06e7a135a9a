"""The search for the stripes: a Hough transform on each segment of the picture, roles for the lines, points for the stripes.

The paper transforms the whole picture at once. In loud passages a stripe is no longer one straight line across half a
millimetre, so the picture may be cut into *segments* of columns; with one segment this is the paper's search. Which line is
which stripe is decided for all segments together (`stripes.StripeModel`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.conventions import FloatArray, IntArray, rad
from gramoscope.errors import require
from gramoscope.pickup.hough import Accumulator, Line, accumulate, peaks, segment
from gramoscope.pickup.stripes import StripeModel

CANDIDATE_LINES = 6
"""So many peaks of a segment are considered: the three stripes, and what damage adds."""


@dataclass(frozen=True, eq=False)
class Segment:
    """What the Hough transform found in one stretch of columns.

    Attributes
    ----------
    start, stop : int
        Its columns.
    accumulator : Accumulator
    candidates : list of Line
        Peaks, strongest first.
    lines : list of Line or None
        The line of each expected stripe.
    """

    start: int
    stop: int
    accumulator: Accumulator
    candidates: list[Line]
    lines: list[Line | None]


@dataclass(frozen=True)
class HoughSearch:
    """The Hough transform and the regions of its peaks.

    Parameters
    ----------
    theta_reach_deg : float
        Largest |θ| tried; 45 in the paper.
    theta_step_deg : float
        1 in the paper.
    region_theta_deg, region_rho_px : float
        Half size of the box about a peak: a point belongs to the peak when a line through it does.
    separation_px : float
        Least distance between two peaks, about half the least distance of two stripes.
    least_votes_share : float
        A peak needs this many points for each column of its segment: where no stripe is sharp, the least blurred dirt would
        else be taken for one.
    segments : int
        Into how many stretches of columns the picture is cut; 1 in the paper.
    """

    theta_reach_deg: float = 45.0
    theta_step_deg: float = 1.0
    region_theta_deg: float = 1.5
    region_rho_px: float = 9.0
    separation_px: float = 30.0
    least_votes_share: float = 0.3
    segments: int = 4

    def __post_init__(self) -> None:
        require(0 < self.theta_reach_deg <= 80, f"theta reaches to {self.theta_reach_deg}°", "above 0, at most 80")
        require(0 < self.theta_step_deg <= 10, f"theta steps of {self.theta_step_deg}°", "above 0, at most 10")
        require(1 <= self.segments <= 64, f"{self.segments} segments", "1 … 64")

    @property
    def theta_rad(self) -> FloatArray:
        """The angles tried."""
        steps = round(self.theta_reach_deg / self.theta_step_deg)
        return np.asarray(np.deg2rad(np.arange(-steps, steps + 1) * self.theta_step_deg), np.float64)

    def find(
        self,
        rows: IntArray,
        columns: IntArray,
        shape: tuple[int, ...],
        *,
        stripes: Sequence[Stripe],
        stripe_model: StripeModel,
        bench: Bench,
    ) -> list[Segment]:
        """Find the lines of the stripes in every segment.

        Parameters
        ----------
        rows, columns : int arrays, shape (point,)
            In-focus points.
        shape : (int, int)
            Rows and columns of the picture.
        stripes : sequence of Stripe
            What the bench shows, by rising row.
        stripe_model : StripeModel
        bench : Bench

        Returns
        -------
        list of Segment
            From left to right.
        """
        borders = [int(border) for border in np.linspace(0, shape[1], self.segments + 1)]
        glass = bench.cover_glass
        accumulators, candidates, assignments = [], [], []
        for start, stop in pairwise(borders):
            votes = self._votes(rows, columns, start, stop, row_origin=(shape[0] - 1) / 2)
            lines = peaks(
                votes,
                count=CANDIDATE_LINES,
                separation_px=self.separation_px,
                least_votes=self.least_votes_share * float(stop - start),
            )
            found = stripe_model.assignments(
                lines,
                stripes,
                edge_row=bench.glass_edge_row if glass else None,
                glass_low=glass is not None and glass.side == "low",
                walls_part=bench.disc.cut != "lateral",
            )
            accumulators.append(votes)
            candidates.append(lines)
            assignments.append(found)
        path = stripe_model.path(assignments, [float(border) for border in borders[1:-1]], stripes)
        parts = zip(borders[:-1], borders[1:], accumulators, candidates, path, strict=True)
        return [Segment(start, stop, votes, lines, list(way.lines)) for start, stop, votes, lines, way in parts]

    def _votes(self, rows: IntArray, columns: IntArray, start: int, stop: int, *, row_origin: float) -> Accumulator:
        inside = (columns >= start) & (columns < stop)
        middle = (start + stop - 1) / 2
        return accumulate(
            rows[inside], columns[inside], row_origin=row_origin, column_origin=middle, theta_rad=self.theta_rad
        )

    def label(self, rows: IntArray, columns: IntArray, segments: Sequence[Segment]) -> IntArray:
        """Give each point to the one stripe whose region it lies in.

        Returns
        -------
        int array, shape (point,)
            Number of the stripe; −1 for a point in no region, −2 for a disputed one.
        """
        label = np.full(rows.size, -1, np.int64)
        for part in segments:
            inside = np.flatnonzero((columns >= part.start) & (columns < part.stop))
            numbers = [i for i, line in enumerate(part.lines) if line is not None]
            local = segment(
                rows[inside],
                columns[inside],
                [line for line in part.lines if line is not None],
                theta_reach_rad=rad(self.region_theta_deg),
                rho_reach_px=self.region_rho_px,
            )
            label[inside] = np.array([*numbers, -2, -1])[local] if numbers else -1
        return label


def line_rows(segments: Sequence[Segment], stripe: int) -> FloatArray:
    """Return the row of a stripe's Hough lines in every column, shape (column,); NaN where none was found."""
    rows = np.full(segments[-1].stop, np.nan)
    for part in segments:
        line = part.lines[stripe]
        if line is not None:
            rows[part.start : part.stop] = line.row_at(np.arange(part.start, part.stop))
    return rows


def line_slopes(segments: Sequence[Segment], stripes: Sequence[int], stations: FloatArray) -> FloatArray:
    """Return the mean slope of the Hough lines of some stripes at each station; NaN where none was found."""
    slope = np.full(stations.size, np.nan)
    for part in segments:
        found = [line.slope for i in stripes if (line := part.lines[i]) is not None]
        if found:
            slope[(stations >= part.start) & (stations < part.stop)] = np.mean(found)
    return slope
