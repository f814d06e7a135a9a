"""Which of the coarse courses are edges, and which two of them are a groove.

Sorted by what they have collected, courses along edges come first, and after a gap those that wander through texture and
noise; the widest gap is where edges end. Going down the rows, edges that close a land and edges that open one take turns, so
of all choices of courses that do so the one is taken that collects most above the gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.edges.courses import Course

EDGES_FROM = 0.6
"""A course that collects less than this share of what the best one does is no edge, whatever the gaps."""
CLEAR = 3.0
"""Courses that all collect more are all edges: chance collects half of it at the most."""
LEAST_GAP = 0.1
"""A narrower gap, in standard deviations of the evidence, tells nothing from nothing."""


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
    gap = np.where(evidence[:-1] >= EDGES_FROM * evidence[0], -np.diff(evidence), 0.0)
    widest = int(np.argmax(gap))
    if gap[widest] < LEAST_GAP:
        # a clean picture: nothing wanders, for there is nothing else to collect
        return EDGES_FROM * float(evidence[0]) if evidence[-1] >= CLEAR else float("inf")
    return float(0.5 * (evidence[widest] + evidence[widest + 1]))


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


def choose_grooves(courses: Sequence[Course]) -> list[CoarseGroove]:
    """Return the grooves among coarse courses, by growing row; none where no course stands out."""
    least = least_evidence(courses)
    return pair(taking_turns(courses, least)) if np.isfinite(least) else []
