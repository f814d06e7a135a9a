"""Off-centre holes: geometry point by point, the gauge's error bars, and a tone that comes out straight.

Nothing here is filmed: stretches are given as a pickup would give them.
"""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.preamp.resample import Resampler
from gramoscope.signal_path import Texture, WallTrace
from gramoscope.tonearm.follow import KalmanSmoother, Tonearm
from gramoscope.turntable.hole_gauge import HoleGauge
from gramoscope.turntable.off_centre import OffCentreHole
from gramoscope.turntable.rotation import Rotation

SPIRAL = Rotation(rpm=78.26, radius_m=0.0931, pitch_m=254e-6)
GROUP_STEP_M = 1.31e-3
BASS_GROUPS = 31


def test_the_film_of_an_off_centre_record_is_the_one_that_geometry_draws():
    """Points of a spiral about C in a record that is turned about H until each lies under the lens."""
    theta = 0.7 + np.linspace(0, 13.0, 4001)
    radius = SPIRAL.radius_m - SPIRAL.pitch_m * (theta - theta[0]) / (2 * np.pi)
    hole = 0.61e-3 * np.exp(1j * 2.1)
    seen = radius * np.exp(1j * theta) - hole
    turned = np.unwrap(np.angle(seen))
    # farthest from H where H, C and the groove lie in a line, C between: opposite to where H lies
    phase = 2.1 + np.pi - turned[0]
    made = OffCentreHole(SPIRAL, 0.61e-3, phase)
    nominal = SPIRAL.arc_of_angle_m(turned - turned[0])
    np.testing.assert_allclose(made.distance_m(nominal), np.abs(seen), rtol=0, atol=6e-7)
    length = np.concatenate([[0], np.cumsum(np.abs(np.diff(radius * np.exp(1j * theta))))])
    np.testing.assert_allclose(made.true_arc_m(nominal), length, rtol=1e-6, atol=1e-9)
    assert np.max(np.abs(nominal - length)) > 0.6e-3, "what doing nothing would score"
    np.testing.assert_allclose(made.true_arc_m(nominal), SPIRAL.arc_of_angle_m(theta - theta[0]), atol=2e-9)


def test_wow_is_e_over_r_and_fastest_where_the_groove_is_farthest():
    hole = OffCentreHole(Rotation(78.0, 0.115), 0.5e-3, phase_rad=1.3)
    arc = np.linspace(0, 2 * np.pi * 0.115, 20_001)
    speed = np.gradient(hole.true_arc_m(arc), arc)
    assert speed.max() - 1 == pytest.approx(0.0043478, rel=1e-3), "0.43 % at 115 mm, as archives say"
    assert arc[np.argmax(speed)] / 0.115 == pytest.approx(1.3, abs=2e-3)
    assert arc[np.argmax(hole.distance_m(arc))] / 0.115 == pytest.approx(1.3, abs=2e-3)
    with pytest.raises(ArgumentError):
        OffCentreHole(SPIRAL, 0.06)


def traces_of(hole, *, turns, bass_m=30e-6, seed=0):
    """Stretches at nominal places as the pickup gives them: where the walls pass, and bass that lasts for 30 of them.

    In every third only one wall is seen.
    """
    rng = np.random.default_rng(seed)
    groups = int(turns * 2 * np.pi * hole.rotation.radius_m / GROUP_STEP_M)
    window = np.hanning(BASS_GROUPS)
    bass = np.convolve(rng.standard_normal(groups + BASS_GROUPS - 1), window / np.linalg.norm(window), "valid") * bass_m
    start = 2e-3 + GROUP_STEP_M * np.arange(groups)
    lateral = 4e-6 + hole.rotation.radius_m - hole.distance_m(start + 6 * 93e-6) + bass
    for k in range(groups):
        offset = np.repeat(lateral[k] + np.array([[60e-6], [-75e-6]]), 13, axis=1)
        if k % 3 == 0:
            offset[rng.integers(2)] = np.nan
        yield trace(k, start[k], offset)


