"""Which line is which stripe."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.conventions import INNER, OUTER
from gramoscope.microscope.cover_glass import CoverGlass
from gramoscope.pickup.hough import Line
from gramoscope.pickup.stripes import (
    Assignment,
    StripeModel,
    kept_stripes,
    walls_read,
)
from gramoscope.simulation.scene import filming_bench

BENCH = filming_bench(height_px=512)
STRIPES = BENCH.stripes()
MODEL = StripeModel()
COLUMN = 160.0


def _line(row: float, *, votes: float = 300.0, theta_deg: float = 0.0, column: float = COLUMN) -> Line:
    return Line(np.deg2rad(theta_deg), (row - 255.5) * np.cos(np.deg2rad(theta_deg)), votes, 255.5, column)


def _best(lines: list[Line], stripes: tuple[Stripe, ...] = STRIPES, bench: Bench = BENCH) -> Assignment | None:
    glass = bench.cover_glass
    edge_row = bench.glass_edge_row if glass else None
    found = MODEL.assignments(lines, stripes, edge_row=edge_row, glass_low=glass is not None and glass.side == "low")
    return found[0] if found else None


def _mirrored(bench: Bench) -> Bench:
    """The glass on the other side of the groove."""
    glass = bench.cover_glass
    assert glass is not None
    edge_row = bench.sensor.height_px - 1 - bench.glass_edge_row
    return replace(bench, cover_glass=replace(glass, side="high", edge_row=edge_row))


def test_the_stripes_lie_where_walls_at_45_degrees_cross_the_two_sharp_planes() -> None:
    deep_m, shallow_m = 75e-6 - 20e-6 - 0.11e-3 * (1 - 1 / 1.515), 75e-6 - 20e-6
    for bench, lateral_m in (
        (BENCH, (-deep_m, deep_m, shallow_m)),
        (_mirrored(BENCH), (-shallow_m, -deep_m, deep_m)),
        (replace(BENCH, cover_glass=None), (-shallow_m, shallow_m)),
    ):
        rows = 255.5 + np.array(lateral_m) / bench.sensor.pixel_pitch_m
        np.testing.assert_allclose(bench.stripe_rows(), rows)


def test_two_stripes_lie_on_the_wall_that_the_glass_does_not_cover_whole() -> None:
    assert [stripe.wall for stripe in STRIPES] == [OUTER, INNER, INNER]
    assert [stripe.through_glass for stripe in STRIPES] == [True, True, False]
    assert kept_stripes(STRIPES) == (1, 2)
    assert walls_read(BENCH) == ("inner",)
    high = _mirrored(BENCH).stripes()
    assert [stripe.wall for stripe in high] == [OUTER, OUTER, INNER]
    assert kept_stripes(high) == (0, 1)
    assert walls_read(_mirrored(BENCH)) == ("outer",)


def test_without_a_glass_both_walls_are_kept() -> None:
    bench = replace(BENCH, cover_glass=None)
    assert kept_stripes(bench.stripes()) == (0, 1)
    assert walls_read(bench) == ("inner", "outer")


def test_three_lines_that_swing_together_are_the_three_stripes() -> None:
    lines = [_line(stripe.row + 17, theta_deg=-3, votes=v) for stripe, v in zip(STRIPES, (200, 400, 300), strict=True)]
    best = _best([lines[2], lines[0], lines[1]])
    assert best is not None
    assert list(best.lines) == lines
    assert best.middle_at(COLUMN, STRIPES) == pytest.approx(17, abs=0.5)


def test_an_outer_stripe_that_is_missing_is_missing() -> None:
    lines = [_line(STRIPES[1].row - 9), _line(STRIPES[2].row - 9)]
    best = _best(lines)
    assert best is not None
    assert list(best.lines) == [None, *lines]


def test_a_deep_stripe_hidden_beyond_the_glass_edge_is_missing() -> None:
    swing = BENCH.glass_edge_row - STRIPES[1].row + 8
    lines = [_line(STRIPES[0].row + swing), _line(STRIPES[2].row + swing)]
    best = _best(lines)
    assert best is not None
    assert list(best.lines) == [lines[0], None, lines[1]]


def test_a_false_line_from_damage_is_no_stripe() -> None:
    lines = [_line(stripe.row - 12) for stripe in STRIPES]
    best = _best([*lines, _line(STRIPES[1].row + 34, votes=250, theta_deg=31)])
    assert best is not None
    assert list(best.lines) == lines


def test_a_mirrored_glass_mirrors_the_roles() -> None:
    bench = _mirrored(BENCH)
    stripes = bench.stripes()
    lines = [_line(stripe.row + 6) for stripe in stripes]
    best = _best(lines, stripes, bench)
    assert best is not None
    assert list(best.lines) == lines
    # the same two lines are another pair here: the glass says which
    pair = _best(lines[:2], stripes, bench)
    assert pair is not None
    assert list(pair.lines) == [*lines[:2], None]


def test_lines_at_impossible_distances_do_not_stand_together() -> None:
    best = _best([_line(STRIPES[1].row), _line(STRIPES[1].row + 31)])
    assert best is not None
    assert sum(line is not None for line in best.lines) == 1
    assert _best([]) is None


def test_a_lone_stripe_is_what_it_was_in_the_segment_before() -> None:
    border = 320.0
    first = [_line(stripe.row + 4) for stripe in STRIPES]
    lone = _line(STRIPES[1].row + 5, column=480.0)
    ways = [
        MODEL.assignments(lines, STRIPES, edge_row=BENCH.glass_edge_row, glass_low=True) for lines in (first, [lone])
    ]
    assert len(ways[1]) == 3
    path = MODEL.path(ways, [border], STRIPES)
    assert list(path[0].lines) == first
    assert list(path[1].lines) == [None, lone, None]


def test_where_nothing_fits_there_are_no_lines_and_the_path_goes_on() -> None:
    lines = [_line(stripe.row + 4) for stripe in STRIPES]
    way = MODEL.assignments(lines, STRIPES, edge_row=BENCH.glass_edge_row, glass_low=True)
    path = MODEL.path([way, [], way], [320.0, 640.0], STRIPES)
    assert [sum(line is not None for line in chosen.lines) for chosen in path] == [3, 0, 3]
    assert path[1].lines == (None, None, None)
    assert np.isnan(path[1].middle_at(400.0, STRIPES))


def test_the_groove_does_not_jump_between_segments() -> None:
    steady = [_line(stripe.row + 3) for stripe in STRIPES]
    # in the second segment a pair of scratches has more votes than the true pair, 45 rows away
    true = [_line(stripe.row + 5, votes=100, column=480.0) for stripe in STRIPES[1:]]
    false = [_line(stripe.row + 50, votes=130, column=480.0) for stripe in STRIPES[1:]]
    ways = [
        MODEL.assignments(lines, STRIPES, edge_row=BENCH.glass_edge_row, glass_low=True)
        for lines in (steady, [*true, *false])
    ]
    assert list(MODEL.path(ways, [320.0], STRIPES)[1].lines) == [None, *true]


def test_a_glass_without_a_known_edge_has_it_in_the_middle() -> None:
    bench = replace(BENCH, cover_glass=CoverGlass())
    lines = [_line(stripe.row) for stripe in STRIPES]
    best = _best(lines, STRIPES, bench)
    assert best is not None
    assert list(best.lines) == lines


def test_a_pair_that_fits_is_believed_before_a_stronger_line_that_stands_alone() -> None:
    pair = [_line(STRIPES[1].row, votes=160), _line(STRIPES[2].row, votes=160)]
    alone = _line(STRIPES[1].row - 60, votes=500, theta_deg=20)
    best = _best([*pair, alone])
    assert best is not None
    assert list(best.lines) == [None, *pair]


@pytest.mark.parametrize(("beyond_edge_px", "roles"), [(65, {2}), (-65, {0, 1})])
def test_a_lone_stripe_is_on_its_side_of_the_glass_edge(beyond_edge_px: float, roles: set[int]) -> None:
    line = _line(BENCH.glass_edge_row + beyond_edge_px)
    best = _best([line])
    assert best is not None
    assert {role for role, found in enumerate(best.lines) if found is line} <= roles


def test_walls_that_part_may_have_any_distance_in_a_vertical_cut() -> None:
    # the groove rises: the outer stripe moves down the rows, those of the inner wall up
    lines = [_line(STRIPES[0].row + 30, theta_deg=-9), *(_line(stripe.row - 30, theta_deg=9) for stripe in STRIPES[1:])]
    settings = {"edge_row": BENCH.glass_edge_row, "glass_low": True}
    parted = MODEL.assignments(lines, STRIPES, walls_part=True, **settings)
    assert list(parted[0].lines) == lines
    together = MODEL.assignments(lines, STRIPES, walls_part=False, **settings)
    assert list(together[0].lines) != lines
