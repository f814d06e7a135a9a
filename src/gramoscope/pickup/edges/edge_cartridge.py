"""The cartridge for plain photographs: finds every groove of a picture and the place of its edges, column by column.

First coarsely: how far apart grooves are (`groove_pitch`), what speaks for an edge at each place (`step_evidence`), the
paths that collect most of it (`courses`) and which of them are the edges of grooves (`groove_choice`). Then each edge on
its own, to a fraction of a pixel (`sharpening`), and the line along the bottom where there is one (`bottom_line`). Where
grooves are hundreds of pixels apart pixels are binned first (`binning`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gramoscope.conventions import INNER, OUTER
from gramoscope.errors import require
from gramoscope.pickup.edges.appearance import Appearance
from gramoscope.pickup.edges.binning import binned_picture, binning_factor, unbinned
from gramoscope.pickup.edges.bottom_line import bottom_line
from gramoscope.pickup.edges.courses import Course, find_courses
from gramoscope.pickup.edges.groove_choice import CoarseGroove, choose_grooves
from gramoscope.pickup.edges.groove_pitch import groove_pitches_px
from gramoscope.pickup.edges.halo import Halo, learn_halo
from gramoscope.pickup.edges.sharpening import Reach, SharpEdge, Sharpening
from gramoscope.pickup.edges.step_evidence import block_means, burnt_level, step_evidence
from gramoscope.quality import NOT_MEASURED, Quality, no_flags
from gramoscope.signal_path import GrooveEdges, StillPicture

LEAST_ROWS, LEAST_COLUMNS = 16, 16
BLOCK_SHARE, CORRIDOR_SHARE, MARGIN_SHARE = 1 / 40, 0.06, 0.4
"""Of the pitch: a block of columns, the corridor that an edge has to itself, and how far courses may leave the picture."""
EDGES_A_PITCH, SPARE_COURSES = 4, 8
"""Courses that are looked for: twice as many as there are edges, and some."""
HALF_BAND_SHARE, HALF_BAND_PX = 1 / 16, (6, 14)
"""Rows on each side of an edge that are looked at, as a share of the pitch, and their limits."""
CROWDED_PX, CROWDED_HALF_BAND_PX = 14.0, 5
"""Where a neighbouring edge is nearer than this it shows in those rows, or its blur does; then fewer are looked at."""
WIDE = 2
"""So many times the rows are looked at to see whether an edge is where it was found, as far as no neighbour is there."""


@dataclass(frozen=True)
class EdgeCartridge:
    """Reads the edges of grooves in plain photographs.

    Parameters
    ----------
    appearance : Appearance
        What edges look like.
    steepest : float
        Largest slope of an edge, rows a column.
    burnt_share : float
        A pixel from this share of full scale on is burnt: dust that shines, or writing.
    least_seen : float
        An edge of which less than this share of the columns was measured is left out.
    sharpening : Sharpening
        How places are found to a fraction of a pixel.
    """

    appearance: Appearance = Appearance.DARK_GROOVES
    steepest: float = 1.0
    burnt_share: float = 0.98
    least_seen: float = 0.2
    sharpening: Sharpening = field(default_factory=Sharpening)

    def __post_init__(self) -> None:
        require(0 < self.steepest <= 4, f"a steepest slope of {self.steepest}", "above 0, at most 4 rows a column")
        require(0 < self.burnt_share <= 2, f"a burnt share of {self.burnt_share}", "above 0; above 1 for nothing burnt")
        require(0 < self.least_seen <= 1, f"a least seen share of {self.least_seen}", "above 0, at most 1")

    def find(self, picture: StillPicture) -> tuple[GrooveEdges, ...]:
        """Return the edges of every groove in a picture.

        Parameters
        ----------
        picture : StillPicture
            Grooves run along its columns.

        Returns
        -------
        tuple of GrooveEdges
            By growing row; empty where no edge stands out from texture and noise. A groove that the border of the
            picture cuts off has NaN for the wall that is not in it, flagged `NO_STRIPE`; and so has a wall that is hidden
            in nearly all columns.
        """
        rows, columns = picture.image.shape
        if rows < LEAST_ROWS or columns < LEAST_COLUMNS or not picture.seen.any():
            return ()
        burnt = burnt_level(picture, self.burnt_share)
        grooves, pitch_px = self.coarse(picture, burnt)
        factor = binning_factor(pitch_px, columns)
        if factor > 1:
            return tuple(
                unbinned(edges, factor, columns) for edges in self.find(binned_picture(picture, factor, burnt))
            )
        low, high = HALF_BAND_PX
        half_px = int(np.clip(round(HALF_BAND_SHARE * pitch_px), low, high))
        halo = learn_halo(picture, burnt)
        all_courses = [edge for groove in grooves for edge in (groove.outer, groove.inner) if edge is not None]
        found = list[GrooveEdges]()
        for groove in grooves:
            sharp = self._sharpened(picture, groove, half_px, burnt, halo, all_courses)
            if any(edge is not None for edge in sharp):
                edges = _groove_edges(len(found), sharp, columns)
                found.append(self._with_bottom(edges, picture, half_px, burnt))
        return tuple(found)

    def _with_bottom(self, edges: GrooveEdges, picture: StillPicture, half_px: int, burnt: int) -> GrooveEdges:
        row_px, sigma_px = bottom_line(
            picture, edges.row_px, sharpening=self.sharpening, half_px=half_px, burnt=burnt, least_seen=self.least_seen
        )
        return replace(edges, bottom_row_px=row_px, bottom_row_sigma_px=sigma_px)

    def coarse(self, picture: StillPicture, burnt: int) -> tuple[list[CoarseGroove], float]:
        """Return the coarse courses of the edges of every groove, a place a column, and the pitch in rows."""
        pitches = groove_pitches_px(*block_means(picture, burnt, max(1, picture.image.shape[1] // 500)))
        tried = [(self._coarse(picture, burnt, pitch_px), pitch_px) for pitch_px in pitches]
        grooves, pitch_px = max(tried, key=lambda found: _edge_count(found[0]), default=([], 0.0))
        columns = picture.image.shape[1]
        return [
            CoarseGroove(*(_by_column(course, columns) for course in (groove.outer, groove.inner)))
            for groove in grooves
        ], pitch_px

    def _coarse(self, picture: StillPicture, burnt: int, pitch_px: float) -> list[CoarseGroove]:
        """The coarse courses of grooves about so far apart."""
        rows, columns = picture.image.shape
        block_px = int(np.clip(BLOCK_SHARE * pitch_px, 1, max(columns // 32, 1)))
        evidence = step_evidence(picture, self.appearance, pitch_px=pitch_px, burnt=burnt, block_px=block_px)
        courses = find_courses(
            evidence,
            steepest=self.steepest,
            corridor_px=max(2, round(CORRIDOR_SHARE * pitch_px)),
            margin_px=round(MARGIN_SHARE * pitch_px),
            most=int(EDGES_A_PITCH * rows / pitch_px) + SPARE_COURSES,
        )
        return choose_grooves(courses, pitch_px=pitch_px, lines=self.appearance is Appearance.BRIGHT_LINES)

    def _sharpened(
        self,
        picture: StillPicture,
        groove: CoarseGroove,
        half_px: int,
        burnt: int,
        halo: Halo,
        all_courses: list[Course],
    ) -> tuple[SharpEdge | None, SharpEdge | None]:
        """The edges of one groove, `INNER` first."""

        def sharp(course: Course | None) -> SharpEdge | None:
            if course is None:
                return None
            line = self.appearance is Appearance.BRIGHT_LINES
            reach = _reach(course, all_courses, half_px)
            edge = self.sharpening.sharpen(
                picture, course.row, wall=course.wall, reach=reach, burnt=burnt, halo=halo, line=line
            )
            if edge is None or np.mean((edge.flags & np.uint16(NOT_MEASURED)) == 0) < self.least_seen:
                return None
            return edge

        return sharp(groove.inner), sharp(groove.outer)


def _reach(course: Course, courses: list[Course], half_px: int) -> Reach:
    """Which rows beside a course are looked at, by the nearest of the others: that in the median of its columns."""
    others = (float(np.median(np.abs(course.row - other.row))) for other in courses if other is not course)
    nearest_px = min(others, default=np.inf)
    if nearest_px < CROWDED_PX:
        return Reach(min(half_px, CROWDED_HALF_BAND_PX), crowded=True)
    return Reach(half_px, int(min(WIDE * half_px, nearest_px - half_px)))


def _edge_count(grooves: list[CoarseGroove]) -> int:
    return sum(edge is not None for groove in grooves for edge in (groove.outer, groove.inner))


def _by_column(course: Course | None, columns: int) -> Course | None:
    """A course with a place for each column, from one with a place for each block."""
    if course is None:
        return None
    block_px = columns // course.row.size
    middle = (np.arange(course.row.size) + 0.5) * block_px - 0.5
    return Course(course.wall, np.interp(np.arange(columns), middle, course.row), course.evidence)


def _groove_edges(number: int, sharp: tuple[SharpEdge | None, SharpEdge | None], columns: int) -> GrooveEdges:
    row, sigma = np.full((2, columns), np.nan), np.full((2, columns), np.nan)
    flags = no_flags(2, columns) | np.uint16(Quality.NO_STRIPE | Quality.INTERPOLATED)
    shared = 1.0
    for wall, edge in zip((INNER, OUTER), sharp, strict=True):
        if edge is not None:
            row[wall], sigma[wall], flags[wall] = edge.row_px, edge.row_sigma_px, edge.flags
            shared = max(shared, edge.correlation_samples)
    nothing = np.full(columns, np.nan)
    return GrooveEdges(number, row, sigma, shared, flags, nothing, nothing)
