"""Which courses are edges, and which edges make a groove."""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.edges.courses import Course
from gramoscope.pickup.edges.groove_choice import CoarseGroove, choose_grooves, least_evidence


def _course(wall: int, row: float, evidence: float) -> Course:
    return Course(wall, np.full(20, row), evidence)


def _rows(grooves: list[CoarseGroove]) -> list[tuple[float | None, float | None]]:
    return [tuple(None if edge is None else float(edge.row[0]) for edge in (g.outer, g.inner)) for g in grooves]  # type: ignore[misc]


EDGES = [_course(OUTER, 50, 3.7), _course(INNER, 140, 3.2), _course(OUTER, 190, 3.5), _course(INNER, 280, 2.8)]
CHANCE = [_course(INNER, 90, 1.7), _course(OUTER, 110, 1.6), _course(OUTER, 230, 1.4)]


def test_edges_end_at_the_widest_gap() -> None:
    assert 1.7 < least_evidence([*EDGES, *CHANCE]) < 2.8
    assert _rows(choose_grooves([*EDGES, *CHANCE])) == [(50, 140), (190, 280)]


def test_nothing_stands_out_of_chance() -> None:
    assert choose_grooves(CHANCE) == []
    assert choose_grooves([]) == []


def test_grooves_at_the_border_have_one_edge() -> None:
    assert _rows(choose_grooves([*EDGES[1:3], *CHANCE[:1]])) == [(None, 140), (190, None)]


def test_walls_take_turns() -> None:
    double = _course(OUTER, 60, 3.0)
    assert _rows(choose_grooves([*EDGES, double, *CHANCE])) == [(50, 140), (190, 280)]


def test_a_groove_torn_in_two_is_mended() -> None:
    bottom = [_course(INNER, 230, 2.7), _course(OUTER, 240, 2.7)]
    third = [_course(OUTER, 330, 3.3), _course(INNER, 420, 3.1)]
    assert _rows(choose_grooves([*EDGES, *bottom, *third, *CHANCE[:2]])) == [(50, 140), (190, 280), (330, 420)]


def test_of_lone_lines_the_wider_spaces_are_grooves() -> None:
    lines = [_course(OUTER, row, 3.0) for row in (140, 50, 280, 190)]
    assert _rows(choose_grooves([*lines, *CHANCE], lines=True)) == [(50, 140), (190, 280)]
    assert _rows(choose_grooves([*lines[:1], *lines[2:], *CHANCE], lines=True)) == [(None, 140), (190, 280)]
