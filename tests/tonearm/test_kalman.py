"""The Kalman smoother is Gaussian-process regression, in one pass and in bounded memory."""

import numpy as np
import pytest

from gramoscope.tonearm.kalman import Prior, Smoothed, State, learn_prior, rest, smooth

PRIOR = Prior(sigma=0.04, rate_per_m=3.1e4)


def _matern(one: np.ndarray, other: np.ndarray, prior: Prior = PRIOR) -> np.ndarray:
    d = prior.rate_per_m * np.abs(one[:, None] - other[None, :])
    return prior.sigma**2 * (1 + d) * np.exp(-d)


def _regression(arc: np.ndarray, value: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error by solving the dense equations."""
    known = np.isfinite(value) & np.isfinite(variance)
    dense = _matern(arc[known], arc[known]) + np.diag(variance[known])
    across = _matern(arc, arc[known])
    mean = across @ np.linalg.solve(dense, value[known])
    covariance = _matern(arc, arc) - across @ np.linalg.solve(dense, across.T)
    return mean, np.sqrt(np.diag(covariance))


def _events(n: int = 90, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Observations of uneven quality at uneven places, some of them twice, some asking only."""
    rng = np.random.default_rng(seed)
    arc = 2e-3 + np.sort(rng.uniform(0, 8e-4, n))
    arc[30] = arc[29]
    variance = rng.uniform(0.005, 0.05, n) ** 2
    value = 0.03 * np.sin(9e3 * arc) + np.sqrt(variance) * rng.normal(size=n)
    value[rng.random(n) < 0.25] = np.nan
    variance[7] = np.nan
    return arc, value, variance


def _smooth(arc: np.ndarray, value: np.ndarray, variance: np.ndarray, **settings: object) -> Smoothed:
    return smooth(arc, value, variance, prior=PRIOR, start=rest(PRIOR, float(arc[0]) - 1.0), **settings)


def test_smoothing_is_gaussian_process_regression() -> None:
    events = _events()
    mean, sigma = _regression(*events)
    result = _smooth(*events)
    np.testing.assert_allclose(result.mean, mean, atol=1e-9)
    np.testing.assert_allclose(result.sigma, sigma, atol=1e-9)
    assert not result.outlier.any()


def test_the_likelihood_is_that_of_the_process() -> None:
    arc, value, variance = _events()
    known = np.isfinite(value) & np.isfinite(variance)
    dense = _matern(arc[known], arc[known]) + np.diag(variance[known])
    chi2 = value[known] @ np.linalg.solve(dense, value[known])
    expected = -0.5 * (chi2 + np.linalg.slogdet(2 * np.pi * dense)[1])
    assert _smooth(arc, value, variance).log_likelihood == pytest.approx(expected, rel=1e-9)


def test_far_from_all_observations_nothing_is_known() -> None:
    arc = np.concatenate([np.linspace(0, 1e-4, 20), [1.5e-4, 2e-3]])
    value = np.concatenate([np.full(20, 0.03), [np.nan, np.nan]])
    result = _smooth(arc, value, np.full(22, 1e-6))
    assert result.mean[0] == pytest.approx(0.03, abs=1e-3)
    assert 0.0 < result.mean[20] < 0.03
    assert result.sigma[10] < result.sigma[20] < PRIOR.sigma
    assert result.mean[21] == pytest.approx(0, abs=1e-12)
    assert result.sigma[21] == pytest.approx(PRIOR.sigma)


def test_a_filter_goes_on_where_it_stopped() -> None:
    arc, value, variance = _events()
    whole = _smooth(arc, value, variance)
    first = smooth(arc[:50], value[:50], variance[:50], prior=PRIOR, start=rest(PRIOR, float(arc[0]) - 1.0), keep=34)
    rest_of_it = smooth(arc[35:], value[35:], variance[35:], prior=PRIOR, start=first.filtered)
    assert isinstance(first.filtered, State)
    assert first.filtered.arc_m == arc[34]
    np.testing.assert_allclose(rest_of_it.mean, whole.mean[35:], atol=1e-12)
    np.testing.assert_allclose(rest_of_it.sigma, whole.sigma[35:], atol=1e-12)


def test_the_gate_gives_an_outlier_no_weight() -> None:
    arc, value, variance = _events()
    spoilt = value.copy()
    spoilt[44] = 0.9
    gated = _smooth(arc, spoilt, variance, gate=5.0)
    np.testing.assert_array_equal(np.flatnonzero(gated.outlier), [44])
    without = value.copy()
    without[44] = np.nan
    np.testing.assert_allclose(gated.mean, _smooth(arc, without, variance).mean, atol=1e-15)
    assert not _smooth(arc, spoilt, variance).outlier.any()


def test_how_far_off_an_outlier_lies_makes_nothing_more_likely() -> None:
    arc, value, variance = _events()
    likelihoods = []
    for wild in (0.9, 7.0):
        spoilt = value.copy()
        spoilt[44] = wild
        likelihoods.append(_smooth(arc, spoilt, variance, gate=5.0).log_likelihood)
    assert likelihoods[0] == likelihoods[1]
    assert likelihoods[0] < _smooth(arc, value, variance, gate=5.0).log_likelihood


def test_the_gate_may_be_wider_than_the_weight_says() -> None:
    # twenty observations that share one error weigh little each, and yet each has its own small error
    arc, value, variance = _events()
    spoilt = value.copy()
    spoilt[44] = 0.4
    heavy = 400 * variance
    assert not _smooth(arc, spoilt, heavy, gate=5.0).outlier.any()
    assert _smooth(arc, spoilt, heavy, gate=5.0, gate_variance=variance).outlier[44]


def test_the_prior_is_learned_from_what_is_heard() -> None:
    rng, arc = np.random.default_rng(5), np.arange(1500) * 1.7e-5
    root = np.linalg.cholesky(_matern(arc, arc) + 1e-12 * np.eye(1500))
    learned = []
    for _ in range(4):
        value = root @ rng.normal(size=1500) + 0.02 * rng.normal(size=1500)
        prior = learn_prior(arc, value, np.full(1500, 0.02**2), rate_limits_per_m=(5e3, 2e5), sigma_floor=1e-3)
        learned.append([prior.sigma / PRIOR.sigma, prior.rate_per_m / PRIOR.rate_per_m])
    assert np.all(np.abs(np.array(learned) - 1) < 0.25), learned


def test_a_few_gross_errors_teach_the_prior_nothing() -> None:
    rng, arc = np.random.default_rng(6), np.arange(1200) * 1.7e-5
    root = np.linalg.cholesky(_matern(arc, arc) + 1e-12 * np.eye(1200))
    value = root @ rng.normal(size=1200) + 0.02 * rng.normal(size=1200)
    value[rng.choice(1200, 25, replace=False)] += 1.5
    prior = learn_prior(arc, value, np.full(1200, 0.02**2), rate_limits_per_m=(5e3, 2e5), sigma_floor=1e-3)
    assert prior.sigma == pytest.approx(PRIOR.sigma, rel=0.35)


def test_silence_is_expected_to_end() -> None:
    arc = np.arange(400) * 1.7e-5
    value = 0.02 * np.random.default_rng(7).normal(size=400)
    settings = {"rate_limits_per_m": (5e3, 2e5), "sigma_floor": 2e-3}
    assert learn_prior(arc, value, np.full(400, 0.02**2), **settings).sigma >= 2e-3 * (1 - 1e-9)
    nothing = learn_prior(arc[:5], np.full(5, np.nan), np.full(5, 1.0), **settings)
    assert nothing == Prior(2e-3, pytest.approx(np.sqrt(5e3 * 2e5)))
