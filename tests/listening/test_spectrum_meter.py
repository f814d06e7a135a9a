"""The streaming spectrum is Welch's, whatever the pieces; bands are those of the standard."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import welch

from gramoscope.errors import ArgumentError
from gramoscope.listening.bands import Bands, band_power, octaves, third_octaves, usable_to_hz
from gramoscope.listening.spectrum_meter import SpectrumMeter, segment_for

RATE_HZ = 96_000.0


def _meter(samples: np.ndarray, cuts: list[int], segment: int, measured: np.ndarray | None = None) -> SpectrumMeter:
    meter = SpectrumMeter(RATE_HZ, segment)
    seen = np.ones(samples.size, np.bool_) if measured is None else measured
    for a, b in itertools.pairwise([0, *sorted(min(cut, samples.size) for cut in cuts), samples.size]):
        meter.add(samples[a:b], seen[a:b])
    return meter


def test_it_is_the_spectrum_that_scipy_finds() -> None:
    samples = np.random.default_rng(1).normal(0.2, 0.01, 5000)
    frequency, density = _meter(samples, [700, 701, 3300], 512).density()
    expected = welch(samples, RATE_HZ, nperseg=512)
    np.testing.assert_allclose(frequency, expected[0])
    np.testing.assert_allclose(density, expected[1], rtol=1e-9)


@settings(deadline=None)
@given(st.lists(st.integers(0, 3000), max_size=7))
def test_not_a_bit_depends_on_how_the_sound_is_cut(cuts: list[int]) -> None:
    rng = np.random.default_rng(2)
    samples, measured = rng.normal(size=3000), rng.random(3000) < 0.97
    whole, parts = _meter(samples, [], 128, measured), _meter(samples, cuts, 128, measured)
    assert (whole.segments, whole.left_out) == (parts.segments, parts.left_out)
    np.testing.assert_array_equal(whole.density()[1], parts.density()[1])


def test_segments_that_were_hardly_measured_do_not_count() -> None:
    samples = np.random.default_rng(3).normal(size=2048)
    measured = np.ones(2048, np.bool_)
    samples[1024:1100], measured[1024:1100] = 1e6, False
    meter = _meter(samples, [], 256, measured)
    # those that begin at 896 and at 1024 hold it
    assert (meter.segments, meter.left_out) == (13, 2)
    assert meter.density()[1].max() < 1.0


def test_before_anything_counts_the_density_is_unknown() -> None:
    assert np.isnan(SpectrumMeter(RATE_HZ, 64).density()[1]).all()
    with pytest.raises(ArgumentError, match="63 samples"):
        SpectrumMeter(RATE_HZ, 63)


@pytest.mark.parametrize(("samples", "segment"), [(0.0, 64), (100, 64), (1539, 512), (4e4, 8192), (1e9, 8192)])
def test_segments_fit_twice_into_a_short_sound(samples: float, segment: int) -> None:
    assert segment_for(samples) == segment


def test_bands_are_those_of_iec_61260() -> None:
    thirds, whole = third_octaves(48_000.0), octaves(48_000.0)
    np.testing.assert_allclose(thirds.centre_hz[:9], [20, 25, 31.5, 40, 50, 63, 80, 100, 125])
    np.testing.assert_allclose(whole.centre_hz, [31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000, 16_000, 31_500])
    k = int(np.flatnonzero(thirds.centre_hz == 1000)[0])
    np.testing.assert_allclose(thirds.edge_hz[k : k + 2], [891.25, 1122.02], rtol=1e-5)
    np.testing.assert_allclose(whole.edge_hz[:2], thirds.edge_hz[[1, 4]])
    assert third_octaves(44_000.0).edge_hz[-1] <= 44_000.0 < third_octaves(1e6).edge_hz[-1]


def test_the_power_of_a_tone_is_in_its_band_and_that_of_noise_in_all() -> None:
    time = np.arange(96_000) / RATE_HZ
    tone = _meter(0.3 * np.sqrt(2) * np.sin(2 * np.pi * 1000 * time), [], 8192)
    power = band_power(*tone.density(), octaves(44_000.0))
    assert np.sqrt(power[5]) == pytest.approx(0.3, rel=1e-3)
    assert np.delete(power, 5)[np.isfinite(np.delete(power, 5))].max() < 1e-6
    flat = np.full(200, 2.0)
    bands = third_octaves(15_000.0)
    found = band_power(np.arange(200) * 100.0, flat, bands)
    told = np.isfinite(found)
    np.testing.assert_allclose(found[told], 2.0 * np.diff(bands.edge_hz)[told])
    # a band must be as wide as the step of the frequencies
    assert bands.centre_hz[told].min() == 500.0


def test_the_usable_bandwidth_ends_at_the_first_bad_band_above_the_best() -> None:
    bands = Bands(np.array([1.0, 2.0, 4.0, 8.0, 16.0]), np.array([0.7, 1.4, 2.8, 5.6, 11.2, 22.4]))
    ratio = np.array([-3.0, 30.0, 12.0, 4.0, 11.0])
    assert usable_to_hz(bands, ratio, least_db=10.0) == 5.6
    assert usable_to_hz(bands, ratio, least_db=0.0) == 22.4
    assert np.isnan(usable_to_hz(bands, ratio, least_db=40.0))
    assert usable_to_hz(bands, np.where(ratio == 12, np.nan, ratio), least_db=0.0) == 2.8
