"""What surroundings say of a sample: against dense algebra, and against the samples that were hidden."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from gramoscope.preamp.autoregression import conditional, excitation_scale, fit, precision, times


def covariance(coefficients: np.ndarray, count: int) -> np.ndarray:
    """Of a stationary process with excitation of variance 1, by its impulse response."""
    response = lfilter([1.0], coefficients, np.eye(1, 4000)[0])
    return toeplitz([response[: response.size - lag] @ response[lag:] for lag in range(count)])


def dense(band: np.ndarray) -> np.ndarray:
    count, width = band.shape
    upper = sum(np.diag(band[: count - d, d], d) for d in range(width))
    return upper + np.triu(upper, 1).T


@pytest.mark.parametrize("count", [13, 14, 40])
def test_the_precision_is_the_inverse_of_the_covariance_to_both_ends(sounds: Any, count: int) -> None:
    band = precision(sounds.coefficients, count)
    product = dense(band) @ covariance(sounds.coefficients, count)
    np.testing.assert_allclose(product, np.eye(count), atol=1e-7)


def test_times_is_the_dense_product(sounds: Any) -> None:
    band = precision(sounds.coefficients, 31)
    x = np.random.default_rng(1).standard_normal(31)
    np.testing.assert_allclose(times(band, x), dense(band) @ x, rtol=1e-10, atol=1e-10)


UNKNOWN = np.array([0, 1, 11, 12, 13, 15, 22, 38, 39])


def test_unknown_samples_get_the_conditional_mean_and_variance_of_a_gaussian(sounds: Any) -> None:
    x = sounds.process(40, seed=3)
    full = covariance(sounds.coefficients, 40)
    known = np.setdiff1d(np.arange(40), UNKNOWN)
    gain = full[np.ix_(UNKNOWN, known)] @ np.linalg.inv(full[np.ix_(known, known)])
    expected = gain @ x[known]
    left = full[np.ix_(UNKNOWN, UNKNOWN)] - gain @ full[np.ix_(known, UNKNOWN)]
    mean, spread = conditional(precision(sounds.coefficients, 40), x, UNKNOWN, np.zeros((UNKNOWN.size, 1)))
    np.testing.assert_allclose(mean, expected, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(spread[:, 0], np.diag(left), rtol=1e-5)
    np.testing.assert_allclose(spread[3, 1], left[3, 4], rtol=1e-5)


def test_what_was_measured_there_counts_by_its_weight(sounds: Any) -> None:
    x = sounds.process(40, seed=4)
    weight = np.random.default_rng(2).uniform(0.5, 3, (UNKNOWN.size, 1))
    band = precision(sounds.coefficients, 40)
    known = np.where(np.isin(np.arange(40), UNKNOWN), 0.0, x)
    system = dense(band)[np.ix_(UNKNOWN, UNKNOWN)] + np.diag(weight[:, 0])
    expected = np.linalg.solve(system, weight[:, 0] * x[UNKNOWN] - (dense(band) @ known)[UNKNOWN])
    mean, spread = conditional(band, x, UNKNOWN, weight)
    np.testing.assert_allclose(mean, expected, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(spread[:, 0], np.diag(np.linalg.inv(system)), rtol=1e-8)


def test_the_claimed_errors_of_hidden_samples_are_their_real_ones(sounds: Any) -> None:
    x = sounds.process(120_000, seed=5)
    unknown = (np.arange(50, 119_900, 60)[:, np.newaxis] + np.arange(12)).ravel()
    mean, spread = conditional(precision(sounds.coefficients, x.size), x, unknown, np.zeros((unknown.size, 1)))
    pull = (mean - x[unknown]) / (sounds.scale_m_s * np.sqrt(spread[:, 0]))
    assert np.std(pull) == pytest.approx(1, abs=0.05)
    # to fill in the mean of the sound, zero, would be more than twice as wrong
    assert np.std(x[unknown]) > 2.5 * np.std(mean - x[unknown])


def test_the_samples_that_do_not_count_may_be_anything(sounds: Any) -> None:
    x = sounds.process(200)
    spoilt = x.copy()
    spoilt[60:70] = 1e3
    index, nothing = np.arange(60, 70), np.zeros((10, 1))
    band = precision(sounds.coefficients, 200)
    np.testing.assert_array_equal(conditional(band, spoilt, index, nothing)[0], conditional(band, x, index, nothing)[0])
    assert spoilt[65] == 1e3


def test_a_process_is_found_by_what_it_sounds_like(sounds: Any) -> None:
    x = sounds.process(40_000, seed=6)
    found = fit(x, order=6)
    np.testing.assert_allclose(found, sounds.coefficients, atol=0.05)
    used = np.ones(x.size, bool)
    assert np.mean(excitation_scale(x, found, used=used)) == pytest.approx(sounds.scale_m_s, rel=0.03)


def test_clicks_hardly_move_the_scale(sounds: Any) -> None:
    x = sounds.process(10_000, seed=7)
    spoilt = sounds.with_bursts(x, range(100, 10_000, 600), length=10, height=0.1)
    used = np.ones(x.size, bool)
    clean = np.mean(excitation_scale(x, sounds.coefficients, used=used))
    assert np.mean(excitation_scale(spoilt, sounds.coefficients, used=used)) == pytest.approx(clean, rel=0.06)


def test_silence_is_a_process_without_memory() -> None:
    np.testing.assert_array_equal(fit(np.zeros(100), order=4), [1, 0, 0, 0, 0])
    np.testing.assert_array_equal(excitation_scale(np.zeros(100), np.ones(1), used=np.zeros(100, bool)), 0)
