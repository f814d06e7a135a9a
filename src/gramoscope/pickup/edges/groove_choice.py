"""Which of the coarse courses are edges, and which two of them are a groove.

Sorted by what they have collected, courses along edges come first, and after a gap those that wander through texture and
noise; the widest gap is where edges end. Going down the rows, edges that close a land and edges that open one take turns, so
of all choices of courses that do so the one is taken that collects most above the gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.edges.courses import Course

CHANCE, CERTAINTY = 2.0, 2.8
"""Evidence, in standard deviations, below which all is chance, and above which all is edges."""
LEAST_GAP = 0.1
"""A narrower gap, in standard deviations of the evidence, tells nothing from nothing."""
HALF_GROOVE, WHOLE_GROOVE = 0.7, 0.25
"""Two neighbours narrower than this share of the usual width, and as wide together but for this share, are one groove."""

WIDTH_SHARES = (0.2, 0.8)
"""Grooves are as wide as this share of the pitch."""
MOST_UNEVEN = 1.4
"""No groove, and no land, is wider or narrower than usual by more than this factor."""
NEARLY_MOST = 0.85
"""Chains of edges that collect this share of what the best one does are as good."""
FEWEST_EVEN, MOST_OF_SPAN = 5, 0.8
"""Edges evenly spaced are so many at least, and go over this share of the rows over which there are edges at all."""


@dataclass(frozen=True, eq=False)
class CoarseGroove:
    """The courses of both edges of a groove; None for one that is out of the picture."""

    outer: Course | None
    inner: Course | None


def least_evidence(courses: Sequence[Course]) -> float:
    """Return the evidence between edges and chance: the middle of the widest gap; infinite where there is none."""
    evidence = np.sort([course.evidence for course in courses])[::-1]
    if evidence.size < 2:
        return float("inf")
    middle = 0.5 * (evidence[:-1] + evidence[1:])
    gap = np.where((evidence[:-1] >= CHANCE) & (evidence[1:] <= CERTAINTY), -np.diff(evidence), 0.0)
    widest = int(np.argmax(gap))
    if gap[widest] < LEAST_GAP:
        return float("inf")
    return float(middle[widest])


def taking_turns(courses: Sequence[Course], least: float) -> list[Course]:
    """Return the courses, by growing row, that take turns between the walls and collect most above the least.

    Parameters
    ----------
    courses : sequence of Course
    least : float
        What a course must collect to be worth taking.
    """
    ordered = sorted(courses, key=lambda course: float(np.median(course.row)))
    best: dict[int, tuple[float, list[Course]]] = {OUTER: (0.0, []), INNER: (0.0, [])}
    for course in ordered:
        before, chosen = best[INNER if course.wall == OUTER else OUTER]
        value = before + course.evidence - least
        if value > best[course.wall][0]:
            best[course.wall] = (value, [*chosen, course])
    return max(best.values(), key=lambda chain: chain[0])[1]


def evenly_spaced(courses: Sequence[Course], least: float, pitch_px: float) -> list[Course]:
    """Return the courses that take turns between the walls, at distances that repeat, and collect most above the least.

    A line along the bottom is an edge to either side, and may collect as much as the edges at the land do. But grooves lie
    a pitch apart and are equally wide; and if halves of grooves do as well as whole ones, the whole ones are meant.

    Parameters
    ----------
    courses : sequence of Course
    least : float
        What a course must collect to be worth taking.
    pitch_px : float
        From groove to groove.
    """
    ordered = sorted((one for one in courses if one.evidence > least), key=lambda course: float(np.median(course.row)))
    place = np.array([float(np.median(course.row)) for course in ordered])
    widths = {
        float(place[j] - place[i])
        for i, one in enumerate(ordered)
        for j, other in enumerate(ordered[i + 1 :], i + 1)
        if one.wall == OUTER
        and other.wall == INNER
        and WIDTH_SHARES[0] < (place[j] - place[i]) / pitch_px < WIDTH_SHARES[1]
    }
    tried = [(width, *_chain(ordered, place, least, width, pitch_px - width)) for width in sorted(widths)]
    most = max((value for _, value, _ in tried), default=0.0)
    good = [(width, chain) for width, value, chain in tried if value > NEARLY_MOST * most]
    return max(good, key=lambda found: found[0])[1] if good else []


def _chain(
    ordered: Sequence[Course], place: FloatArray, least: float, width_px: float, land_px: float
) -> tuple[float, list[Course]]:
    """The best chain of edges whose grooves and lands are about so wide, and what it collects above the least."""
    best: list[tuple[float, list[Course]]] = []
    for number, course in enumerate(ordered):
        usual_px = width_px if course.wall == INNER else land_px
        before = [
            best[earlier]
            for earlier in range(number)
            if ordered[earlier].wall != course.wall
            and 1 / MOST_UNEVEN < (place[number] - place[earlier]) / usual_px < MOST_UNEVEN
        ]
        value, chain = max(before, key=lambda found: found[0], default=(0.0, []))
        best.append((value + course.evidence - least, [*chain, course]))
    return max(best, key=lambda found: found[0], default=(0.0, []))


def pair(edges: Sequence[Course]) -> list[CoarseGroove]:
    """Return the grooves that edges, taking turns by growing row, make: each an outer edge and the inner one after it.

    A groove at the border of the picture may have one edge only.
    """
    grooves = []
    waiting: Course | None = None
    for edge in edges:
        if edge.wall == OUTER:
            waiting = edge
        else:
            grooves.append(CoarseGroove(waiting, edge))
            waiting = None
    if waiting is not None:
        grooves.append(CoarseGroove(waiting, None))
    return grooves


def choose_grooves(courses: Sequence[Course], *, pitch_px: float, lines: bool = False) -> list[CoarseGroove]:
    """Return the grooves among coarse courses, by growing row; none where no course stands out.

    Parameters
    ----------
    courses : sequence of Course
    pitch_px : float
        From groove to groove, roughly.
    lines : bool
        Whether edges are lone lines, so that nothing but their distances tells land from groove.
    """
    least = least_evidence(courses)
    if not np.isfinite(least):
        return []
    if lines:
        return pair(by_distance([course for course in courses if course.evidence > least]))
    even, any_ = evenly_spaced(courses, least, pitch_px), taking_turns(courses, least)
    # a pitch that was not seen, or not right, leaves gaps
    return mended(pair(even if len(even) >= FEWEST_EVEN and _span(even) > MOST_OF_SPAN * _span(any_) else any_))


def _span(edges: Sequence[Course]) -> float:
    return float(np.median(edges[-1].row) - np.median(edges[0].row)) if edges else 0.0


def by_distance(edges: Sequence[Course]) -> list[Course]:
    """Return edges by growing row, with the walls that they are if grooves are wider than lands."""
    ordered = sorted(edges, key=lambda course: float(np.median(course.row)))
    apart = np.diff([float(np.median(course.row)) for course in ordered])
    first, second = (float(np.mean(apart[start::2])) if apart[start:].size else 0.0 for start in (0, 1))
    walls = (OUTER, INNER) if first >= second else (INNER, OUTER)
    return [replace(course, wall=walls[number % 2]) for number, course in enumerate(ordered)]


def mended(grooves: Sequence[CoarseGroove]) -> list[CoarseGroove]:
    """Return grooves, those that something bright along their bottom has torn in two mended."""
    widths = np.array([_width(groove) for groove in grooves])
    # torn ones are few, and narrower: what is usual lies above the middle
    usual = float(np.nanquantile(widths, 0.75)) if np.isfinite(widths).any() else np.nan
    whole: list[CoarseGroove] = []
    for groove in grooves:
        if whole:
            both = CoarseGroove(whole[-1].outer, groove.inner)
            halves = max(_width(whole[-1]), _width(groove)) < HALF_GROOVE * usual
            if halves and abs(_width(both) - usual) < WHOLE_GROOVE * usual:
                whole[-1] = both
                continue
        whole.append(groove)
    return whole


def _width(groove: CoarseGroove) -> float:
    """Rows from edge to edge; NaN for a groove with one edge."""
    if groove.outer is None or groove.inner is None:
        return float("nan")
    return float(np.median(groove.inner.row - groove.outer.row))
