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


PITCH_PX = 140.0
EDGES = [_course(OUTER, 50, 3.7), _course(INNER, 140, 3.2), _course(OUTER, 190, 3.5), _course(INNER, 280, 2.8)]
CHANCE = [_course(INNER, 90, 1.7), _course(OUTER, 110, 1.6), _course(OUTER, 230, 1.4)]


def test_edges_end_at_the_widest_gap() -> None:
    assert 1.7 < least_evidence([*EDGES, *CHANCE]) < 2.8
    assert _rows(choose_grooves([*EDGES, *CHANCE], pitch_px=PITCH_PX)) == [(50, 140), (190, 280)]


def test_nothing_stands_out_of_chance() -> None:
    assert choose_grooves(CHANCE, pitch_px=PITCH_PX) == []
    assert choose_grooves([], pitch_px=PITCH_PX) == []


def test_grooves_at_the_border_have_one_edge() -> None:
    assert _rows(choose_grooves([*EDGES[1:3], *CHANCE[:1]], pitch_px=PITCH_PX)) == [(None, 140), (190, None)]


def test_walls_take_turns() -> None:
    double = _course(OUTER, 60, 3.0)
    assert _rows(choose_grooves([*EDGES, double, *CHANCE], pitch_px=PITCH_PX)) == [(50, 140), (190, 280)]


def test_a_groove_torn_in_two_is_mended() -> None:
    bottom = [_course(INNER, 230, 2.7), _course(OUTER, 240, 2.7)]
    third = [_course(OUTER, 330, 3.3), _course(INNER, 420, 3.1)]
    assert _rows(choose_grooves([*EDGES, *bottom, *third, *CHANCE[:2]], pitch_px=PITCH_PX)) == [
        (50, 140),
        (190, 280),
        (330, 420),
    ]


def _along_bottoms(first: int, second: int) -> list[Course]:
    return [_course(wall, row + 140 * n, 3.6) for n in range(4) for wall, row in ((INNER, first), (OUTER, second))]


def test_bottoms_that_look_like_land_part_no_groove() -> None:
    edges = [_course(wall, row + 140 * n, 3.4) for n in range(4) for wall, row in ((OUTER, 50), (INNER, 140))]
    whole = [(50 + 140 * n, 140 + 140 * n) for n in range(4)]
    for bottoms in (_along_bottoms(90, 100), _along_bottoms(90, 100)[::2], _along_bottoms(90, 100)[1::2]):
        assert _rows(choose_grooves([*edges, *bottoms, *CHANCE[1:2]], pitch_px=PITCH_PX)) == whole
    # without a pitch that fits, edges take turns as they come
    assert _rows(choose_grooves([*edges, *CHANCE[1:2]], pitch_px=900.0)) == whole


def test_of_lone_lines_the_wider_spaces_are_grooves() -> None:
    lines = [_course(OUTER, row, 3.0) for row in (140, 50, 280, 190)]
    assert _rows(choose_grooves([*lines, *CHANCE], pitch_px=PITCH_PX, lines=True)) == [(50, 140), (190, 280)]
    assert _rows(choose_grooves([*lines[:1], *lines[2:], *CHANCE], pitch_px=PITCH_PX, lines=True)) == [
        (None, 140),
        (190, 280),
    ]
