"""Which line is which stripe.

A dual-focal objective shows three sharp stripes: both walls at the depth that is sharp through the glass, and one of them
once more, nearer to the land, beyond the edge of the glass. The lines that the Hough transform finds are given these roles
by what the bench knows: the distance between the two stripes of one wall (the focus shift over the slope of the wall: the
surest), the distance between the walls (only roughly, for a vertical cut moves them apart), and on which side of the
glass edge each must lie.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.conventions import INNER, OUTER
from gramoscope.errors import require
from gramoscope.pickup.hough import Line

WRONG_SIDE = 0.25
"""What a line on the wrong side of the glass edge counts: the edge is known only roughly."""
KEPT_ASSIGNMENTS = 24
"""So many ways to read a segment are weighed against those of its neighbours."""


def kept_stripes(stripes: Sequence[Stripe]) -> tuple[int, ...]:
    """Return the numbers of the stripes that the paper keeps: those of the wall that shows two; all when no wall does."""
    for wall in (INNER, OUTER):
        mine = tuple(i for i, stripe in enumerate(stripes) if stripe.wall == wall)
        if len(mine) == 2:
            return mine
    return tuple(range(len(stripes)))


def walls_read(bench: Bench) -> tuple[str, ...]:
    """Return the names of the walls that are read from a bench's pictures."""
    stripes = bench.stripes()
    walls = {stripes[i].wall for i in kept_stripes(stripes)}
    return tuple(name for wall, name in ((INNER, "inner"), (OUTER, "outer")) if wall in walls)


@dataclass(frozen=True)
class Assignment:
    """One way in which the lines of a segment can be the expected stripes.

    Attributes
    ----------
    score : float
        Votes of the lines, less where they fit badly.
    lines : tuple of Line or None
        One for each stripe.
    """

    score: float
    lines: tuple[Line | None, ...]

    def middle_at(self, column: float, stripes: Sequence[Stripe]) -> float:
        """Return how many rows the groove lies off the expected place at a column; NaN without lines."""
        found = [(line, stripe) for line, stripe in zip(self.lines, stripes, strict=True) if line is not None]
        if not found:
            return float("nan")
        off = [float(line.row_at(column)) - stripe.row for line, stripe in found]
        return float(np.average(off, weights=[line.votes for line, _ in found]))


