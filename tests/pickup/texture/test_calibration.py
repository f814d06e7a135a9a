"""What a passage says about the apparatus when the manifest is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.texture.calibration import aligned_layout, calibration_of
from gramoscope.pickup.texture.filter_bank import FilterBank
from gramoscope.pickup.texture.groove_search import GrooveSearch
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import StripeStatistics
from gramoscope.pickup.texture.reading import Model
from gramoscope.pickup.texture.sharpness import sharpness
from gramoscope.pickup.texture.spectrum import Band
from gramoscope.pickup.texture.tone import Tone
from gramoscope.simulation.scene import filming_bench

BENCH = filming_bench(height_px=448)
WIDTH, HEIGHT = 1280, 448


def _layout(bench: Bench = BENCH) -> StripeLayout:
    return StripeLayout.of_bench(bench, edge_margin_px=-16.0)


def _picture(number: int, true: StripeLayout) -> np.ndarray:
    """Texture about the stripes of a groove that swings by ten rows."""
    rng = np.random.default_rng([number, 7])
    column = np.arange(WIDTH)
    lateral = 10 * np.sin(2 * np.pi * column / 700 + number)
    rows = true.rows(np.array([lateral, lateral]))
    amplitude = np.zeros((WIDTH, HEIGHT))
    for one, low, high in zip(rows, true.first_row, true.last_row, strict=True):
        away = np.arange(HEIGHT) - one[:, None]
        amplitude += 20 * np.exp(-(away**2) / (2 * 3.0**2)) * ((one >= low) & (one <= high))[:, None]
    return np.rint(2000 + 10 * (1 + amplitude) * rng.normal(size=amplitude.shape)).astype(np.uint16).T


def _sharp(pictures: list[np.ndarray]) -> list[np.ndarray]:
    return [sharpness(np.ascontiguousarray(picture)[np.newaxis], np.zeros(1)).relative for picture in pictures]


def _aligned(nominal: StripeLayout, true: StripeLayout) -> tuple[StripeLayout, list[tuple[FloatArray, FloatArray]]]:
    pictures = [_picture(number, true) for number in range(5)]
    return aligned_layout(_sharp(pictures), nominal, GrooveSearch(), "lateral", map)


@pytest.mark.parametrize("thicker", [-0.1, 0.0, 0.1])
def test_stripes_are_found_when_the_glass_is_a_tenth_thicker_or_thinner_than_it_says(thicker: float) -> None:
    glass = BENCH.cover_glass
    assert glass is not None
    told = replace(BENCH, cover_glass=replace(glass, thickness_m=glass.thickness_m * (1 + thicker)))
    found, paths = _aligned(_layout(told), _layout())
    moved = found.rest_row - _layout().rest_row
    # a wall at rest may lie anywhere, but its two stripes lie where they lie
    assert moved[3] - moved[2] == pytest.approx(0, abs=0.8)
    for number, (path, _) in enumerate(paths):
        cell = 8 * np.arange(path.shape[1]) + 3.5
        true = 10 * np.sin(2 * np.pi * cell / 700 + number)
        for stripe in (1, 2, 3):
            error = path[found.wall[stripe]] + moved[stripe] - true
            assert np.quantile(np.abs(error), 0.95) < 3


def test_the_order_in_which_stretches_are_looked_at_does_not_matter() -> None:
    pictures = [_picture(number, _layout()) for number in range(4)]

    def backwards(work: Any, tasks: Any) -> Any:
        return iter([work(task) for task in list(tasks)[::-1]][::-1])

    one, _ = aligned_layout(_sharp(pictures), _layout(), GrooveSearch(), "lateral", map)
    other, _ = aligned_layout(_sharp(pictures), _layout(), GrooveSearch(), "lateral", backwards)
    np.testing.assert_array_equal(one.rest_row, other.rest_row)


def test_pictures_that_show_nothing_leave_the_layout_as_the_manifest_has_it() -> None:
    blank = [np.random.default_rng(1).normal(100, 1, (WIDTH, HEIGHT)).round().astype(np.uint8)] * 3
    found, _ = aligned_layout(_sharp(blank), _layout(), GrooveSearch(), "lateral", map)
    np.testing.assert_array_equal(found.rest_row, _layout().rest_row)


def _model(layout: StripeLayout) -> Model:
    deaf = FilterBank(*(np.zeros(shape, np.float32) for shape in ((19, 3), (1, 2, 3), (2,), (3, 16))))
    one = StripeStatistics(deaf, 4.0, 8.0, 0.0, np.ones(19), 9000)
    return Model(layout, Tone(), np.ones(1), 1, Band(), 64, (None, one, one, one))


def test_measured_stands_beside_stated_in_micrometres_and_degrees() -> None:
    true = replace(_layout(), rest_row=_layout().rest_row + np.array([0.0, 0.0, 2.0, 6.0]))
    told = calibration_of(true, _model(true), BENCH, 23)
    pitch_um = BENCH.sensor.pixel_pitch_m * 1e6
    glass = BENCH.cover_glass
    assert glass is not None
    shift_um = glass.shift_m * 1e6
    assert told["groups"] == 23
    assert told["stripe_distances"]["manifest"]["between_planes_um"] == pytest.approx(shift_um)
    assert told["stripe_distances"]["measured"]["between_planes_um"] == pytest.approx(shift_um + 4 * pitch_um)
    walls = [told["stripe_distances"][who]["between_walls_um"] for who in ("measured", "manifest")]
    assert walls[0] - walls[1] == pytest.approx(2 * pitch_um)
    assert told["focus_shift_um"]["if_walls_are_as_stated"] == pytest.approx(shift_um + 4 * pitch_um)
    assert told["wall_angle_deg"]["manifest"] == pytest.approx(45)
    # a steeper wall has its stripes nearer to each other
    assert told["wall_angle_deg"]["if_the_glass_is_as_stated"] == pytest.approx(
        np.rad2deg(np.arctan(shift_um / (shift_um + 4 * pitch_um)))
    )


def test_a_wall_that_is_steep_on_paper_makes_a_deep_step_of_a_wide_one() -> None:
    steep = replace(BENCH, disc=replace(BENCH.disc, wall_angle_rad=np.deg2rad(50.0)))
    layout = _layout(steep)
    told = calibration_of(layout, _model(layout), steep, 23)
    glass = steep.cover_glass
    assert glass is not None
    assert told["focus_shift_um"]["if_walls_are_as_stated"] == pytest.approx(1e6 * glass.shift_m)
    assert told["wall_angle_deg"]["if_the_glass_is_as_stated"] == pytest.approx(50.0)


def test_every_stripe_says_how_much_it_can_be_trusted() -> None:
    layout = _layout()
    hidden, *seen = calibration_of(layout, _model(layout), BENCH, 23)["stripes"]
    assert (hidden["wall"], hidden["columns"]) == ("outer", 0)
    assert [one["wall"] for one in seen] == ["outer", "inner", "inner"]
    for one, row in zip(seen, layout.rest_row[1:], strict=True):
        assert one["row_at_rest"] == pytest.approx(row)
        assert one["columns"] == 9000
        assert one["score_power_over_information"] == pytest.approx(2.0)
        # √J/I rows
        expected = np.sqrt(8.0) / 4.0 * BENCH.sensor.pixel_pitch_m * 1e6
        assert one["standard_error_of_a_column_um"] == pytest.approx(expected)


def test_a_passage_that_taught_nothing_has_nothing_to_say_of_stripes() -> None:
    assert calibration_of(_layout(), None, BENCH, 0)["stripes"] == []


def test_without_a_glass_nothing_is_said_of_one() -> None:
    bench = replace(BENCH, cover_glass=None)
    told = calibration_of(_layout(bench), None, bench, 5)
    assert "focus_shift_um" not in told
    assert told["stripe_distances"]["manifest"]["between_planes_um"] is None
    assert told["stripe_distances"]["manifest"]["between_walls_um"] > 0
    assert {INNER, OUTER} == set(_layout(bench).wall)
