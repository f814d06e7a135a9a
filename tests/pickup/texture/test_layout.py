"""Where stripes lie and where they can be seen, on either side of the glass edge and without a glass."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import INNER, OUTER
from gramoscope.microscope.cover_glass import CoverGlass
from gramoscope.pickup.texture.layout import BOTTOM_PX, StripeLayout, wall_sign
from gramoscope.simulation.scene import filming_bench

BENCH = filming_bench(height_px=448)


def _other_side(bench: Bench) -> Bench:
    glass, height = bench.cover_glass, bench.sensor.height_px
    assert glass is not None
    return replace(bench, cover_glass=replace(glass, side="high", edge_row=height - 1 - bench.glass_edge_row))


def test_with_a_glass_there_are_four_stripes_two_of_each_wall_a_glass_step_apart() -> None:
    layout = StripeLayout.of_bench(BENCH, edge_margin_px=6.0)
    assert layout.wall.tolist() == [OUTER, OUTER, INNER, INNER]
    np.testing.assert_array_less(layout.rest_row[:-1], layout.rest_row[1:])
    np.testing.assert_allclose(layout.rest_row[1:], BENCH.stripe_rows(), atol=1e-9)
    steps = np.diff(layout.rest_row)
    glass = BENCH.cover_glass
    assert glass is not None
    # walls at 45°: as far apart as the planes are deep
    assert steps[0] == pytest.approx(steps[2])
    assert steps[0] == pytest.approx(glass.shift_m / BENCH.sensor.pixel_pitch_m, rel=1e-6)
    np.testing.assert_allclose(layout.from_bottom_px, layout.from_bottom_px[::-1])


def test_stripes_through_the_glass_end_before_its_edge_and_the_others_begin_after_it() -> None:
    layout = StripeLayout.of_bench(BENCH, edge_margin_px=6.0)
    edge = BENCH.glass_edge_row
    np.testing.assert_allclose(layout.last_row, [447, edge - 6, edge - 6, 447])
    np.testing.assert_allclose(layout.first_row, [edge + 6, 0, 0, edge + 6])


def test_a_glass_over_the_other_half_is_the_mirror_picture() -> None:
    one, other = (StripeLayout.of_bench(bench, edge_margin_px=6.0) for bench in (BENCH, _other_side(BENCH)))
    np.testing.assert_allclose(other.rest_row, 447 - one.rest_row[::-1])
    np.testing.assert_allclose(other.first_row, 447 - one.last_row[::-1])
    np.testing.assert_allclose(other.last_row, 447 - one.first_row[::-1])
    np.testing.assert_array_equal(other.wall == INNER, one.wall[::-1] == OUTER)


def test_without_a_glass_there_are_two_stripes_and_the_whole_picture() -> None:
    layout = StripeLayout.of_bench(replace(BENCH, cover_glass=None), edge_margin_px=6.0)
    assert layout.wall.tolist() == [OUTER, INNER]
    assert (layout.first_row == 0).all()
    assert (layout.last_row == 447).all()


@pytest.mark.parametrize("bench", [BENCH, _other_side(BENCH)], ids=["low", "high"])
def test_a_groove_that_swings_far_loses_one_stripe_and_shows_another(bench: Bench) -> None:
    layout = StripeLayout.of_bench(bench, edge_margin_px=6.0)

    def seen(lateral_px: float) -> int:
        rows = layout.rows(np.full((2, 1), lateral_px))
        return int(np.count_nonzero(layout.visible(rows, half_px=12)))

    away = 1 if isinstance(bench.cover_glass, CoverGlass) and bench.cover_glass.side == "low" else -1
    assert seen(0.0) == 3
    assert seen(-60.0 * away) == 2, "the shallow stripe has come under the glass"
    assert seen(45.0 * away) == 2, "the deep inner stripe has left the glass"
    assert seen(100.0 * away) == 1, "the deep stripe of the outer wall is left"
    assert seen(150.0 * away) == 0, "and has gone, too, in a picture as low as this"


def test_rows_are_places_at_rest_plus_the_displacement_of_their_wall() -> None:
    layout = StripeLayout.of_bench(BENCH, edge_margin_px=6.0)
    displacement = np.array([[1.5, -2.0, 7.0], [0.5, 4.0, -3.0]])
    rows = layout.rows(displacement)
    assert rows.shape == (4, 3)
    for number, wall in enumerate(layout.wall):
        np.testing.assert_allclose(rows[number] - layout.rest_row[number], displacement[wall])


def test_a_window_is_seen_when_all_of_its_rows_are() -> None:
    layout = StripeLayout.of_bench(BENCH, edge_margin_px=0.0).of_wall(OUTER)
    edge = BENCH.glass_edge_row
    rows = layout.rest_row[:, None] + np.array([edge - 12, edge - 11.9]) - layout.rest_row[1]
    np.testing.assert_array_equal(layout.visible(rows, half_px=12)[1], [True, False])


def test_the_stripes_of_a_wall_are_those_of_that_wall() -> None:
    layout = StripeLayout.of_bench(BENCH, edge_margin_px=6.0)
    inner = layout.of_wall(INNER)
    assert (inner.wall == INNER).all()
    np.testing.assert_array_equal(inner.rest_row, layout.rest_row[2:])
    np.testing.assert_array_equal(layout.at(layout.rest_row + 3).rest_row, layout.rest_row + 3)


def test_a_groove_that_rises_moves_its_inner_wall_outwards_and_its_outer_wall_inwards() -> None:
    np.testing.assert_array_equal(wall_sign(np.array([INNER, OUTER])), [-1.0, 1.0])


@pytest.mark.parametrize("lateral_px", [-20.0, 0.0, 20.0])
def test_windows_stay_above_the_rounded_bottom_and_below_the_land(lateral_px: float) -> None:
    layout = replace(
        StripeLayout.of_bench(BENCH, edge_margin_px=6.0),
        first_row=np.full(4, -1000.0),
        last_row=np.full(4, 1000.0),
    )
    rise = np.arange(-80.0, 80.0)
    rows = layout.rows(np.array([lateral_px - rise, lateral_px + rise]))
    room = layout.from_bottom_px[:, None] - rise
    expected = (room >= 12 + BOTTOM_PX) & (room <= layout.half_width_px - 12)
    assert 0.3 < expected.mean() < 0.95
    np.testing.assert_array_equal(layout.visible(rows, half_px=12), expected)