@dataclass(frozen=True)
class StripeModel:
    """How lines are given their roles.

    Parameters
    ----------
    same_wall_tolerance : float
        How far the distance of two stripes of one wall may be off, as a share of the expected distance.
    other_wall_tolerance : float
        The same for stripes of opposite walls.
    same_wall_slope_tolerance, other_wall_slope_tolerance : float
        Largest difference between the slopes of two stripes.
    edge_margin_px : float
        How far beyond the glass edge a stripe is still believed.
    lone_stripe : float
        What the votes of a line count that is the only stripe of its segment.
    largest_jump_px : float
        How far the middle of the groove may seem to jump between segments.
    """

    same_wall_tolerance: float = 0.15
    other_wall_tolerance: float = 0.5
    same_wall_slope_tolerance: float = 0.09
    other_wall_slope_tolerance: float = 0.25
    edge_margin_px: float = 40.0
    lone_stripe: float = 0.5
    largest_jump_px: float = 20.0

    def __post_init__(self) -> None:
        for name in ("same_wall_tolerance", "other_wall_tolerance", "largest_jump_px"):
            require(getattr(self, name) > 0, f"{name} is {getattr(self, name)}", "above 0")
        for name in ("same_wall_slope_tolerance", "other_wall_slope_tolerance", "edge_margin_px", "lone_stripe"):
            require(getattr(self, name) >= 0, f"{name} is {getattr(self, name)}", "zero or more")

    def assignments(
        self,
        lines: Sequence[Line],
        stripes: Sequence[Stripe],
        *,
        edge_row: float | None,
        glass_low: bool,
        walls_part: bool = False,
    ) -> list[Assignment]:
        """Return the ways in which the lines of one segment can be the expected stripes.

        Parameters
        ----------
        lines : sequence of Line
            Candidates from one segment.
        stripes : sequence of Stripe
            By rising row.
        edge_row : float or None
            Row of the glass edge, None without a glass.
        glass_low : bool
            Whether the glass covers the rows below its edge.
        walls_part : bool
            Whether the cut moves the walls apart (vertical, stereo): then the stripes of opposite walls may have any
            distance and any slopes, as long as their order holds.

        Returns
        -------
        list of Assignment
            Best first, at most `KEPT_ASSIGNMENTS`.
        """
        ordered = sorted(lines, key=lambda line: line.row_at(line.column_origin))
        found = []
        for chosen, roles in _combinations(ordered, len(stripes)):
            score = self._score(chosen, [stripes[role] for role in roles], edge_row, glass_low, walls_part)
            if score > 0:
                places: list[Line | None] = [None] * len(stripes)
                for line, role in zip(chosen, roles, strict=True):
                    places[role] = line
                found.append(Assignment(score, tuple(places)))
        return sorted(found, key=lambda assignment: -assignment.score)[:KEPT_ASSIGNMENTS]

    def path(
        self, segments: Sequence[Sequence[Assignment]], borders: Sequence[float], stripes: Sequence[Stripe]
    ) -> list[Assignment]:
        """Choose one assignment for each segment so that the groove runs on from one to the next.

        Parameters
        ----------
        segments : sequence of (sequence of Assignment)
        borders : sequence of float
            Column of the border between each two segments.
        stripes : sequence of Stripe

        Returns
        -------
        list of Assignment
            The sequence with the highest total score in which the middle of the groove nowhere jumps by more than
            `largest_jump_px` (Viterbi's algorithm); a segment where nothing fits gets an assignment without lines.
        """
        nothing = Assignment(0.0, (None,) * len(stripes))
        choices = [[*found, nothing] for found in segments]
        total = [assignment.score for assignment in choices[0]]
        back: list[list[int]] = []
        for border, before, after in zip(borders, choices[:-1], choices[1:], strict=True):
            best = self._best_before(total, before, after, border, stripes)
            total = [total[i] + to.score for i, to in zip(best, after, strict=True)]
            back.append(best)
        i = int(np.argmax(total))
        chosen = [choices[-1][i]]
        for best, before in zip(reversed(back), reversed(choices[:-1]), strict=True):
            i = best[i]
            chosen.append(before[i])
        return chosen[::-1]

    def _best_before(
        self,
        total: Sequence[float],
        before: Sequence[Assignment],
        after: Sequence[Assignment],
        column: float,
        stripes: Sequence[Stripe],
    ) -> list[int]:
        """For each assignment after a border, the best one before it from which the groove can run on."""
        here, there = (np.array([one.middle_at(column, stripes) for one in side]) for side in (before, after))
        # a segment without lines runs on from anything: its middle, and so the jump, is NaN
        broken = np.abs(here[:, None] - there[None, :]) > self.largest_jump_px
        scores = np.where(broken, -1.0, np.asarray(total)[:, None])
        return [int(i) for i in scores.argmax(axis=0)]

    def _score(
        self,
        lines: Sequence[Line],
        stripes: Sequence[Stripe],
        edge_row: float | None,
        glass_low: bool,
        walls_part: bool,
    ) -> float:
        rows = [float(line.row_at(line.column_origin)) for line in lines]
        fit = self.lone_stripe if len(lines) == 1 else 1.0
        for i, j in combinations(range(len(lines)), 2):
            if walls_part and stripes[i].wall != stripes[j].wall:
                continue
            fit *= self._pair_fit(rows[j] - rows[i], lines[i], lines[j], stripes[i], stripes[j])
        votes = 0.0
        for row, line, stripe in zip(rows, lines, stripes, strict=True):
            votes += line.votes * self._side_fit(row, stripe, edge_row, glass_low)
        return fit * votes

    def _pair_fit(self, distance_px: float, a: Line, b: Line, one: Stripe, other: Stripe) -> float:
        expected = other.row - one.row
        same_wall = one.wall == other.wall
        tolerance = self.same_wall_tolerance if same_wall else self.other_wall_tolerance
        off = abs(distance_px / expected - 1) / tolerance
        slope_tolerance = self.same_wall_slope_tolerance if same_wall else self.other_wall_slope_tolerance
        if off > 1 or abs(a.slope - b.slope) > slope_tolerance:
            return 0.0
        return float(np.exp(-0.5 * off**2))

    def _side_fit(self, row: float, stripe: Stripe, edge_row: float | None, glass_low: bool) -> float:
        if edge_row is None:
            return 1.0
        under_glass_px = (edge_row - row) if glass_low else (row - edge_row)
        beyond = -under_glass_px if stripe.through_glass else under_glass_px
        return WRONG_SIDE if beyond > self.edge_margin_px else 1.0


def _combinations(lines: Sequence[Line], roles: int) -> Iterator[tuple[tuple[Line, ...], tuple[int, ...]]]:
    """All ways to give roles to lines, both in rising order."""
    for size in range(1, roles + 1):
        for chosen in combinations(lines, size):
            for places in combinations(range(roles), size):
                yield chosen, places
