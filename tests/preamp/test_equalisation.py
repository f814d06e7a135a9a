"""The equaliser as a part: pieces, flags, error bars, arguments."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gramoscope.disc.characteristic_filter import playback_filter
from gramoscope.disc.characteristics import FLAT, RIAA, characteristic
from gramoscope.errors import ArgumentError
from gramoscope.preamp.equalisation import Equaliser
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio

RATE_HZ = 96_000.0


def a_sound(count=4001, *, start=7):
    rng = np.random.default_rng(count)
    return Audio(
        start_sample=start,
        rate_hz=RATE_HZ,
        samples=0.03 * rng.standard_normal(count),
        sigma=rng.uniform(1e-4, 2e-4, count),
        flags=rng.choice([0, int(Quality.SPARSE), int(Quality.NO_STRIPE)], count).astype(np.uint16),
        history=("read from a groove",),
    )


def cut(sound, *places):
    edges = [0, *places, sound.samples.size]
    for a, b in pairwise(edges):
        yield replace(
            sound,
            start_sample=sound.start_sample + a,
            samples=sound.samples[a:b],
            sigma=sound.sigma[a:b],
            flags=sound.flags[a:b],
        )


def joined(pieces):
    pieces = list(pieces)
    for before, after in pairwise(pieces):
        assert after.start_sample == before.start_sample + before.samples.size
    return replace(
        pieces[0],
        samples=np.concatenate([piece.samples for piece in pieces]),
        sigma=np.concatenate([piece.sigma for piece in pieces]),
        flags=np.concatenate([piece.flags for piece in pieces]),
    )


@pytest.mark.parametrize("places", [(1, 2, 3), (30, 31, 64, 65, 3990), tuple(range(0, 4001, 37)), (5, 5, 5)])
@pytest.mark.parametrize("curve", [RIAA, FLAT, characteristic("blumlein")])
def test_cutting_the_sound_into_pieces_changes_no_bit(curve, places):
    sound = a_sound()
    whole = joined(Equaliser(curve).equalise([sound]))
    parts = joined(Equaliser(curve).equalise(cut(sound, *places)))
    for name in ("samples", "sigma", "flags"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert parts.start_sample == sound.start_sample
    assert parts.samples.shape == sound.samples.shape


def test_it_filters_as_the_filter_says_and_keeps_flags_in_place():
    sound = a_sound()
    played = joined(Equaliser(RIAA).equalise([sound]))
    np.testing.assert_array_equal(played.samples, playback_filter(RIAA, rate_hz=RATE_HZ).apply(sound.samples))
    np.testing.assert_array_equal(played.flags, sound.flags)


def test_flat_passes_every_sample_untouched_and_says_so():
    sound = a_sound()
    played = joined(Equaliser(FLAT).equalise(cut(sound, 100)))
    np.testing.assert_array_equal(played.samples, sound.samples)
    np.testing.assert_allclose(played.sigma, sound.sigma, rtol=1e-12)
    assert played.history == ("read from a groove", "not equalised (flat)")


def test_the_history_names_curve_and_corners():
    (*_, line) = joined(Equaliser(RIAA).equalise([a_sound()])).history
    assert "RIAA" in line
    assert "shelf 50.05 Hz, turnover 500.5 Hz, roll-off 2122 Hz" in line


def test_a_passage_shorter_than_the_look_ahead_survives():
    sound = a_sound(5)
    played = joined(Equaliser(RIAA).equalise(cut(sound, 2)))
    np.testing.assert_array_equal(played.samples, playback_filter(RIAA, rate_hz=RATE_HZ).apply(sound.samples))
    assert list(Equaliser(RIAA).equalise([])) == []


def test_the_claimed_error_is_the_real_one_for_noise_that_is_flat_in_the_audio_band():
    rng = np.random.default_rng(1)
    f = np.fft.rfftfreq(384_000, 1 / RATE_HZ)
    noise = np.fft.irfft(np.where((f > 20) & (f < 20_000), np.fft.rfft(rng.standard_normal(384_000)), 0))
    sound = Audio(0, RATE_HZ, noise, np.full(noise.size, np.std(noise)), np.zeros(noise.size, np.uint16))
    for name in ("aes", "riaa", "columbia-lp"):
        played = joined(Equaliser(characteristic(name)).equalise([sound]))
        assert np.std(played.samples) == pytest.approx(played.sigma[0], rel=0.05)


def test_a_nan_is_flagged_and_does_not_spread():
    sound = a_sound()
    samples = sound.samples.copy()
    samples[1234] = np.nan
    played = joined(Equaliser(RIAA).equalise([replace(sound, samples=samples)]))
    assert np.all(np.isfinite(played.samples))
    assert np.flatnonzero(played.flags & Quality.INTERPOLATED).tolist() == [1234]
    assert np.isnan(samples[1234])


def test_a_gap_or_another_rate_is_refused():
    first, second, third = cut(a_sound(), 1000, 2000)
    with pytest.raises(ArgumentError, match="starts at sample 2007"):
        list(Equaliser().equalise([first, third]))
    with pytest.raises(ArgumentError, match="48000 Hz after one at 96000"):
        list(Equaliser().equalise([first, replace(second, rate_hz=48_000.0)]))


def test_only_the_look_ahead_is_held_back():
    pieces = Equaliser(RIAA).equalise(cut(a_sound(), 1000))
    assert next(pieces).samples.size == 1000 - playback_filter(RIAA, rate_hz=RATE_HZ).look_ahead
