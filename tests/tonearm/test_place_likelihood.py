"""The short way to a likelihood comes to what the Kalman filter says."""

from __future__ import annotations

import numpy as np
import pytest

from gramoscope.tonearm.groove_prior import GroovePrior, start, taylor
from gramoscope.tonearm.linear_gaussian import Gate, Moves, Readings, blank, forward
from gramoscope.tonearm.place_likelihood import abreast, place_log_likelihood

STEP_M = 3.1e-6
SIGMA_M = 6e-8
Stretch = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Bins, values and variances of readings."""


def _both(prior: GroovePrior, bins: np.ndarray, value: np.ndarray, variance: np.ndarray) -> tuple[float, float]:
    a, q = prior.steps(STEP_M)
    sigma = prior.bends(50.0) / prior.bend(STEP_M)
    covariance = start(prior.at_rest(STEP_M), sigma, place_sigma_m=1e-4)
    h = np.repeat(taylor(np.zeros(1)), bins.size, axis=0)
    readings = Readings(bins, np.zeros_like(bins), h, value, variance, variance)
    count = int(bins[-1]) + 1
    moves = Moves(a[None, None], sigma**2 * q[None, None], np.zeros(count, np.int64), np.ones(count))
    long = forward(moves, readings, blank(covariance), gate=Gate(4.0)).log_likelihood
    return long, _short(prior, [(bins, value, variance)], np.array([sigma]))


def _short(prior: GroovePrior, stretches: list[Stretch], sigma: np.ndarray) -> float:
    place, errors = np.full((2, len(stretches), 1 + max(int(bins[-1]) for bins, _, _ in stretches)), np.nan)
    for i, (bins, value, variance) in enumerate(stretches):
        place[i, bins], errors[i, bins] = value, variance
    given = abreast(place, errors)
    a, q = prior.steps(STEP_M)
    return float(place_log_likelihood(a, q, prior.at_rest(STEP_M), given.seen, given.count, sigma, 1e-4, 4.0))


def test_stretches_know_nothing_of_each_other() -> None:
    prior, rng = GroovePrior(5000.0, 3e4, 6e4, 0.03, 1.0, 2e-4), np.random.default_rng(2)
    # more than one eight of them, of all lengths
    lengths = rng.integers(1, 90, 11)
    stretches = [(np.arange(n), 2e-7 * rng.normal(size=n), np.full(n, SIGMA_M**2)) for n in lengths]
    sigma = rng.uniform(0.02, 0.05, 11)

    apart = sum(_short(prior, stretches[i : i + 1], sigma[i : i + 1]) for i in range(11))
    assert _short(prior, stretches, sigma) == pytest.approx(apart, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("corner_per_m", [2500.0, 5000.0, 60_000.0])
@pytest.mark.parametrize("case", ["regular", "a gap", "errors that change", "wild readings", "all of it"])
def test_it_is_the_likelihood_of_the_filter(case: str, corner_per_m: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    bins = np.arange(300)
    if case in ("a gap", "all of it"):
        bins = np.concatenate([bins[:120], bins[160:161], bins[190:]])
    variance = np.full(bins.size, SIGMA_M**2)
    if case in ("errors that change", "all of it"):
        variance[150:190] *= 4
    value = np.cumsum(2e-8 * rng.normal(size=bins.size)) + np.sqrt(variance) * rng.normal(size=bins.size)
    if case in ("wild readings", "all of it"):
        value[[40, 130, 131, 220]] += 5e-6
    long, short = _both(GroovePrior(corner_per_m, 6 * corner_per_m, 6e4, 0.03, 1.0, 2e-4), bins, value, variance)
    # a tenth of what would let a learning stop
    assert short == pytest.approx(long, abs=0.03)


def test_a_single_reading_is_as_likely_as_its_density() -> None:
    prior = GroovePrior(5000.0, 3e4, 6e4, 0.03, 1.0, 2e-4)
    long, short = _both(prior, np.array([0]), np.array([2e-5]), np.array([SIGMA_M**2]))
    assert short == pytest.approx(long, abs=1e-9)
