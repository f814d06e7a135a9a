"""The low-pass that reads a sampled signal between its samples."""

import numpy as np
import pytest

from gramoscope.preamp.interpolation import half_width, interpolate, interpolate_reference, low_pass, low_pass_table

PASSBAND = 0.91
TABLE, REACH = low_pass_table(PASSBAND), half_width(PASSBAND)


def at_places(samples, places, stretch):
    return interpolate(samples[np.newaxis], places, np.full(places.size, stretch), TABLE, REACH)[0]


def sine(frequency, places):
    return np.sin(2 * np.pi * frequency * places + 0.3)


def test_the_kernel_agrees_with_the_plain_sum_of_each_signal():
    rng = np.random.default_rng(5)
    samples = rng.standard_normal((2, 1501))
    places, stretch = rng.uniform(3, 1490, 60), rng.uniform(0.3, 1, 60)
    plain = [interpolate_reference(signal, places, stretch, passband=PASSBAND) for signal in samples]
    np.testing.assert_allclose(interpolate(samples, places, stretch, TABLE, REACH), plain, atol=3e-7)


@pytest.mark.parametrize("stretch", [1.0, 0.41])
@pytest.mark.parametrize("share", [0.002, 0.33, 0.8, 0.905])
def test_the_pass_band_is_exact_to_better_than_minus_110_db(stretch, share):
    places = np.random.default_rng(2).uniform(900, 2100, 300)
    frequency = share * stretch / 2
    error = at_places(sine(frequency, np.arange(3001)), places, stretch) - sine(frequency, places)
    assert np.max(np.abs(error)) < 10 ** (-110 / 20)


@pytest.mark.parametrize("share", [1.001, 1.07, 1.9, 2.3])
def test_the_stop_band_is_down_by_more_than_100_db(share):
    places = np.random.default_rng(2).uniform(900, 2100, 300)
    heard = at_places(sine(share * 0.41 / 2, np.arange(3001)), places, 0.41)
    assert np.max(np.abs(heard)) < 10 ** (-100 / 20)


def test_a_value_depends_on_its_own_surroundings_alone_to_the_last_bit():
    samples = np.random.default_rng(8).standard_normal(1200)
    places = np.random.default_rng(9).uniform(500, 600, 50)
    np.testing.assert_array_equal(at_places(samples, places, 0.7), at_places(samples[137:1001], places - 137, 0.7))


def test_the_response_is_even_and_ends():
    x = np.linspace(0.01, REACH + 3, 401)
    np.testing.assert_array_equal(low_pass(x, passband=PASSBAND), low_pass(-x, passband=PASSBAND))
    assert np.all(low_pass(x[x >= REACH], passband=PASSBAND) == 0)
