"""A copy with a known gain, delay, polarity and noise is told for what it is, and nonsense scores as nonsense."""

from __future__ import annotations

import json

import numpy as np
import pytest
import soxr

from gramoscope.conventions import FloatArray
from gramoscope.errors import ArgumentError, SoundError
from gramoscope.listening.align import band_passed, band_response, delay_samples, pearson_r
from gramoscope.listening.compare import compare
from gramoscope.listening.pair import mask_at_rate
from gramoscope.listening.report import json_text

RATE_HZ = 44_100.0
COUNT = 40_009


def _noise(seed: int, *, count: int = COUNT, band_hz: tuple[float, float] = (150.0, 12_000.0)) -> FloatArray:
    white = np.random.default_rng(seed).standard_normal(count)
    noise = band_passed(white, rate_hz=RATE_HZ, band_hz=band_hz)
    return noise / noise.std()


def _music(*, start_s: float = 0.0, count: int = COUNT, rate_hz: float = RATE_HZ) -> FloatArray:
    """A closed form that can be sampled anywhere: tones that swell and fade, with an offset."""
    time_s = start_s + np.arange(count) / rate_hz
    tones = [(311.0, 0.7, 3.1), (523.3, 0.4, 4.7), (1_234.5, 0.3, 7.9), (2_891.0, 0.2, 5.3), (6_007.0, 0.1, 2.3)]
    return 0.2 + sum(
        level * (1.1 + np.sin(swell * time_s)) * np.sin(2 * np.pi * pitch_hz * time_s + swell)
        for pitch_hz, level, swell in tones
    )


def test_a_copy_is_itself() -> None:
    music = _music()
    same = compare(music, RATE_HZ, music, RATE_HZ)
    assert same.waveform_r == same.waveform_r_unaligned == pytest.approx(1.0, abs=1e-12)
    assert same.envelope_r == pytest.approx(1.0, abs=1e-9)
    assert (same.delay_s, same.polarity, same.notes) == (pytest.approx(0.0, abs=1e-12), 1, ())
    assert same.snr_db > 200


@pytest.mark.parametrize("delay", [0.0, 0.37, -0.5, 12.0, 311.62, -1_043.21])
@pytest.mark.parametrize("gain", [2.5, -0.04])
def test_gain_delay_and_polarity_are_found_to_a_thousandth_of_a_sample(delay: float, gain: float) -> None:
    b = gain * _music(start_s=-delay / RATE_HZ, count=COUNT - 777)
    found = compare(_music(), RATE_HZ, b, RATE_HZ, trim_s=0.01)
    assert found.delay_s * RATE_HZ == pytest.approx(delay, abs=1e-3)
    assert found.gain_db == pytest.approx(20 * np.log10(abs(gain)), abs=1e-3)
    assert found.polarity == np.sign(gain)
    assert found.snr_db > 70
    assert found.span_start_s == pytest.approx(0.01 + max(0, -delay) / RATE_HZ, abs=1 / RATE_HZ)


def test_nothing_aligned_shows_a_wrong_polarity() -> None:
    found = compare(_music(), RATE_HZ, -_music(), RATE_HZ)
    assert found.waveform_r == pytest.approx(1.0)
    assert found.waveform_r_unaligned == pytest.approx(-1.0)


def test_nothing_aligned_shows_a_wrong_time_zero() -> None:
    noise = _noise(2)
    found = compare(noise[:-50], RATE_HZ, noise[50:], RATE_HZ)
    assert found.delay_s * RATE_HZ == pytest.approx(-50, abs=1e-3)
    assert found.waveform_r > 0.9999
    assert abs(found.waveform_r_unaligned) < 0.1


@pytest.mark.parametrize("snr_db", [-6.0, 0.0, 4.3, 12.0, 31.0])
def test_added_noise_is_measured_to_a_fifth_of_a_decibel(snr_db: float) -> None:
    sound, noise = _noise(3), 10 ** (-snr_db / 20) * _noise(4)
    found = compare(sound, RATE_HZ, -3.0 * (sound + noise), RATE_HZ, band_hz=(200.0, 10_000.0))
    assert found.snr_db == pytest.approx(snr_db, abs=0.2)
    r = np.sqrt(1 / (1 + 10 ** (-snr_db / 10)))
    assert found.waveform_r == pytest.approx(r, abs=0.01)
    assert found.octave_snr_db.keys() == {250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0}
    assert found.octave_snr_db[4000.0] == pytest.approx(snr_db, abs=0.3)