def trace(number, start_m, offset_m, *, step_m=93e-6, slope=None):
    nothing = np.full(offset_m.shape, np.nan)
    return WallTrace(
        number=number,
        arc_start_m=start_m,
        arc_step_m=step_m,
        offset_m=offset_m,
        offset_sigma_m=np.full(offset_m.shape, 50e-9),
        slope=nothing if slope is None else slope,
        slope_sigma=nothing if slope is None else np.full(offset_m.shape, 1e-4),
        correlation_samples=1.0,
        flags=np.zeros(offset_m.shape, np.uint16),
    )


def gauged(traces, rotation=SPIRAL):
    gauge = HoleGauge(rotation)
    for one in traces:
        gauge.see(one)
    return gauge.finding()


@pytest.mark.parametrize(("e_mm", "phase_rad"), [(0.5, -2.0), (0.05, 0.4), (1.3, 3.0)])
def test_the_gauge_finds_the_hole(e_mm, phase_rad):
    found = gauged(traces_of(OffCentreHole(SPIRAL, e_mm * 1e-3, phase_rad), turns=2.7))
    assert found.reason is None
    assert found.significant
    assert abs(found.eccentricity_m - e_mm * 1e-3) < 4 * found.eccentricity_sigma_m + 1e-6 * e_mm**2
    assert abs(np.angle(np.exp(1j * (found.phase_rad - phase_rad)))) < 4 * found.phase_sigma_rad + 5e-3
    assert abs(found.pitch_m - 254e-6) < 4 * found.pitch_sigma_m
    assert found.eccentricity_sigma_m < 8e-6
    assert found.wow == pytest.approx(e_mm / 93.1, rel=0.1)


@pytest.mark.parametrize("turns", [1.1, 2.3])
def test_error_bars_of_the_gauge_are_true(turns):
    """Errors over claimed errors of 32 films; 30 stretches in a row err alike: naive sigmas are 3 times too small."""
    hole = OffCentreHole(SPIRAL, 0.3e-3, 1.0)
    found = [gauged(traces_of(hole, turns=turns, seed=seed)) for seed in range(32)]
    pulls = np.array([(one.eccentricity_m - 0.3e-3) / one.eccentricity_sigma_m for one in found])
    phases = np.array([(one.phase_rad - 1.0) / one.phase_sigma_rad for one in found])
    for each in (pulls, phases):
        assert 0.75 < each.std() < 1.18
        assert abs(each.mean()) < 0.6


def test_too_small_a_part_of_a_turn_is_not_determined_and_says_why():
    found = gauged(traces_of(OffCentreHole(SPIRAL, 0.5e-3), turns=0.4))
    assert found.reason is not None
    assert "of a turn" in found.reason
    assert not found.significant
    noisy = gauged(traces_of(OffCentreHole(SPIRAL, 0.5e-3), turns=0.8, bass_m=2e-3))
    assert noisy.reason is not None
    assert "known to" in noisy.reason
    assert gauged([]).reason is not None


def test_what_is_far_too_large_for_a_hole_is_not_one():
    """Half the radius would be an error of the caller's; a log that was read wrongly is not."""
    starts = np.arange(0, 1.2 * 2 * np.pi * SPIRAL.radius_m, 3e-3)
    swing = -12e-3 * np.cos(SPIRAL.angle_of_arc_rad(starts + 6 * 93e-6))
    found = gauged(trace(k, start, np.full((2, 13), swing[k])) for k, start in enumerate(starts))
    assert found.reason is not None
    assert "no hole" in found.reason
    assert not found.significant


def test_a_centred_record_has_nothing_to_remove():
    found = gauged(traces_of(OffCentreHole(SPIRAL, 0.0), turns=3.2, seed=5))
    assert found.reason is None
    assert not found.significant


def test_memory_does_not_grow_with_the_passage():
    gauge = HoleGauge(SPIRAL)
    nothing = np.full((2, 3), 1e-6)
    for k in range(9_000):
        gauge.see(trace(k, k * 3e-3, nothing))
    assert gauge._places.blocks <= 256
    assert gauge.turns == pytest.approx(9_000 * 3e-3 / (2 * np.pi * 0.0931), rel=0.1)


