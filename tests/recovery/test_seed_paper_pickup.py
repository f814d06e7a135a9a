"""Simulate and read: does the cartridge find the slope that was cut, and are its error bars true?

Slopes are compared at each station with those of the groove averaged over the neighbourhood as a least-squares line
weighs them, 1 − (x/h)²: what a plane over 100 pixels can know.
"""

from collections.abc import Callable

import numpy as np
import pytest

from gramoscope.camera.noise import SensorNoise
from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.seed_paper import SeedPaperPickup
from gramoscope.signal_path import WallTrace

NOISY = SensorNoise(full_well_electrons=100.0, read_electrons=10.0)


def _arc_m(trace: WallTrace) -> np.ndarray:
    return trace.arc_start_m + trace.arc_step_m * np.arange(trace.slope.shape[1])


def _true_slope(take: object, trace: WallTrace) -> np.ndarray:
    """Of the inner wall: a − h at 45°."""
    away = np.linspace(-1, 1, 51)
    share = (1 - away**2) / (1 - away**2).sum()
    reach_m = 50 * take.scene.bench.sensor.pixel_pitch_m
    lateral, vertical = take.passage.slope(_arc_m(trace)[:, None] + reach_m * away[None, :])
    return (lateral - vertical) @ share


def _errors(take: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Error, claimed standard error and true slope of every station without a flag."""
    parts = []
    for trace in take.traces:
        good = trace.flags[INNER] == 0
        true = _true_slope(take, trace)
        parts.append(np.array([trace.slope[INNER] - true, trace.slope_sigma[INNER], true])[:, good])
    return tuple(np.concatenate(parts, axis=1))


def test_the_slope_of_a_lateral_groove_is_found(lateral: list) -> None:
    for take in lateral:
        error, _, true = _errors(take)
        # a single plane over 100 pixels is half as wrong as silence, which would be wrong by 1.0
        assert error.std() < 0.75 * true.std()
        assert abs(error.mean()) < 0.004
        # the gain is that of a measurement, not of a guess that plays safe
        assert (true * (true + error)).sum() / (true**2).sum() == pytest.approx(1.0, abs=0.08)


def test_nearly_every_station_of_a_clean_record_is_measured(lateral: list) -> None:
    flags = np.concatenate([trace.flags[INNER] for take in lateral for trace in take.traces])
    assert (flags == 0).mean() > 0.95


def test_the_wall_that_is_not_read_says_so(lateral: list) -> None:
    trace = lateral[0].traces[2]
    assert np.isnan(trace.slope[OUTER]).all()
    assert (trace.flags[OUTER] & 1).all()


def test_the_claimed_standard_errors_are_the_real_ones(lateral: list) -> None:
    for take in lateral:
        error, sigma, _ = _errors(take)
        assert 0.7 < np.sqrt((sigma**2).mean() / (error**2).mean()) < 1.4
    z = np.concatenate([error / sigma for error, sigma, _ in map(_errors, lateral)])
    assert 0.8 < z.std() < 1.2
    assert np.mean(np.abs(z) > 3) < 0.02


def test_the_place_of_the_wall_is_that_of_the_groove(lateral: list) -> None:
    take = lateral[1]
    for trace in take.traces:
        true_m = take.passage.displacement_m(_arc_m(trace))[0]
        error = trace.offset_m[INNER] - true_m
        good = trace.flags[INNER] == 0
        # up to a constant of the wall: its own place at rest
        assert np.std((error - np.median(error[good]))[good]) < 1e-6
    assert true_m.std() > 1.5e-6


def test_a_groove_that_rises_moves_its_inner_wall_outwards(vertical: object) -> None:
    error, sigma, true = _errors(vertical)
    found = true + error
    assert np.corrcoef(found, true)[0, 1] > 0.75
    assert (true * found).sum() / (true**2).sum() == pytest.approx(1.0, abs=0.15)
    assert 0.7 < np.sqrt((sigma**2).mean() / (error**2).mean()) < 1.4


def test_the_steps_between_frames_are_the_true_ones(lateral: list) -> None:
    steps = np.array([trace.frame_step_m for take in lateral for trace in take.traces])
    np.testing.assert_allclose(steps, 0.8e-6, atol=0.005e-6)
    assert steps.mean() == pytest.approx(0.8e-6, abs=0.001e-6)


def test_more_frames_find_the_groove_better_through_strong_noise(filmed: Callable) -> None:
    rms, measured = [], []
    for frames in (1, 8):
        take = filmed("lateral", seed=7, groups=2, frames=frames, noise=NOISY)
        error, _, _ = _errors(take)
        rms.append(np.sqrt((error**2).mean()))
        measured.append(np.mean([trace.flags[INNER] == 0 for trace in take.traces]))
    assert rms[1] < 0.8 * rms[0]
    assert measured[1] > measured[0] + 0.05


def test_a_record_filmed_frame_by_frame_is_read_without_flow(filmed: Callable) -> None:
    take = filmed("lateral", seed=7, groups=1, frames=1)
    trace = take.traces[0]
    assert trace.frame_step_m.size == 0
    assert (trace.flags[INNER] == 0).mean() > 0.9
    assert np.corrcoef(trace.slope[INNER], _true_slope(take, trace))[0, 1] > 0.6


def test_the_angle_of_the_wall_is_seen_from_its_two_stripes(lateral: list) -> None:
    angles = np.array([trace.wall_angle_rad for trace in lateral[0].traces])
    np.testing.assert_allclose(np.rad2deg(angles[:, INNER]), 45.0, atol=1.0)
    assert np.isnan(angles[:, OUTER]).all()


def test_everything_seen_on_the_way_can_be_looked_at(lateral: list) -> None:
    take = lateral[0]
    pickup = SeedPaperPickup(take.scene.bench)
    seen = pickup.inspect(take.groups[3])
    assert seen is not None
    np.testing.assert_array_equal(seen.trace.slope, pickup.read(take.groups[3]).slope)
    assert seen.kept == (1, 2)
    assert set(np.unique(seen.label)) <= {-3, -2, -1, 0, 1, 2}
    assert seen.point_row.size == seen.label.size > 1000
    for number in seen.kept:
        line = seen.centrelines[number]
        assert line.measured.mean() > 0.6
        assert np.median(line.row) == pytest.approx(seen.stripes[number].row, abs=25)
