"""The page of flow timings: pairs whose flow is what they say, columns, and turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.speed import flow_pairs
from benchmarks.speed.ceilings import Ceilings
from benchmarks.speed.flow import YARDSTICK, Row, ceiling_lines, interleaved, our_methods, peer_methods, rows_of, table

SHAPE = (96, 128)


@pytest.mark.parametrize(
    "pair",
    [
        flow_pairs.slow_warp(SHAPE),
        flow_pairs.slide(SHAPE),
        flow_pairs.fast_warp(SHAPE),
        flow_pairs.disc_on_ground(SHAPE),
    ],
    ids=lambda pair: pair.name,
)
def test_the_second_picture_at_x_and_w_is_the_first(pair: flow_pairs.Pair) -> None:
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    back = ndimage.map_coordinates(pair.second.astype(float), [row + pair.true.v, column + pair.true.u], order=3)
    still = (pair.second.astype(float) - pair.first)[pair.counted].std()
    off = (back - pair.first)[pair.counted]
    # a seam a pixel wide, where disc and ground are mixed, is no more than a few points
    assert np.quantile(np.abs(off), 0.9) < 3.3 * flow_pairs.NOISE
    assert np.median(np.abs(off)) < 2 * flow_pairs.NOISE < still / 2


def test_points_at_the_edge_are_some_of_all() -> None:
    pair = flow_pairs.disc_on_ground(SHAPE)
    edge = flow_pairs.at_the_edge(pair, reach_px=5)
    assert 0 < edge.counted.sum() < 0.4 * pair.counted.sum()
    assert not (edge.counted & ~pair.counted).any()


def test_our_flow_is_more_exact_than_dis_medium_on_a_small_pair_too() -> None:
    pytest.importorskip("cv2")
    pair = flow_pairs.slow_warp((256, 320))
    rows = {row.method: row for row in rows_of(pair, {**our_methods(), **peer_methods()}, 1)}
    assert rows["coarse to fine"].error_px < 0.7 * rows[YARDSTICK].error_px < 0.1


def test_times_are_shares_of_the_yardstick() -> None:
    rows = [Row("p", "ours", 0.01, 0.02, 0.05, 0.04), Row("p", YARDSTICK, 0.03, 0.04, 0.2, 0.16)]
    assert table(rows)[2] == "| p | ours | 0.0100 | 0.0200 | 50.0 | 40.0 | 0.25 |"
    assert table(rows[:1])[2].endswith("| – |")


def test_sweeps_are_held_against_what_is_measured() -> None:
    # 14 · 100 · 10⁶ instructions at 10¹⁰ a second are 140 ms; 28 · 100 · 10⁶ bytes at 10¹⁰ a second 280 ms
    lines = ceiling_lines({"100 sweeps of x": 0.28, "other": 0.1}, (1000, 1000), Ceilings(1e10, 1e10))
    assert "| 100 sweeps of x | 280.0 | 2.00 | 1.00 |" in lines
    assert "| other | 100.0 | – | – |" in lines


def test_works_take_turns_and_the_first_round_does_not_count() -> None:
    calls: list[str] = []
    spent = interleaved([lambda: calls.append("a"), lambda: calls.append("b")], 2)
    assert calls == ["a", "b"] * 3
    assert [len(times) for times in spent] == [2, 2]