SMALL = Rotation(rpm=78.26, radius_m=0.05, pitch_m=254e-6)
STEP_M, TONE_HZ = 3.1e-6, 400.0


def toned(hole, *, turns=1.1):
    """Stretches of a tone that was cut at a constant angular speed about the middle, at the places an encoder would say."""
    for k in range(int(turns * 2 * np.pi * hole.rotation.radius_m / GROUP_STEP_M * 2.79)):
        nominal = k * 469.53e-6
        arc = float(hole.true_arc_m(nominal)) + STEP_M * np.arange(165)
        velocity = 0.03 * np.sin(2 * np.pi * TONE_HZ * hole.rotation.time_of_arc_s(arc))
        slope = np.tile(velocity / hole.rotation.speed_at_m_s(arc), (2, 1))
        yield trace(k, nominal, np.zeros((2, 165)), step_m=STEP_M, slope=slope)


def phase_swing_rad(traces):
    """How far a tone runs ahead and behind of itself: the swing of its phase, over the half of the passage in the middle."""
    tonearm = Tonearm(SMALL, "lateral", np.pi / 4, 0.0, KalmanSmoother(learn_groups=16))
    sound = list(Resampler(SMALL, rate_hz=24_000.0).resample(tonearm.follow(traces)))
    samples = np.concatenate([piece.lateral.samples for piece in sound])
    beat = samples * np.exp(-2j * np.pi * TONE_HZ * np.arange(samples.size) / 24_000.0)
    smooth = np.convolve(beat, np.hanning(601), "valid")
    phase = np.unwrap(np.angle(smooth))
    return np.ptp(phase)


def test_a_tone_with_the_wow_of_an_off_centre_hole_comes_out_straight():
    """A hole 0.5 mm off at 50 mm swings a tone of 400 Hz by ± (e/r)/ω · 2π·400 = ± 3.1 radians, one per cent in pitch."""
    hole = OffCentreHole(SMALL, 0.5e-3, 0.8)
    assert phase_swing_rad(toned(hole)) == pytest.approx(2 * 0.01 * TONE_HZ * 60 / 78.26, rel=0.1)
    assert phase_swing_rad(hole.put_right(one) for one in toned(hole)) < 0.03


def test_putting_right_moves_textures_along_and_nothing_else():
    hole = OffCentreHole(SMALL, 0.5e-3, 0.8)
    strip = np.zeros((2, 3), np.float32)
    one = replace(trace(3, 0.02, np.ones((2, 5))), head=Texture(strip, 0.021, 1e-6), tail=Texture(strip, 0.0225, 1e-6))
    moved = hole.put_right(one)
    shift = float(hole.true_arc_m(0.02)) - 0.02
    assert abs(shift) > 50e-6
    assert moved.arc_start_m == pytest.approx(0.02 + shift, abs=1e-12)
    assert moved.head.arc_start_m == pytest.approx(0.021 + shift, abs=1e-12)
    assert moved.tail.arc_start_m == pytest.approx(0.0225 + shift, abs=1e-12)
    assert moved.offset_m is one.offset_m
    assert hole.put_right(trace(3, 0.02, np.ones((2, 5)))).head is None


def test_overlaps_witness_whether_places_are_angles():
    """Steps that are true arcs show nothing; steps that are angles show the whole wow."""
    hole = OffCentreHole(SPIRAL, 0.5e-3, -1.0)
    gauge, blind = HoleGauge(SPIRAL), HoleGauge(SPIRAL)
    rng, before = np.random.default_rng(2), 0.0
    for one in traces_of(hole, turns=2.2):
        ahead = float(hole.true_arc_m(one.arc_start_m)) - one.arc_start_m
        noise = 0.2e-6 * rng.standard_normal()
        gauge.see(one, ahead - before + noise)
        blind.see(one, noise)
        before = ahead
    seen, unseen = gauge.finding(), blind.finding()
    assert abs(seen.step_wow - seen.wow) < 4 * np.hypot(seen.step_wow_sigma, seen.wow_sigma)
    assert abs(unseen.step_wow) < 4 * unseen.step_wow_sigma
    assert max(seen.step_wow_sigma, unseen.step_wow_sigma) < 0.1 * seen.wow
