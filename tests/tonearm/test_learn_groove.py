"""What is learned of a groove's spectrum: from samples or from means of them, by all stretches that were seen."""

from __future__ import annotations

from typing import Any

import numpy as np

from gramoscope.tonearm.groove_prior import BEND_M
from gramoscope.tonearm.learn_groove import PriorLimits, learn, lessons
from gramoscope.tonearm.level import OneDirection, bend_power

STEP_M = 3.125e-6
SIGMA_M = 4e-8
SPEED_M_S = 0.94
LAG = round(BEND_M / STEP_M)


def _per_m(*hz: float) -> Any:
    return tuple(2 * np.pi * f / SPEED_M_S for f in hz)


LIMITS = PriorLimits(3e-4, _per_m(300, 20e3), _per_m(2e3, 60e3), _per_m(6e3, 30e3), *_per_m(8e3))


def _seen(place_m: np.ndarray) -> OneDirection:
    return OneDirection(place_m, np.where(np.isfinite(place_m), SIGMA_M**2, np.nan))


def test_blocks_are_means_with_smaller_errors_and_only_whole_ones_count() -> None:
    place = np.arange(80.0) ** 2 * 1e-9
    place[31] = np.nan
    given = lessons(_seen(place[None]), np.ones(1), np.full(1, 2.0), STEP_M, block=3)
    assert given is not None
    assert given.step_m == 3 * STEP_M
    # 26 whole blocks, two samples left over, and one block has a hole
    value, variance = given.readings.seen[0, :, :, 0].T
    known = np.flatnonzero(np.isfinite(variance))
    np.testing.assert_array_equal(known, np.delete(np.arange(26), 10))
    assert given.readings.count == known.size
    means = place[:78].reshape(26, 3).mean(axis=1)
    np.testing.assert_allclose(value[known], np.delete(means - means[0], 10), atol=1e-20)
    np.testing.assert_allclose(variance[known], 2 * SIGMA_M**2 / 3)


def test_a_stretch_of_which_hardly_a_block_is_whole_teaches_nothing() -> None:
    place = np.zeros((1, 100))
    place[:, ::3] = np.nan
    assert lessons(_seen(place), np.ones(1), np.ones(1), STEP_M, block=1) is not None
    assert lessons(_seen(place), np.ones(1), np.ones(1), STEP_M, block=3) is None
    assert learn(None, LIMITS) == LIMITS.middle


def test_means_teach_the_same_spectrum(bench: Any) -> None:
    spectrum = lambda f: np.hypot(1 / (1 + (f / 900) ** 2), 0.03 / (1 + (f / 12_000) ** 3))  # noqa: E731
    course, rng = bench.course(spectrum, 0.03, groups=64, seed=3), np.random.default_rng(4)
    arc = (np.arange(64) * bench.group_step)[:, None] * STEP_M + np.arange(160) * STEP_M
    seen = _seen(course.place(arc) + SIGMA_M * rng.normal(size=arc.shape))
    power = np.array([bend_power(*both, LAG) for both in zip(seen.place_m, seen.variance, strict=True)])
    level = np.sqrt(np.maximum(power, 0.0)) / (LAG * STEP_M)
    priors = [learn(lessons(seen, level, np.ones(64), STEP_M, block=block), LIMITS) for block in (1, 3)]
    k = 2 * np.pi * np.array([500.0, 1000, 2000, 4000, 8000, 14_000]) / SPEED_M_S
    one, other = (prior.share**2 * prior.slope_density(k) / prior.bend(STEP_M) ** 2 for prior in priors)
    assert np.max(np.abs(10 * np.log10(other / one))) < 1.5
