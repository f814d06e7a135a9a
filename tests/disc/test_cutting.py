"""From sound to winding groove, against closed forms."""

import numpy as np
import pytest

from gramoscope.conventions import stereo_of_motion
from gramoscope.disc.cutting import cut_sound
from gramoscope.errors import ArgumentError

RATE_HZ = 44_100.0
TIME_S = np.arange(9000) / RATE_HZ
SINE = 0.3 * np.sin(2 * np.pi * 730 * TIME_S + 0.4)
INSIDE_S = np.linspace(0.05, 0.15, 4001)


def test_a_sine_is_cut_with_the_level_asked_for_and_winds_by_velocity_over_angular_frequency() -> None:
    cutting = cut_sound(SINE, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral")
    velocity, vertical = cutting.velocity_at(INSIDE_S)
    displacement, _ = cutting.displacement_at(INSIDE_S)
    peak_m_s = 0.02 * np.sqrt(2)
    assert velocity.max() == pytest.approx(peak_m_s, rel=0.01)  # the fades take half a per cent of the power
    assert np.ptp(displacement) / 2 == pytest.approx(velocity.max() / (2 * np.pi * 730), rel=1e-3)
    assert not vertical.any()
    # polarity and time zero: the sound's own sine, scaled
    expected = velocity.max() * np.sin(2 * np.pi * 730 * INSIDE_S + 0.4)
    np.testing.assert_allclose(velocity, expected, atol=2e-3 * peak_m_s)


def test_displacement_is_the_integral_of_velocity() -> None:
    rng = np.random.default_rng(4)
    cutting = cut_sound(rng.standard_normal(3000), rate_hz=RATE_HZ, level_m_s=0.03, cut="vertical")
    time_s = np.linspace(0.011, 0.012, 20_001)
    step_s = time_s[1] - time_s[0]
    displacement, velocity = cutting.displacement_at(time_s)[1], cutting.velocity_at(time_s)[1]
    np.testing.assert_allclose(np.diff(displacement) / step_s, (velocity[1:] + velocity[:-1]) / 2, atol=1e-6)


def test_an_offset_of_the_sound_does_not_make_the_groove_wander() -> None:
    clean = cut_sound(SINE, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral")
    offset = cut_sound(SINE + 0.2, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral")
    # without the limit at 20 Hz an offset of 0.2 / 0.3 of the sine would take it half a millimetre away in 50 ms
    assert np.abs(offset.displacement_at(INSIDE_S)[0].mean() - clean.displacement_at(INSIDE_S)[0].mean()) < 5e-6
    at_rest = offset.displacement_at([-9.0, 9.0])[0]
    np.testing.assert_allclose(at_rest, 0, atol=1e-6)


@pytest.mark.parametrize("channel", [0, 1])
def test_a_single_channel_of_a_stereo_cut_moves_one_wall_only(channel: int) -> None:
    sound = np.zeros((len(SINE), 2))
    sound[:, channel] = SINE
    cutting = cut_sound(sound, rate_hz=RATE_HZ, level_m_s=0.02, cut="stereo")
    walls = stereo_of_motion(*cutting.velocity_at(INSIDE_S))
    assert np.abs(walls[1 - channel]).max() < 1e-12
    assert walls[channel].max() == pytest.approx(0.02 * np.sqrt(2), rel=0.01)


def test_equal_channels_are_a_lateral_cut_and_mono_cuts_take_the_mean() -> None:
    pair = np.stack([SINE, SINE], axis=1)
    reference = cut_sound(SINE, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral").velocity_at(INSIDE_S)
    for sound, cut in ((pair, "stereo"), (SINE, "stereo"), (pair * [1.4, 0.6], "lateral")):
        np.testing.assert_allclose(
            cut_sound(sound, rate_hz=RATE_HZ, level_m_s=0.02, cut=cut).velocity_at(INSIDE_S), reference, atol=1e-12
        )


def test_the_sound_is_left_as_it_was() -> None:
    before = SINE.copy()
    cut_sound(SINE, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral")
    np.testing.assert_array_equal(SINE, before)


@pytest.mark.parametrize("sound", [np.zeros(100), np.full(100, np.nan), np.ones(5), np.ones((100, 3))])
def test_a_sound_of_no_use_is_refused(sound: np.ndarray) -> None:
    with pytest.raises(ArgumentError):
        cut_sound(sound, rate_hz=RATE_HZ, level_m_s=0.02, cut="lateral")
