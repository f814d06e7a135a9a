"""Filtering and smoothing on a grid is Gaussian-process regression, in one pass forwards and one back."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.tonearm import groove_model
from gramoscope.tonearm.bryson_frazier import backward, smooth_reference
from gramoscope.tonearm.groove_model import PassState, robustly
from gramoscope.tonearm.groove_prior import SLOPE, GroovePrior, start
from gramoscope.tonearm.linear_gaussian import (
    FilterState,
    Gate,
    Moves,
    Readings,
    blank,
    forward,
)
from gramoscope.tonearm.small_matrices import STATES

STEP_M = 3.1e-6
LATERAL, VERTICAL = GroovePrior(2.1e4, 4.7e4, 6e4, 0.1), GroovePrior(6e3, 2.2e4, 5e4, 0.02)
SIGMAS = np.array([0.04, 0.013])
PLACE_SIGMA_M = 4e-6
BINS = 60
ROWS = np.eye(2 * STATES)
PLACES, SLOPES = ROWS[[0, STATES]], np.kron(np.eye(2), SLOPE)


def _moves(bins: int = BINS, scale: float = 1.0) -> Moves:
    """Two models, the second one for the last third."""
    both = [[(prior.steps(STEP_M)) for prior in (LATERAL, VERTICAL)] for _ in range(2)]
    a = np.array([[one[0] for one in pair] for pair in both])
    q = np.array([[sigma**2 * one[1] for one, sigma in zip(pair, SIGMAS, strict=True)] for pair in both])
    q[1] *= scale
    return Moves(a, q, (np.arange(bins) >= 2 * bins // 3).astype(np.int64), np.ones(bins))


def _begin() -> FilterState:
    covariance = np.zeros((2 * STATES, 2 * STATES))
    for i, prior in enumerate((LATERAL, VERTICAL)):
        part = slice(i * STATES, (i + 1) * STATES)
        covariance[part, part] = start(prior.at_rest(STEP_M), SIGMAS[i], place_sigma_m=PLACE_SIGMA_M)
    return blank(covariance)


def _readings(seed: int = 3, n: int = 75) -> Readings:
    """Both walls at uneven places with uneven errors, some bins twice, some not at all, none in the middle."""
    rng = np.random.default_rng(seed)
    bins = np.sort(rng.choice(np.r_[2:25, 34 : BINS - 3], n))
    wall = rng.integers(0, 2, n)
    h = ROWS[0] + np.where(wall, 1.1, -0.9)[:, None] * ROWS[STATES]
    sigma = rng.uniform(2e-8, 2e-7, n)
    value = 3e-6 + 2e-6 * np.sin(bins / 23.0) + 1e-6 * wall + sigma * rng.normal(size=n)
    return Readings(bins, wall, h, value, sigma**2, sigma**2)


def _place_covariance(prior: GroovePrior, sigma: float, bins: np.ndarray) -> np.ndarray:
    """Of the places from the first bin on, by adding up the covariance of the slope, brute force."""
    fine = 20
    # ∫∫ of the slope's covariance, by the midpoint rule on a grid twenty times finer
    arc = (np.arange((bins.max()) * fine) + 0.5) * STEP_M / fine
    k = (np.arange(12_000) + 0.5) * 120.0
    body = 1 / ((k**2 + prior.corner_per_m**2) ** 2 * (k**2 + prior.cutoff_per_m**2) ** 2)
    wide = 1 / (k**2 + prior.width_per_m**2) ** 3
    density = body / body.sum() + prior.wide_share**2 * wide / wide.sum()
    lag = np.arange(arc.size) * STEP_M / fine
    correlation = np.array([(density * np.cos(k * x)).sum() for x in lag])
    index = np.abs(np.arange(arc.size)[:, None] - np.arange(arc.size)[None, :])
    both = np.cumsum(np.cumsum(correlation[index], axis=0), axis=1) * (STEP_M / fine) ** 2 * sigma**2
    padded = np.pad(both, ((1, 0), (1, 0)))
    return padded[np.ix_(bins * fine, bins * fine)] + PLACE_SIGMA_M**2


def test_smoothing_is_gaussian_process_regression() -> None:
    bins = np.arange(0, 27)
    readings = _readings(n=40)
    keep = readings.bin < 25
    readings = Readings(*(getattr(readings, name)[keep] for name in readings.__dataclass_fields__))
    moves = replace(_moves(), model=np.zeros(27, np.int64), agitation=np.ones(27))
    lateral = _place_covariance(LATERAL, SIGMAS[0], bins)
    vertical = _place_covariance(VERTICAL, SIGMAS[1], bins)
    gain = readings.h[:, STATES]
    at = np.ix_(readings.bin, readings.bin)
    dense = lateral[at] + np.outer(gain, gain) * vertical[at] + np.diag(readings.variance)
    across = lateral[:, readings.bin]
    mean = across @ np.linalg.solve(dense, readings.value)
    sigma = np.sqrt(np.diag(lateral - across @ np.linalg.solve(dense, across.T)))
    filtered = forward(moves, readings, _begin(), wanted=PLACES)
    found = backward(moves, readings, filtered)
    np.testing.assert_allclose(found.mean[:, 0], mean, atol=2e-3 * sigma.min())
    np.testing.assert_allclose(found.sigma[:, 0], sigma, rtol=2e-3)
    chi2 = readings.value @ np.linalg.solve(dense, readings.value)
    expected = -0.5 * (chi2 + np.linalg.slogdet(2 * np.pi * dense)[1])
    assert filtered.log_likelihood == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("wanted", [PLACES, SLOPES])
def test_the_kernels_agree_with_the_textbook(wanted: np.ndarray) -> None:
    moves, readings = _moves(scale=9.0), _readings()
    moves = replace(moves, agitation=np.where(np.arange(BINS) % 20 < 5, 30.0, 1.0))
    mean, sigma = smooth_reference(moves, readings, _begin(), wanted=wanted)
    found = backward(moves, readings, forward(moves, readings, _begin(), wanted=wanted))
    np.testing.assert_allclose(found.mean, mean, atol=1e-6 * sigma.min())
    np.testing.assert_allclose(found.sigma, sigma, rtol=1e-6)


@pytest.mark.parametrize("number", [0, 31, 74])
@pytest.mark.parametrize("left_out", [False, True])
def test_the_distance_of_a_reading_is_that_from_all_others(number: int, left_out: bool) -> None:
    moves, readings = _moves(), _readings()
    others = np.arange(readings.value.size) != number
    allowed = others if left_out else np.ones_like(others)
    found = backward(moves, readings, forward(moves, readings, _begin(), allowed=allowed)).distance
    rest = Readings(*(getattr(readings, name)[others] for name in readings.__dataclass_fields__))
    # what the others say of h·x: ask for it as a reading that knows nothing
    weak = np.where(others, readings.variance, 1e-6)
    asking = replace(readings, variance=weak, gate_variance=weak)
    smoothed = backward(moves, asking, forward(moves, asking, _begin(), wanted=ROWS))
    plain = backward(moves, rest, forward(moves, rest, _begin(), wanted=PLACES))
    k = readings.bin[number]
    np.testing.assert_allclose(smoothed.mean[:, [0, STATES]], plain.mean, atol=1e-12)
    assert np.all(smoothed.sigma[:, [0, STATES]] <= plain.sigma * (1 + 1e-6))
    expected = readings.h[number] @ smoothed.mean[k]
    error = _sigma_of(moves, rest, readings.h[number], int(k))
    assert found[number] == pytest.approx(
        abs(readings.value[number] - expected) / np.hypot(error, np.sqrt(readings.variance[number])), rel=1e-5
    )


def _sigma_of(moves: Moves, readings: Readings, h: np.ndarray, k: int) -> float:
    """Standard error of h·x at a bin, by the information that one more reading would add."""
    variance = 1e-14
    order = np.argsort(np.append(readings.bin, k), kind="stable")
    more = Readings(
        np.append(readings.bin, k)[order],
        np.append(readings.source, 0)[order],
        np.vstack([readings.h, h])[order],
        np.append(readings.value, 0.0)[order],
        np.append(readings.variance, variance)[order],
        np.append(readings.gate_variance, variance)[order],
    )
    filtered = forward(moves, more, _begin(), allowed=order != order.size - 1)
    far = backward(moves, more, filtered).distance[np.argmax(order == order.size - 1)]
    plain = backward(moves, readings, forward(moves, readings, _begin(), wanted=ROWS))
    return float(np.sqrt((h @ plain.mean[k] / far) ** 2 - variance))


def test_a_filter_goes_on_where_it_stopped() -> None:
    moves, readings = _moves(scale=4.0), _readings()
    whole = forward(moves, readings, _begin(), wanted=ROWS, resume=37)
    later = readings.bin >= 37
    rest = Readings(*(getattr(readings, name)[later] for name in readings.__dataclass_fields__))
    rest = replace(rest, bin=rest.bin - 37)
    later_moves = replace(moves, model=moves.model[37:], agitation=moves.agitation[37:])
    again = forward(later_moves, rest, whole.resume, wanted=ROWS)
    np.testing.assert_array_equal(again.mean, whole.mean[37:])
    np.testing.assert_array_equal(again.toward, whole.toward[37:])


def test_what_a_bin_expects_of_a_reading_does_not_depend_on_the_others_in_it() -> None:
    moves, readings = _moves(), _readings()
    found = forward(moves, readings, _begin(), gate=Gate(1.0), wanted=ROWS)
    assert 10 < np.count_nonzero(~found.used) < 65
    ph = np.einsum("jik,ji->jk", found.toward[readings.bin], readings.h)
    expected = np.einsum("jk,jk->j", ph, readings.h)
    np.testing.assert_allclose(found.expected, expected, rtol=1e-9)
    scale = np.abs(ph).max(axis=0)
    np.testing.assert_allclose(found.gain[~found.used] / scale, ph[~found.used] / scale, atol=1e-9)


def test_the_gate_gives_a_wild_reading_no_weight_and_no_say_in_the_likelihood() -> None:
    moves, readings = _moves(), _readings()
    found = []
    for wild in (5e-6, 3e-4):
        value = readings.value.copy()
        value[40] += wild
        found.append(forward(moves, replace(readings, value=value), _begin(), gate=Gate(5.0)))
        np.testing.assert_array_equal(np.flatnonzero(~found[-1].used), [40])
    assert found[0].log_likelihood == found[1].log_likelihood
    without = forward(moves, readings, _begin(), allowed=np.arange(75) != 40)
    np.testing.assert_array_equal(found[0].mean, without.mean)


def test_the_gate_looks_at_the_single_reading_however_little_it_weighs() -> None:
    moves, readings = _moves(), _readings()
    value = readings.value.copy()
    value[60] += 5e-6
    light = replace(readings, value=value, variance=400 * readings.variance)
    assert not forward(moves, light, _begin(), gate=Gate(5.0)).used[60]
    assert forward(moves, replace(light, gate_variance=light.variance), _begin(), gate=Gate(5.0)).used[60]


def test_a_place_that_is_lost_may_be_anywhere_and_goes_on_as_fast_as_before() -> None:
    moves, bins = replace(_moves(), model=np.zeros(200, np.int64), agitation=np.ones(200)), np.repeat(np.arange(200), 2)
    rng = np.random.default_rng(5)
    wall = np.tile(np.arange(2), 200)
    h = ROWS[0] + np.where(wall, 1.0, -1.0)[:, None] * ROWS[STATES]
    course = 5e-3 * STEP_M * bins + np.where(bins >= 100, 9e-4, 0.0)
    variance = np.full(400, 2.5e-15)
    readings = Readings(bins, wall, h, course + 5e-8 * rng.normal(size=400), variance, variance)
    found = forward(moves, readings, _begin(), gate=Gate(5.0, patience=32, anywhere=1e-3))
    np.testing.assert_array_equal(np.flatnonzero(found.lost), [132])
    assert not found.used[200:264].any()
    assert found.used[264:].mean() > 0.99
    again = forward(
        moves, readings, _begin(), gate=Gate(anywhere=1e-3), allowed=found.used, lost=found.lost, wanted=SLOPES
    )
    smoothed = backward(moves, readings, again)
    assert np.abs(smoothed.mean[:, 0] / STEP_M - 5e-3).max() < 5e-3
    # without the patience it stays lost, for this prior does not believe in such a jump
    assert not forward(moves, readings, _begin(), gate=Gate(5.0)).used[200:].any()


@pytest.mark.parametrize("wild", [0, 1])
def test_what_is_followed_robustly_is_the_pass_over_what_was_accepted(wild: int) -> None:
    moves, readings, all_of_them = _moves(), _readings(), np.ones(75, np.bool_)
    readings.value[30] += 2e-3 * wild
    begin = PassState(0, _begin(), _begin())
    followed = robustly(moves, readings, all_of_them, begin, gate=40.0, resume_bin=20, wanted=SLOPES)
    last = forward(moves, readings, _begin(), allowed=followed.accepted, wanted=SLOPES, resume=20)
    again = backward(moves, readings, last)
    assert np.count_nonzero(~followed.accepted) == wild
    np.testing.assert_array_equal(followed.smoothed.mean, again.mean)
    np.testing.assert_array_equal(followed.smoothed.sigma, again.sigma)
    np.testing.assert_array_equal(followed.state.last.mean, last.resume.mean)
    np.testing.assert_array_equal(followed.state.last.covariance, last.resume.covariance)


@pytest.mark.parametrize(("aside", "passes"), [(0.0, 1), (1e-8, 1), (1e-3, 2)])
def test_what_two_filters_once_differed_in_is_forgotten_when_it_has_faded(
    aside: float, passes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    moves, readings, all_of_them, begin = _moves(), _readings(), np.ones(75, np.bool_), _begin()
    other = replace(begin, mean=begin.mean + aside * np.sqrt(np.diag(begin.covariance)))
    made = []
    monkeypatch.setattr(groove_model, "forward", lambda *given, **more: made.append(1) or forward(*given, **more))
    robustly(moves, readings, all_of_them, PassState(0, begin, other), gate=40.0, resume_bin=20, wanted=SLOPES)
    assert len(made) == passes
