"""Coarse courses of edges: the paths through the evidence that collect most of it, one after the other.

A path runs from the first block of columns to the last. What it collects, less what its slope costs, is greatest for the
path that dynamic programming finds (Viterbi). Then a corridor about it is closed, and the next best path is looked for; so
paths never cross. They may leave the picture, through a margin of rows about which nothing is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, Float32Array, FloatArray
from gramoscope.pickup.edges.step_evidence import UNKNOWN, StepEvidence

SLOPE_COST = 0.3
"""Evidence that a slope of one costs in each column."""
CLOSED = -50.0
"""Evidence in a corridor that is taken."""
WORTHLESS = 0.5
"""Looking ends with the first path that collects less than this share of the best one's evidence."""


@dataclass(frozen=True, eq=False)
class Course:
    """A coarse path along an edge.

    Attributes
    ----------
    wall : int
        `OUTER` where the land lies at smaller rows, `INNER` where it lies at larger ones.
    row : float64 array, shape (block,)
        Below 0 or beyond the last row where it has left the picture.
    evidence : float
        Mean of what it collected in a block.
    """

    wall: int
    row: FloatArray
    evidence: float


@numba.njit(cache=True, nogil=True)
def best_path(evidence, reach, cost, back):  # type: ignore[no-untyped-def]
    """Return the best path through evidence, [block, row], and its total; `back` is room, int8 [block, row]."""
    blocks, rows = evidence.shape
    before, now = evidence[0].copy(), np.empty(rows, np.float32)
    for b in range(1, blocks):
        for r in range(rows):
            now[r] = before[r]
            back[b, r] = 0
        for d in range(-reach, reach + 1):
            toll = np.float32(cost * d * d)
            for r in range(max(0, -d), min(rows, rows - d)):
                value = before[r + d] - toll
                if value > now[r]:
                    now[r] = value
                    back[b, r] = d
        for r in range(rows):
            before[r] = now[r] + evidence[b, r]
    last = np.argmax(before)
    path = np.empty(blocks, np.int64)
    path[blocks - 1] = last
    for b in range(blocks - 1, 0, -1):
        path[b - 1] = path[b] + back[b, path[b]]
    return path, before[last]


@numba.njit(cache=True, nogil=True)
def _close(evidence, path, half, closed):  # type: ignore[no-untyped-def]
    for b in range(path.size):
        for r in range(max(0, path[b] - half), min(evidence.shape[1], path[b] + half + 1)):
            evidence[b, r] = closed


def find_courses(
    evidence: StepEvidence, *, steepest: float, corridor_px: int, margin_px: int, most: int
) -> list[Course]:
    """Return the best paths through the evidence, best first.

    Parameters
    ----------
    evidence : StepEvidence
    steepest : float
        Largest slope of a path, rows a column.
    corridor_px : int
        No path comes nearer to another than this.
    margin_px : int
        So far paths may leave the picture.
    most : int
        So many paths at most.
    """
    maps = {wall: _widened(found, margin_px) for wall, found in ((OUTER, evidence.outer), (INNER, evidence.inner))}
    reach = max(1, int(np.ceil(steepest * evidence.block_px)))
    cost = SLOPE_COST / evidence.block_px
    back = np.zeros(maps[OUTER].shape, np.int8)
    courses: list[Course] = []
    while len(courses) < most:
        tried = []
        for wall, found in maps.items():
            path, total = best_path(found, reach, cost, back)
            tried.append(Course(wall, path, float(total) / path.size))
        best = max(tried, key=lambda course: course.evidence)
        courses.append(Course(best.wall, best.row - float(margin_px), best.evidence))
        if best.evidence < WORTHLESS * courses[0].evidence:
            break
        for found in maps.values():
            _close(found, best.row, corridor_px, np.float32(CLOSED))
    return courses


def _widened(evidence: Float32Array, margin_px: int) -> Float32Array:
    return np.pad(evidence, ((0, 0), (margin_px, margin_px)), constant_values=UNKNOWN)
