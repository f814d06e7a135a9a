"""The tonearm as a whole: one grid without gap or overlap, whatever the size of the blocks; flags; bridges."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gramoscope.conventions import INNER
from gramoscope.errors import ArgumentError
from gramoscope.quality import Quality
from gramoscope.signal_path import GrooveMotion, WallTrace
from gramoscope.tonearm.follow import KalmanSmoother, Tonearm
from gramoscope.tonearm.grid_flags import grid_flags
from gramoscope.turntable.rotation import Rotation

STEP_M = 4e-6
ROTATION = Rotation(rpm=78.0, radius_m=0.08, pitch_m=250e-6)
NOISE = 0.01
GROUPS = 60


def _slope(arc_m: np.ndarray) -> np.ndarray:
    return 0.03 * np.sin(2 * np.pi * arc_m / 5.3e-4 + 0.4) + 0.02 * np.sin(2 * np.pi * arc_m / 2.1e-4)


def _traces(groups: int = GROUPS, *, noise: float = NOISE) -> list[WallTrace]:
    """Stretches of 33 samples, overlapping by about six, on grids of their own."""
    rng = np.random.default_rng(2)
    traces = []
    for number in range(groups):
        start = 1.1e-4 * number + 1e-7 * rng.normal() * (number > 0)
        slope, sigma = np.full((2, 33), np.nan), np.full((2, 33), np.nan)
        slope[INNER] = _slope(start + STEP_M * np.arange(33)) + noise * rng.normal(size=33)
        sigma[INNER] = NOISE
        flags = np.zeros((2, 33), np.uint16)
        flags[1] = Quality.NO_STRIPE | Quality.INTERPOLATED
        traces.append(WallTrace(number, start, STEP_M, slope, sigma, slope, sigma, 1.0, flags))
    return traces


LENGTH_M = 1.1e-4 * (GROUPS - 1) + 32 * STEP_M


def _follow(traces: Iterable[WallTrace], direction: str = "lateral", **smoother: object) -> list[GrooveMotion]:
    tonearm = Tonearm(ROTATION, direction, np.pi / 4, LENGTH_M, KalmanSmoother(**smoother))
    return list(tonearm.follow(traces))


def _whole(pieces: list[GrooveMotion], name: str) -> np.ndarray:
    return np.concatenate([getattr(piece, name) for piece in pieces])


@pytest.mark.parametrize("block_groups", [1, 7, 16, 200])
def test_pieces_follow_each_other_without_gap_or_overlap(block_groups: int) -> None:
    pieces = _follow(_traces(), block_groups=block_groups)
    samples = 0
    for piece in pieces:
        assert piece.arc_step_m == STEP_M
        assert piece.arc_start_m == pytest.approx(samples * STEP_M, abs=1e-12)
        samples += piece.lateral_velocity_m_s.size
    assert samples in (int(LENGTH_M / STEP_M) + 1, int(LENGTH_M / STEP_M) + 2)
    assert (len(pieces) == 1) == (block_groups == 200)


@pytest.mark.parametrize("block_groups", [1, 7, 16])
def test_the_size_of_the_blocks_does_not_matter(block_groups: int) -> None:
    at_once, in_blocks = (_follow(_traces(), block_groups=n) for n in (1000, block_groups))
    for name in ("lateral_velocity_m_s", "lateral_sigma_m_s"):
        once = _whole(at_once, name)
        np.testing.assert_allclose(_whole(in_blocks, name), once, atol=2e-6 * np.abs(once).max())
    np.testing.assert_array_equal(_whole(in_blocks, "flags"), _whole(at_once, "flags"))


def test_a_short_lookahead_answers_sooner_and_worse() -> None:
    once = _whole(_follow(_traces(), block_groups=1000), "lateral_velocity_m_s")
    worst = [
        np.abs(_whole(_follow(_traces(), block_groups=5, lookahead=n), "lateral_velocity_m_s") - once).max()
        for n in (1.0, 4.0, 12.0)
    ]
    assert worst[0] > 3 * worst[1] > 9 * worst[2]


def test_the_motion_is_slope_times_groove_speed_with_an_honest_error() -> None:
    pieces = _follow(_traces())
    velocity, sigma = _whole(pieces, "lateral_velocity_m_s"), _whole(pieces, "lateral_sigma_m_s")
    arc = STEP_M * np.arange(velocity.size)
    true = _slope(arc) * ROTATION.speed_at_m_s(arc)
    assert np.corrcoef(velocity, true)[0, 1] > 0.98
    assert 0.7 < np.std((velocity - true) / sigma) < 1.3
    assert np.std(velocity - true) < 0.6 * NOISE * ROTATION.speed_at_m_s(0.0)
    assert np.isnan(_whole(pieces, "vertical_velocity_m_s")).all()


def test_an_inner_wall_that_moves_outwards_is_a_groove_that_rises() -> None:
    pieces = _follow(_traces(), "vertical")
    velocity = _whole(pieces, "vertical_velocity_m_s")
    np.testing.assert_allclose(velocity, -_whole(_follow(_traces()), "lateral_velocity_m_s"), rtol=1e-9, atol=1e-12)
    assert np.isnan(_whole(pieces, "lateral_velocity_m_s")).all()


def test_a_lost_stretch_is_bridged_with_an_error_that_says_so() -> None:
    traces = _traces()
    nothing = np.full((2, 33), np.nan)
    flags = np.full((2, 33), Quality.FRAME_LOST | Quality.INTERPOLATED, np.uint16)
    traces[30] = replace(traces[30], slope=nothing, slope_sigma=nothing, flags=flags)
    pieces = _follow(traces)
    arc = STEP_M * np.arange(_whole(pieces, "flags").size)
    gap = (arc > traces[30].arc_start_m + 8 * STEP_M) & (arc < traces[31].arc_start_m - 2 * STEP_M)
    flags_there = _whole(pieces, "flags")[gap]
    np.testing.assert_array_equal(flags_there, Quality.FRAME_LOST | Quality.INTERPOLATED)
    assert np.isfinite(_whole(pieces, "lateral_velocity_m_s")).all()
    sigma = _whole(pieces, "lateral_sigma_m_s")
    assert sigma[gap].max() > 3 * np.median(sigma)
    near = ~gap & (np.abs(arc - traces[30].arc_start_m) > 60 * STEP_M)
    assert not _whole(pieces, "flags")[near].any()


@pytest.mark.parametrize("block_groups", [4, 1000])
def test_a_wild_sample_is_an_outlier_and_leaves_the_rest_alone(block_groups: int) -> None:
    clean, traces = _traces(), _traces()
    slope = traces[20].slope.copy()
    slope[INNER, 14:17] += 0.8
    traces[20] = replace(traces[20], slope=slope)
    a, b = (_follow(t, block_groups=block_groups) for t in (clean, traces))
    difference = _whole(b, "lateral_velocity_m_s") - _whole(a, "lateral_velocity_m_s")
    sigma, flags = _whole(a, "lateral_sigma_m_s"), _whole(b, "flags")
    assert np.abs(difference / sigma).max() < 2.5
    marked = np.flatnonzero(flags & Quality.OUTLIER)
    spoilt = (traces[20].arc_start_m + 15 * STEP_M) / STEP_M
    assert marked.size >= 1
    assert np.abs(marked - spoilt).max() <= 3


def test_nothing_in_nothing_out_and_a_passage_beyond_the_last_stretch_is_unknown() -> None:
    assert _follow([]) == []
    pieces = _follow(_traces(40))
    flags, sigma = _whole(pieces, "flags"), _whole(pieces, "lateral_sigma_m_s")
    assert flags.size == int(LENGTH_M / STEP_M) + 1
    assert (flags[-400:] & Quality.INTERPOLATED).all()
    assert sigma[-1] > 5 * np.median(sigma[:1000])


def test_impossible_smoothers_are_refused() -> None:
    for setting in ({"learn_groups": 0}, {"block_groups": 0}, {"lookahead": 0.0}, {"gate": 1.0}):
        with pytest.raises(ArgumentError):
            KalmanSmoother(**setting)
    with pytest.raises(ArgumentError):
        KalmanSmoother(corner_limits_hz=(5000.0, 300.0))


@settings(max_examples=60, deadline=None)
@given(
    places=st.lists(st.floats(0, 1e-4), max_size=25),
    codes=st.lists(st.sampled_from([0, 0, 1, 17, 33, 128, 65]), min_size=25, max_size=25),
    reach_m=st.floats(1e-7, 2e-5),
)
def test_the_flags_of_the_grid_are_those_of_the_samples_around(
    places: list[float], codes: list[int], reach_m: float
) -> None:
    grid = np.arange(1.3e-6, 1e-4, 7e-6)
    arc, flags = np.array(places, float), np.array(codes[: len(places)], np.uint16)
    found = grid_flags(grid, arc, flags, reach_m=reach_m)
    for place, flag in zip(grid, found, strict=True):
        near = flags[(arc >= place - reach_m) & (arc <= place + reach_m)]
        measured = near[(near & 1) == 0]
        reasons = measured if measured.size else np.append(near, np.uint16(1))
        assert flag == np.bitwise_or.reduce(reasons)
