"""The simulated photograph: edges where they should be, the end of a turn like its start, and a disc rolled up from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.still import open_stills
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.signal_path import StillPicture
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.still import (
    StillScene,
    cut_still,
    disc_picture,
    edges_of_turn,
    still_picture,
    still_truth_m_s,
    write_still,
)

PLAIN = StillScene(
    turns=3, turn_px=700, overlap_px=90, level_m_s=0.004, grain=0.0, noise=0.0, dust_per_m=0.0, bottom=0.25, inner_wall=0.25,
    outer_wall=0.25, seed=3,
)  # fmt: skip


@pytest.fixture(scope="module")
def passage() -> Passage:
    time_s = np.arange(round(8000 * PLAIN.seconds)) / 8000
    return cut_still(np.sin(2 * np.pi * 41.3 * time_s), rate_hz=8000.0, scene=PLAIN)


def test_at_an_edge_the_light_is_half_way(passage: Passage) -> None:
    """Without grain the picture crosses the mean of land and wall where the edge truly is, to what eight bits allow."""
    picture = still_picture(PLAIN, passage).astype(float)
    half = 255 * (PLAIN.land + 0.25) / 2
    for turn in range(PLAIN.turns):
        for rows in edges_of_turn(PLAIN, passage, turn, np.arange(PLAIN.turn_px)):
            for column in range(5, PLAIN.turn_px, 41):
                near = np.arange(int(rows[column]) - 3, int(rows[column]) + 5)
                light = picture[near, column]
                falling = light[0] > light[-1]
                crossing = np.interp(half, *((light[::-1], near[::-1]) if falling else (light, near)))
                assert crossing == pytest.approx(rows[column], abs=0.05)


def test_a_vertical_cut_makes_the_groove_narrower_where_it_is_high(passage: Passage) -> None:
    scene = replace(PLAIN, disc=replace(PLAIN.disc, cut="vertical"))
    time_s = np.arange(round(8000 * scene.seconds)) / 8000
    hill = cut_still(np.sin(2 * np.pi * 41.3 * time_s), rate_hz=8000.0, scene=scene)
    x = np.arange(700)
    outer, inner = edges_of_turn(scene, hill, 1, x)
    height_px = hill.displacement_m((x + 700) * scene.pixel_pitch_m)[1] / scene.pixel_pitch_m
    assert np.allclose(inner - outer, 140e-6 / scene.pixel_pitch_m - 2 * height_px, atol=1e-9)
    straight = scene.first_m / scene.pixel_pitch_m + (1 + x / 700) * scene.groove_pitch_m / scene.pixel_pitch_m
    assert np.allclose((inner + outer) / 2, straight, atol=1e-9)


def test_a_turn_ends_as_it_began_one_groove_further_in(passage: Passage) -> None:
    scene = replace(PLAIN, grain=0.05, dust_per_m=300.0)
    picture = still_picture(scene, passage)
    assert picture.shape == (scene.rows, 790)
    assert np.array_equal(picture[:, 700:], picture[:, :90])
    assert not np.array_equal(picture, still_picture(replace(scene, dust_per_m=0.0), passage))
    ends, begins = edges_of_turn(scene, passage, 0, [700.0])[0], edges_of_turn(scene, passage, 1, [0.0])[0]
    assert ends == pytest.approx(begins)


def test_columns_do_not_depend_on_which_are_asked_for(passage: Passage) -> None:
    scene = replace(PLAIN, grain=0.05, dust_per_m=300.0)
    assert np.array_equal(still_picture(scene, passage)[:, 120:333], still_picture(scene, passage, 120, 333))


def test_the_capture_says_what_the_scene_is(tmp_path, passage: Passage) -> None:
    write_still(tmp_path, PLAIN, passage, pictures=3)
    capture = open_stills(tmp_path)
    bench = capture.bench
    assert (bench.assumed, bench.row.pictures, bench.row.turn_px) == ((), 3, 700.0)
    assert bench.rotation.time_of_arc_s(700 * PLAIN.pixel_pitch_m) == pytest.approx(60 / PLAIN.rpm)
    whole = still_picture(PLAIN, passage)
    for number in range(3):
        image = capture.group(number).image
        start = round(number * bench.row.step_px)
        assert np.array_equal(image, whole[:, start : start + image.shape[1]])


def test_the_truth_is_the_velocity_at_nominal_speed(passage: Passage) -> None:
    lateral, vertical = still_truth_m_s(PLAIN, passage, rate_hz=8000.0)
    time_s = np.arange(lateral.size) / 8000
    inside = (time_s > 0.1) & (time_s < PLAIN.seconds - 0.1)
    wanted = 0.004 * np.sqrt(2) * np.sin(2 * np.pi * 41.3 * time_s)
    assert np.abs(lateral - wanted)[inside].max() < 2e-4
    assert not vertical.any()


def test_a_disc_is_the_still_rolled_up(passage: Passage) -> None:
    """Anticlockwise from the right, inwards: at a quarter of the turn the picture is that of the still's first quarter."""
    scene = replace(PLAIN, turn_px=round(2 * np.pi * 230))
    picture = disc_picture(scene, passage, centre_px=(250.0, 260.0), size_px=(500, 520))
    flat = still_picture(scene, passage)
    radius = scene.turn_px / (2 * np.pi)
    for quarter, (down, right) in enumerate(((0, 1), (-1, 0), (0, -1), (1, 0))):
        column = round(quarter * scene.turn_px / 4)
        for row in range(20, 140, 7):
            seen = picture[round(250 + down * (radius - row)), round(260 + right * (radius - row))]
            near = flat[row - 1 : row + 2, column - 2 : column + 3] if column else flat[row - 1 : row + 2, :3]
            assert near.min() - 4 <= seen <= near.max() + 4


@pytest.mark.parametrize("bottom", [0.5, 0.05])
def test_the_line_along_the_bottom_runs_half_way_between_the_edges(passage: Passage, bottom: float) -> None:
    scene = replace(PLAIN, bottom=bottom, noise=1.0, grain=0.01)
    picture = still_picture(scene, passage, 0, scene.turn_px)
    still = StillPicture(0, picture, 0.0, 0.0, scene.pixel_pitch_m, 255, np.ones(picture.shape, np.bool_))
    grooves = EdgeCartridge().find(still)
    for turn, groove in enumerate(grooves[: scene.turns]):
        middle = np.mean(edges_of_turn(scene, passage, turn, np.arange(scene.turn_px)), axis=0)
        seen = np.isfinite(groove.bottom_row_px)
        assert seen.mean() > 0.9
        assert np.abs(groove.bottom_row_px - middle)[seen].max() < 0.5
    assert len(grooves) >= scene.turns
