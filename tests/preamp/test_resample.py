"""Place → time, against sounds whose closed form is known on a spiral."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gramoscope.disc.formats import direction_of_cut
from gramoscope.errors import ArgumentError
from gramoscope.preamp.resample import Resampler
from gramoscope.quality import Quality
from gramoscope.signal_path import GrooveMotion
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import DriftingRotation, SpeedCurve

SPIRAL = Rotation(rpm=78.26, radius_m=0.0731, pitch_m=254e-6)
STEP_M = 3.9e-6


def tone(time_s, frequency_hz):
    return 0.03 * np.sin(2 * np.pi * frequency_hz * time_s + 0.4)


def motion_of(signal, *, start_m=-7.3e-6, step_m=STEP_M, length_m=0.083, rotation=SPIRAL):
    """The motion of a groove into which `signal(time_s)` was cut; the vertical motion is another sound."""
    arc = start_m + step_m * np.arange(int(length_m / step_m))
    time = rotation.time_of_arc_s(arc)
    return GrooveMotion(
        arc_start_m=start_m,
        arc_step_m=step_m,
        lateral_velocity_m_s=signal(time),
        lateral_sigma_m_s=1e-4 * (1 + time),
        vertical_velocity_m_s=tone(time, 777.0),
        vertical_sigma_m_s=np.full(arc.size, 3e-4),
        flags=np.zeros(arc.size, np.uint16),
    )


def cut(motion, *places):
    edges = [0, *places, motion.flags.size]
    for a, b in pairwise(edges):
        yield GrooveMotion(
            motion.arc_start_m + a * motion.arc_step_m,
            motion.arc_step_m,
            motion.lateral_velocity_m_s[a:b],
            motion.lateral_sigma_m_s[a:b],
            motion.vertical_velocity_m_s[a:b],
            motion.vertical_sigma_m_s[a:b],
            motion.flags[a:b],
        )


def joined(pieces, direction="lateral"):
    pieces = [getattr(piece, direction) for piece in pieces]
    assert pieces[0].start_sample == 0
    for before, after in pairwise(pieces):
        assert after.start_sample == before.start_sample + before.samples.size
    return replace(
        pieces[0],
        samples=np.concatenate([piece.samples for piece in pieces]),
        sigma=np.concatenate([piece.sigma for piece in pieces]),
        flags=np.concatenate([piece.flags for piece in pieces]),
    )


def error_db(sound, signal):
    """Level of the error against the closed form, away from the edges, below the signal."""
    clean = (sound.flags & Quality.EDGE) == 0
    exact = signal(np.arange(sound.samples.size) / sound.rate_hz)
    assert np.count_nonzero(clean) > 0.7 * clean.size
    return 20 * np.log10(np.std((sound.samples - exact)[clean]) / np.std(exact))


@pytest.mark.parametrize("step_m", [3.1e-6, 7.9e-6])
@pytest.mark.parametrize("rate_hz", [96_000.0, 48_000.0, 44_100.0])
@pytest.mark.parametrize("frequency_hz", [997.0, 10_000.0, 19_900.0])
def test_a_tone_cut_into_a_spiral_comes_out_at_its_pitch_phase_and_level(frequency_hz, rate_hz, step_m):
    """Ignoring the spiral would score −20 dB at 10 kHz, one sample of delay −4 dB."""
    motion = motion_of(lambda t: tone(t, frequency_hz), step_m=step_m)
    sound = joined(Resampler(SPIRAL, rate_hz=rate_hz).resample([motion]))
    assert error_db(sound, lambda t: tone(t, frequency_hz)) < -110


def test_what_the_output_cannot_carry_is_gone():
    motion = motion_of(lambda t: tone(t, 61_000.0), step_m=3.1e-6)
    sound = joined(Resampler(SPIRAL).resample([motion]))
    inside = sound.samples[(sound.flags & Quality.EDGE) == 0]
    assert np.max(np.abs(inside)) < 0.03e-5


def test_near_the_centre_the_grid_limits_the_band_and_nothing_is_mirrored():
    slow = Rotation(rpm=33.33, radius_m=0.06)
    motion = motion_of(lambda t: tone(t, 10_000.0), step_m=7.9e-6, rotation=slow)
    sound = joined(Resampler(slow).resample([motion]))
    assert slow.speed_at_m_s(0.0) / 7.9e-6 < 27_000
    assert error_db(sound, lambda t: tone(t, 10_000.0)) < -100


@pytest.mark.parametrize("places", [(1, 2, 3), (1000, 1001, 17_000), tuple(range(0, 21_000, 777)), (40, 40, 40)])
@pytest.mark.parametrize("direction", ["lateral", "vertical"])
def test_cutting_the_passage_into_pieces_changes_no_bit(places, direction):
    motion = motion_of(noise)
    whole = joined(Resampler(SPIRAL).resample([motion]), direction)
    parts = joined(Resampler(SPIRAL).resample(cut(motion, *places)), direction)
    for name in ("samples", "sigma", "flags"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


def noise(time_s):
    return 0.03 * np.random.default_rng(4).standard_normal(time_s.size)


@pytest.mark.parametrize("start_m", [-2.9e-4, -1.1e-6, 0.0, 1.7e-6, 9.1e-6, 2.3e-3])
def test_sample_0_is_s_0_wherever_the_grid_begins(start_m):
    motion = motion_of(lambda t: tone(t, 3000.0), start_m=start_m)
    sound = joined(Resampler(SPIRAL).resample([motion]))
    assert error_db(sound, lambda t: tone(t, 3000.0)) < -110
    end_m = start_m + motion.flags.size * STEP_M
    assert sound.samples.size == int(np.floor(SPIRAL.time_of_arc_s(end_m) * 96_000))
    before = np.arange(sound.samples.size) / 96_000 < SPIRAL.time_of_arc_s(start_m)
    np.testing.assert_array_equal((sound.flags & Quality.INTERPOLATED) != 0, before)


def test_before_a_grid_that_begins_late_its_first_value_is_held():
    motion = motion_of(lambda t: tone(t, 3000.0), start_m=2.3e-3)
    sound = joined(Resampler(SPIRAL).resample([motion]))
    np.testing.assert_allclose(sound.samples[:90], motion.lateral_velocity_m_s[0], rtol=1e-4)
    np.testing.assert_array_equal(sound.sigma[:90], motion.lateral_sigma_m_s[0])


def test_edges_are_flagged_and_stay_in_the_neighbourhood_of_the_truth():
    sound = joined(Resampler(SPIRAL).resample([motion_of(lambda t: tone(t, 500.0))]))
    edge = (sound.flags & Quality.EDGE) != 0
    assert edge[0]
    assert edge[-1]
    assert 150 < np.count_nonzero(edge) < 190
    exact = tone(np.arange(edge.size) / 96_000, 500.0)
    assert np.max(np.abs(sound.samples - exact)) < 0.03 * 0.03


def test_the_vertical_motion_comes_beside_the_lateral():
    motion = motion_of(lambda t: tone(t, 3000.0))
    sound = joined(Resampler(SPIRAL).resample([motion]), "vertical")
    assert error_db(sound, lambda t: tone(t, 777.0)) < -110
    np.testing.assert_allclose(sound.sigma, 3e-4)
    assert [direction_of_cut(cut) for cut in ("lateral", "vertical", "stereo")] == ["lateral", "vertical", "lateral"]


def test_sigma_keeps_its_size_and_its_place():
    sound = joined(Resampler(SPIRAL).resample([motion_of(lambda t: tone(t, 3000.0))]))
    time = np.arange(sound.samples.size) / 96_000
    np.testing.assert_allclose(sound.sigma[:-2], 1e-4 * (1 + time[:-2]), rtol=1e-7)


@pytest.mark.parametrize("step_m", [3.1e-6, 7.9e-6])
def test_flags_stay_where_the_groove_is_bad(step_m):
    motion = motion_of(lambda t: tone(t, 3000.0), step_m=step_m)
    flags = motion.flags.copy()
    bad = slice(5000, 5060)
    flags[bad] = Quality.NO_STRIPE | Quality.INTERPOLATED
    sound = joined(Resampler(SPIRAL).resample([replace(motion, flags=flags)]))
    place = (SPIRAL.arc_of_time_m(np.arange(sound.samples.size) / 96_000) - motion.arc_start_m) / step_m
    flagged = (sound.flags & Quality.NO_STRIPE) != 0
    assert np.all(flagged[(place >= 5000) & (place <= 5059)])
    assert not np.any(flagged[(place < 4997) | (place > 5062)])
    assert np.all((sound.flags[flagged] & Quality.INTERPOLATED) != 0)


def test_one_flagged_grid_sample_is_never_lost_between_two_samples_of_sound():
    motion = motion_of(lambda t: tone(t, 3000.0), step_m=3.1e-6)
    flags = motion.flags.copy()
    lonely = np.arange(997, 20_000, 997)
    flags[lonely] = Quality.OUTLIER
    sound = joined(Resampler(SPIRAL, rate_hz=48_000).resample([replace(motion, flags=flags)]))
    starts = np.diff(((sound.flags & Quality.OUTLIER) != 0).astype(int)) == 1
    assert np.count_nonzero(starts) == lonely.size


def test_a_nan_counts_as_nothing_and_is_flagged():
    motion = motion_of(lambda t: tone(t, 3000.0))
    velocity = motion.lateral_velocity_m_s.copy()
    velocity[9000:9010] = np.nan
    pieces = list(Resampler(SPIRAL).resample([replace(motion, lateral_velocity_m_s=velocity)]))
    sound = joined(pieces)
    assert np.all(np.isfinite(sound.samples))
    assert 4 <= np.count_nonzero((sound.flags & Quality.INTERPOLATED) != 0) <= 9
    assert not np.any((joined(pieces, "vertical").flags & Quality.INTERPOLATED) != 0), "the other direction is fine"


def test_a_gap_or_another_step_is_refused():
    first, second, third = cut(motion_of(noise), 5000, 6000)
    with pytest.raises(ArgumentError, match="where the last one ended"):
        list(Resampler(SPIRAL).resample([first, third]))
    with pytest.raises(ArgumentError, match="as before"):
        list(Resampler(SPIRAL).resample([first, replace(second, arc_step_m=4e-6)]))


@pytest.mark.parametrize("wrong", [{"rate_hz": 0.0}, {"passband": 1.0}])
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(ArgumentError):
        Resampler(SPIRAL, **wrong)


def test_no_motion_is_no_sound():
    assert list(Resampler(SPIRAL).resample([])) == []


def test_sound_comes_out_while_the_groove_still_comes_in():
    pieces = cut(motion_of(noise), *range(2000, 20_000, 2000))
    taken = []

    def watched():
        for piece in pieces:
            taken.append(piece)
            yield piece

    next(Resampler(SPIRAL).resample(watched()))
    assert len(taken) == 1


def test_the_history_tells_grid_rate_and_speed():
    (line,) = joined(Resampler(SPIRAL).resample([motion_of(noise)])).history
    assert line == "lateral motion resampled from every 3.9 µm to 96000 Hz at 78.26 rpm"


LINEAR_DRIFT = DriftingRotation.following(SpeedCurve((0.0, 0.02, 0.1), (78.0, 78.26, 86.0)), SPIRAL)


@pytest.mark.parametrize("rate_hz", [96_000.0, 44_100.0])
def test_a_tone_cut_by_a_lathe_that_ran_faster_and_faster_comes_out_straight(rate_hz):
    """With 78 rpm throughout it would score +3 dB: nothing of it fits."""
    motion = motion_of(lambda t: tone(t, 10_000.0), rotation=LINEAR_DRIFT)
    sound = joined(Resampler(LINEAR_DRIFT, rate_hz=rate_hz).resample([motion]))
    assert error_db(sound, lambda t: tone(t, 10_000.0)) < -110
    assert sound.samples.size == int(np.floor(LINEAR_DRIFT.time_of_arc_s(-7.3e-6 + 21_282 * STEP_M) * rate_hz))
    assert "78 to 86 rpm by a curve of 3 points" in sound.history[0]
    straight = joined(Resampler(replace(SPIRAL, rpm=78.0), rate_hz=rate_hz).resample([motion]))
    assert error_db(straight, lambda t: tone(t, 10_000.0)) > -3


def test_under_a_speed_curve_too_cutting_into_pieces_changes_no_bit():
    motion = motion_of(noise, rotation=LINEAR_DRIFT)
    whole = joined(Resampler(LINEAR_DRIFT).resample([motion]))
    parts = joined(Resampler(LINEAR_DRIFT).resample(cut(motion, *range(1, 21_000, 1777))))
    for name in ("samples", "sigma", "flags"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
