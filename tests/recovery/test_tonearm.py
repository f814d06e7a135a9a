"""Simulate, read, splice and smooth: the velocity of the groove over a whole passage."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from gramoscope.disc.formats import direction_of_cut
from gramoscope.simulation.render import filmed_group
from gramoscope.simulation.rig import Rig
from gramoscope.tonearm.follow import Tonearm
from gramoscope.tonearm.splice import Splice


def _played(take: object) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Velocity, its claimed standard error, the true velocity, and flags."""
    bench = take.scene.bench
    direction = direction_of_cut(bench.disc.cut)
    tonearm = Tonearm(bench.rotation, direction, bench.disc.wall_angle_rad, bench.passage_length_m)
    pieces = list(tonearm.follow(trace for trace, _ in Splice().join(iter(take.traces))))
    velocity, sigma, flags = (
        np.concatenate([getattr(piece, name) for piece in pieces])
        for name in (f"{direction}_velocity_m_s", f"{direction}_sigma_m_s", "flags")
    )
    arc_m = pieces[0].arc_step_m * np.arange(velocity.size)
    true = take.passage.velocity_m_s(arc_m)[0 if direction == "lateral" else 1]
    seen = arc_m >= take.traces[0].arc_start_m
    # nobody saw the groove before the first group
    assert (flags[~seen][:-1] & 1).all()
    return velocity[seen], sigma[seen], true[seen], flags[seen]


def _heard(velocity: np.ndarray, take: object) -> np.ndarray:
    """What is left between 200 Hz and 5 kHz, without the first and last tenth of a millimetre."""
    rate_hz = float(take.scene.bench.rotation.speed_at_m_s(0.0)) / (10 * take.scene.bench.sensor.pixel_pitch_m)
    return sosfiltfilt(butter(2, [200, 5000], "bandpass", fs=rate_hz, output="sos"), velocity)[25:-25]


def _correlation(take: object) -> float:
    velocity, _, true, _ = _played(take)
    return float(np.corrcoef(_heard(velocity, take), _heard(true, take))[0, 1])


def test_a_lateral_cut_is_heard(lateral: list) -> None:
    for take in lateral:
        velocity, _, true, flags = _played(take)
        assert _correlation(take) > 0.93
        # half of the power of the error would be left if nothing were smoothed; silence would leave all of the music
        assert np.std(velocity - true) < 0.35 * np.std(true)
        assert (flags == 0).mean() > 0.95


def test_smoothing_over_the_passage_beats_the_stations_alone(lateral: list) -> None:
    for take in lateral:
        velocity, _, true, _ = _played(take)
        speed_m_s = float(take.scene.bench.rotation.speed_at_m_s(0.0))
        stations = np.concatenate([trace.slope[0] for trace in take.traces]) * speed_m_s
        arc_m = np.concatenate([t.arc_start_m + t.arc_step_m * np.arange(t.slope.shape[1]) for t in take.traces])
        alone = np.sqrt(np.nanmean((stations - take.passage.velocity_m_s(arc_m)[0]) ** 2))
        assert np.sqrt(np.mean((velocity - true) ** 2)) < 0.6 * alone


def test_the_claimed_error_is_never_much_too_small(lateral: list) -> None:
    # the smoother takes the errors of stations for white noise; they are those of a place, differentiated, which are
    # smaller in the bass: the claim errs on the safe side
    for take in lateral:
        velocity, sigma, true, flags = _played(take)
        good = flags == 0
        assert 0.9 < np.sqrt(np.mean(sigma[good] ** 2) / np.mean((velocity - true)[good] ** 2)) < 2.6


def test_a_vertical_cut_is_heard_with_its_sign_and_its_loudness(vertical: object) -> None:
    velocity, _, true, _ = _played(vertical)
    assert _correlation(vertical) > 0.9
    heard, cut = _heard(velocity, vertical), _heard(true, vertical)
    assert (heard * cut).sum() / (cut**2).sum() == pytest.approx(0.95, abs=0.12)


def test_a_turntable_that_misses_its_places_is_followed(filmed: Callable) -> None:
    take = filmed("lateral", seed=8, groups=4, rig=Rig(frame_step_share=0.08, group_position_m=2e-6))
    traces = take.traces
    true_m = np.array([filmed_group(take.scene, trace.number).arc_start_m[0] for trace in traces])
    found_m = np.array([trace.arc_start_m for trace, _ in Splice().join(iter(traces))])
    nominal_m = np.array([trace.arc_start_m for trace in traces])
    # the first of them stands where the encoder says, and the others by it
    np.testing.assert_allclose(np.diff(found_m), np.diff(true_m), atol=0.1e-6)
    assert np.abs(np.diff(nominal_m) - np.diff(true_m)).max() > 0.8e-6
    assert _correlation(take) > 0.9