def test_white_noise_under_a_pink_sound_falls_three_decibels_an_octave() -> None:
    white = np.random.default_rng(6).standard_normal((2, 2 * COUNT))
    spectrum = np.fft.rfft(white[0])
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    pink = np.fft.irfft(spectrum, 2 * COUNT)
    found = compare(pink, RATE_HZ, pink + 0.001 * white[1], RATE_HZ, band_hz=(100.0, 15_000.0))
    octaves = np.array(list(found.octave_snr_db.values()))
    assert np.diff(octaves)[1:-1] == pytest.approx(-3.01, abs=0.5)


def test_the_ratio_is_that_of_pearson_and_the_same_both_ways() -> None:
    sound, noise = _noise(3), 0.3 * _noise(4)
    there = compare(sound, RATE_HZ, sound + noise, RATE_HZ)
    back = compare(sound + noise, RATE_HZ, sound, RATE_HZ)
    assert there.snr_db == pytest.approx(back.snr_db, abs=1e-3)
    share = there.waveform_r**2
    assert there.snr_db == pytest.approx(10 * np.log10(share / (1 - share)), abs=0.01)


def test_unrelated_noise_scores_nothing() -> None:
    found = compare(_noise(7), RATE_HZ, _noise(8), RATE_HZ)
    assert found.waveform_r < 0.05
    assert abs(found.waveform_r_unaligned) < 0.05
    assert found.snr_db < -20
    assert abs(found.envelope_r) < 0.3


def test_the_unit_of_either_sound_does_not_matter() -> None:
    a, b = _noise(3), _noise(3) + 0.3 * _noise(4)
    plain, scaled = compare(a, RATE_HZ, b, RATE_HZ), compare(1e6 * a, RATE_HZ, 1e-6 * b, RATE_HZ)
    assert scaled.snr_db == pytest.approx(plain.snr_db, abs=1e-6)
    assert scaled.waveform_r == pytest.approx(plain.waveform_r, abs=1e-9)
    assert scaled.gain_db == pytest.approx(plain.gain_db - 240, abs=1e-6)


def test_what_lies_outside_the_band_does_not_count() -> None:
    a = _noise(3, band_hz=(900.0, 3_000.0))
    time_s = np.arange(COUNT) / RATE_HZ
    b = a + 9.0 * np.sin(2 * np.pi * 41.0 * time_s) + 0.5 + np.sin(2 * np.pi * 19_500 * time_s)
    assert compare(a, RATE_HZ, b, RATE_HZ, band_hz=(500.0, 6_000.0), trim_s=0.01).snr_db > 50
    assert compare(a, RATE_HZ, b, RATE_HZ, band_hz=(20.0, 20_000.0)).snr_db < -10


@pytest.mark.parametrize(
    ("rate_a_hz", "rate_b_hz"), [(96_000.0, 44_100.0), (44_100.0, 96_000.0), (2_404_700.5, 48_000.0)]
)
def test_sounds_of_different_rates_are_compared_at_the_lower_one(rate_a_hz: float, rate_b_hz: float) -> None:
    seconds, delay_s = 0.31, 0.00123456
    a = _music(count=round(seconds * rate_a_hz), rate_hz=rate_a_hz)
    b = _music(start_s=-delay_s, count=round(seconds * rate_b_hz), rate_hz=rate_b_hz)
    found = compare(a, rate_a_hz, b, rate_b_hz, trim_s=0.01)
    assert found.delay_s == pytest.approx(delay_s, abs=2e-8)
    assert found.snr_db > 55
    assert found.rate_hz == min(rate_a_hz, rate_b_hz)
    assert "compared at" in found.notes[0]


def test_a_resampled_sound_has_no_delay() -> None:
    a = _noise(9)
    b = soxr.resample(a, RATE_HZ, 96_000)
    assert compare(a, RATE_HZ, b, 96_000).delay_s == pytest.approx(0, abs=1e-8)


def test_a_low_rate_cuts_the_band_and_says_so() -> None:
    a = _music(rate_hz=11_025.0)
    found = compare(a, 11_025.0, a, 11_025.0)
    assert found.band_hz == (200.0, pytest.approx(0.95 * 11_025 / 2))
    assert max(found.octave_snr_db) == 2_000.0
    assert "band ends at" in found.notes[0]


def test_a_short_span_has_no_low_octaves() -> None:
    a = _noise(3, count=440)
    found = compare(a, RATE_HZ, a, RATE_HZ)
    assert min(found.octave_snr_db) == 250.0
    assert min(compare(a, RATE_HZ, a, RATE_HZ, trim_s=0.0024).octave_snr_db) == 500.0


