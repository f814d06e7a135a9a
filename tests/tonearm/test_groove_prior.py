"""The process that a groove is taken for: exact steps, its spectrum, its bends."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.tonearm.groove_prior import BEND_M, BODY, SLOPE, WIDE, GroovePrior, start, taylor
from gramoscope.tonearm.small_matrices import STATES

STEP_M = 3.1e-6
PRIORS = [
    GroovePrior(2.1e4, 4.7e4, 6e4, 0.01),
    GroovePrior(2e3, 4e5, 3.3e4, 0.3),
    GroovePrior(7e3, 6.6e3, 8e4, 0.1),
    GroovePrior(1.3e5, 4e5, 7e4, 0.001),
]


def _spectrum(prior: GroovePrior) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers and the variance of the slope at each, for a body of variance 1."""
    k = np.geomspace(1.0, 1e8, 400_001)
    body = np.gradient(k) / ((k**2 + prior.corner_per_m**2) ** 2 * (k**2 + prior.cutoff_per_m**2) ** 2)
    wide = np.gradient(k) / (k**2 + prior.width_per_m**2) ** 3
    return k, body / body.sum() + prior.wide_share**2 * wide / wide.sum()


def _in_other_steps(step_m: float) -> np.ndarray:
    """Turns a state in steps of one length into one in steps of `STEP_M`."""
    powers = np.r_[np.arange(WIDE), 1, 2, 3]
    return np.diag((STEP_M / step_m) ** powers)


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("parts", [2, 7])
def test_one_step_is_many_small_ones(prior: GroovePrior, parts: int) -> None:
    a, q = prior.steps(STEP_M)
    small, noise = prior.steps(STEP_M / parts)
    turn = _in_other_steps(STEP_M / parts)
    small, noise = turn @ small @ np.linalg.inv(turn), turn @ noise @ turn
    whole, spread = np.eye(STATES), np.zeros((STATES, STATES))
    for _ in range(parts):
        whole, spread = small @ whole, small @ spread @ small.T + noise
    np.testing.assert_allclose(whole, a, rtol=1e-9, atol=1e-12)
    size = np.sqrt(np.outer(np.diag(q), np.diag(q)))
    np.testing.assert_allclose(spread / size, q / size, atol=1e-9)


@pytest.mark.parametrize("prior", PRIORS)
def test_a_groove_at_rest_stays_as_it_is(prior: GroovePrior) -> None:
    a, q = prior.steps(STEP_M)
    rest = prior.at_rest(STEP_M)
    later = a[1:, 1:] @ rest @ a[1:, 1:].T + q[1:, 1:]
    size = np.sqrt(np.outer(np.diag(rest), np.diag(rest)))
    np.testing.assert_allclose(later / size, rest / size, atol=1e-9)
    assert np.sqrt(rest[BODY - 1, BODY - 1]) / STEP_M == pytest.approx(1.0, rel=1e-12)
    assert np.sqrt(rest[WIDE - 1, WIDE - 1]) / STEP_M == pytest.approx(prior.wide_share, rel=1e-12)


@pytest.mark.parametrize("prior", PRIORS)
def test_slopes_hang_together_as_their_spectrum_says(prior: GroovePrior) -> None:
    k, weight = _spectrum(prior)
    rest = prior.at_rest(STEP_M)
    a, _ = prior.steps(STEP_M)
    moved, slope = rest, SLOPE[1:]
    for lag in range(1, 6):
        moved = a[1:, 1:] @ moved
        expected = (weight * np.cos(k * lag * STEP_M)).sum()
        assert slope @ moved @ slope / STEP_M**2 == pytest.approx(expected, abs=1e-4)
    # variance of the change of slope: the second moment
    bends = rest[BODY, BODY] + rest[WIDE, WIDE]
    assert bends / STEP_M**2 == pytest.approx((weight * (k * STEP_M) ** 2).sum(), rel=1e-3)


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("step_m", [STEP_M, 5.7e-6])
def test_the_bend_of_a_groove_is_that_of_its_spectrum(prior: GroovePrior, step_m: float) -> None:
    k, weight = _spectrum(prior)
    expected = np.sqrt((weight * 16 * np.sin(k * BEND_M / 2) ** 4 / k**2).sum()) / BEND_M
    assert prior.bend(step_m) == pytest.approx(expected, rel=1e-3)
    louder = replace(prior, share=1.7, floor=0.001)
    assert louder.bends(0.02) == pytest.approx(1.7 * 0.02)
    assert louder.bends(0.0) == 0.001


def test_the_place_drifts_as_the_integral_of_the_slope() -> None:
    prior, sigma = PRIORS[0], 0.03
    a, q = prior.steps(STEP_M)
    covariance = start(prior.at_rest(STEP_M), sigma, place_sigma_m=0.0)
    for _ in range(800):
        covariance = a @ covariance @ a.T + sigma**2 * q
    k, weight = _spectrum(prior)
    expected = sigma * np.sqrt((weight * (2 * np.sin(k * 400 * STEP_M) / k) ** 2).sum())
    assert np.sqrt(covariance[0, 0]) == pytest.approx(expected, rel=1e-3)


def test_taylors_rows_lead_to_the_places_between() -> None:
    prior, fraction = PRIORS[0], 0.37
    # the mean of the process between two bins, and what it misses of the exact step
    exact = (
        _in_other_steps(fraction * STEP_M)
        @ prior.steps(fraction * STEP_M)[0]
        @ np.linalg.inv(_in_other_steps(fraction * STEP_M))
    )
    row = taylor(np.array([fraction, -0.2]))
    size = np.r_[0.0, 0.04 * np.sqrt(np.diag(prior.at_rest(STEP_M)))]
    assert np.abs((row[0] - exact[0]) * size).max() < 1e-11
    assert row[1, BODY] == row[1, WIDE] == -0.2
    assert row[1, BODY + 1] == row[1, WIDE + 1] == pytest.approx(0.02)