def test_trimmed_ends_do_not_count() -> None:
    a, b = _noise(3), _noise(3)
    b[:400] = _noise(4)[:400]
    b[-300:] = 0
    found = compare(a, RATE_HZ, b, RATE_HZ, trim_s=0.012)
    assert found.snr_db > 45
    assert found.span_s == pytest.approx(COUNT / RATE_HZ - 0.024, abs=2 / RATE_HZ)
    assert found.span_start_s == pytest.approx(0.012, abs=1 / RATE_HZ)


def test_masked_samples_do_not_count_and_may_be_no_numbers() -> None:
    a = _noise(3)
    b = 0.5 * a + 0.05 * _noise(4)
    bad, mask = b.copy(), np.zeros(COUNT, bool)
    bad[7_000:9_000] = np.nan
    mask[6_900:9_100] = True
    found = compare(a, RATE_HZ, bad, RATE_HZ, mask=mask)
    assert found.snr_db == pytest.approx(20, abs=0.2)
    assert found.gain_db == pytest.approx(-6.02, abs=0.02)
    assert found.masked_share == pytest.approx(2_200 / COUNT, abs=1e-4)
    assert np.isnan(bad[7_500]), "the input was modified"
    with pytest.raises(SoundError, match="2000 samples of sound b"):
        compare(a, RATE_HZ, bad, RATE_HZ)


def test_a_masked_bang_leaves_the_envelope_alone() -> None:
    a = _music()
    b, mask = a.copy(), np.zeros(COUNT, bool)
    b[9_000:9_050] += 40.0
    mask[8_300:9_750] = True
    assert compare(a, RATE_HZ, b, RATE_HZ, mask=mask).envelope_r > 0.999
    assert compare(a, RATE_HZ, b, RATE_HZ).envelope_r < 0.5


@pytest.mark.parametrize("new_rate_hz", [30_000.0, 96_000.0])
def test_a_mask_hides_every_new_sample_that_hears_a_hidden_one(new_rate_hz: float) -> None:
    hidden = np.zeros(1_000, bool)
    hidden_at = np.array([100, 251, 252, 404, 600, 777])
    hidden[hidden_at] = True
    mask = mask_at_rate(hidden, RATE_HZ, new_rate_hz, count=round(1_000 * new_rate_hz / RATE_HZ))
    places = np.arange(len(mask)) * RATE_HZ / new_rate_hz
    nearest = np.min(np.abs(places[:, np.newaxis] - hidden_at), axis=1)
    assert mask.tolist() == (nearest <= max(1.0, RATE_HZ / new_rate_hz) / 2).tolist()


def test_several_channels_are_averaged_or_one_is_taken() -> None:
    left, right = _noise(3), _noise(4)
    stereo = np.stack([left, right], axis=1)
    assert compare((left + right) / 2, RATE_HZ, stereo, RATE_HZ).snr_db > 200
    found = compare(right, RATE_HZ, stereo, RATE_HZ, channel=1)
    assert found.snr_db > 200
    assert "channel 1" in found.notes[0]
    with pytest.raises(ArgumentError, match="channel 2"):
        compare(right, RATE_HZ, stereo, RATE_HZ, channel=2)


def test_without_looking_for_a_delay_the_sounds_are_taken_as_they_lie() -> None:
    noise = _noise(2)
    found = compare(noise[:-5], RATE_HZ, noise[5:], RATE_HZ, max_delay_s=0)
    assert found.delay_s == 0
    assert found.waveform_r == pytest.approx(abs(found.waveform_r_unaligned))
    assert found.waveform_r < 0.9


def test_silence_and_crumbs_are_sound_errors_with_a_remedy() -> None:
    music = _music()
    for wrong, words in [(np.zeros(COUNT), "silent"), (np.full(COUNT, 0.3), "silent"), (music[:30], "can be compared")]:
        with pytest.raises(SoundError, match=words) as caught:
            compare(music, RATE_HZ, wrong, RATE_HZ)
        assert caught.value.remedy
    with pytest.raises(SoundError, match="can be compared"):
        compare(music, RATE_HZ, music, RATE_HZ, trim_s=1.0)
    with pytest.raises(SoundError, match="can be compared"):
        compare(music, RATE_HZ, music, RATE_HZ, mask=np.ones(COUNT, bool))
    with pytest.raises(SoundError, match="the band begins"):
        compare(music, 300.0, music, 300.0)


@pytest.mark.parametrize(
    "wrong", [{"band_hz": (900.0, 90.0)}, {"trim_s": -1.0}, {"max_delay_s": -0.1}, {"mask": np.zeros(3, bool)}]
)
def test_impossible_arguments_are_argument_errors(wrong: dict[str, object]) -> None:
    with pytest.raises(ArgumentError):
        compare(_music(), RATE_HZ, _music(), RATE_HZ, **wrong)  # type: ignore[arg-type]


def test_the_result_goes_into_a_report() -> None:
    found = compare(_noise(3), RATE_HZ, _noise(3) + _noise(4), RATE_HZ)
    report = json.loads(json_text(found.as_dict()))
    assert report["waveform_r"] == found.waveform_r
    assert report["octave_snr_db"]["8000"] == found.octave_snr_db[8000.0]
    assert report["band_hz"] == [200.0, 10_000.0]


def test_the_band_passes_half_at_its_edges_and_nothing_at_zero() -> None:
    response = band_response(np.array([0.0, 200.0, 1_400.0, 10_000.0, 20_000.0]), band_hz=(200.0, 10_000.0))
    assert response == pytest.approx([0, 0.5, 1, 0.5, 1 / 257], abs=1e-4)


def test_the_filter_moves_nothing_and_advances_by_what_is_asked() -> None:
    advance_s = 3.3 / RATE_HZ
    moved = band_passed(_music(), rate_hz=RATE_HZ, band_hz=(50.0, 20_000.0), advance_s=advance_s)
    inside = slice(3_000, -3_000)
    assert moved[inside] == pytest.approx((_music(start_s=advance_s) - 0.2)[inside], abs=1e-3)


def test_the_filter_agrees_with_butterworth_run_forwards_and_backwards() -> None:
    from scipy.signal import butter, sosfiltfilt

    white = np.random.default_rng(1).standard_normal(9_001)
    ours = band_passed(white, rate_hz=384_000.0, band_hz=(3_000.0, 10_000.0))
    low = butter(4, 10_000, "low", fs=384_000, output="sos")
    high = butter(4, 3_000, "high", fs=384_000, output="sos")
    theirs = sosfiltfilt(low, sosfiltfilt(high, white))
    # the bilinear transform bends theirs a little
    assert ours[1_500:-1_500] == pytest.approx(theirs[1_500:-1_500], abs=0.01 * theirs.std())


def test_the_delay_of_the_correlation_is_the_delay() -> None:
    music = _noise(5)
    assert delay_samples(music[100:], music[:-100], max_lag=300) == pytest.approx(100, abs=1e-3)
    assert delay_samples(music[:-100], -music[100:], max_lag=300) == pytest.approx(-100, abs=1e-3)
    assert delay_samples(music[100:], music[:-100], max_lag=0) == 0
    moved = band_passed(music, rate_hz=RATE_HZ, band_hz=(1.0, 22_000.0), advance_s=-0.43 / RATE_HZ)
    assert delay_samples(music, moved, max_lag=300) == pytest.approx(0.43, abs=1e-3)


def test_a_filter_finds_no_step_where_a_sound_begins_and_ends() -> None:
    time_s = np.arange(4_411) / RATE_HZ  # whole periods, so that the point reflection is the tone's own continuation
    tone = np.sin(2 * np.pi * 700 * time_s)
    passed = band_passed(tone, rate_hz=RATE_HZ, band_hz=(150.0, 9_000.0))
    assert passed == pytest.approx(tone, abs=2e-3)


def test_pearson_agrees_with_numpy_and_knows_no_constant() -> None:
    a, b = _noise(1)[:500] + 3, _noise(2)[:500] - 7
    assert pearson_r(a, b) == pytest.approx(float(np.corrcoef(a, b)[0, 1]), abs=1e-12)
    assert np.isnan(pearson_r(a, np.full(500, 2.0)))


def test_what_is_trimmed_does_not_ring_into_the_rest() -> None:
    rng = np.random.default_rng(4)
    sound = np.cumsum(rng.standard_normal(4800))
    copy = sound + 1e-3 * np.std(sound) * rng.standard_normal(4800)
    spoilt = copy.copy()
    spoilt[[0, 1, -1]] += 3 * np.std(sound)
    whole = compare(sound, 96e3, copy, 96e3, trim_s=0.002, max_delay_s=0)
    ends = compare(sound, 96e3, spoilt, 96e3, trim_s=0.002, max_delay_s=0)
    assert ends.snr_db == pytest.approx(whole.snr_db, abs=0.1)
