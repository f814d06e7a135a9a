"""Weights of the pixels of a column: closed forms, masks, and covariances that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gramoscope.pickup.edges.column_noise import (
    MOST_NOISES,
    SHRUNK,
    filtered,
    filtered_beside,
    patch_patterns,
    patchy_covariance,
    seen_covariance,
)

PLACE = np.arange(-7.0, 8.0)
GRADIENT = np.exp(-0.5 * (PLACE / 1.5) ** 2)[None, :]
RNG_SEED = 11


def _shares(covariance: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    pull = filtered(covariance, np.ones((1, 15), np.bool_), GRADIENT)
    return np.asarray(pull / (pull * GRADIENT).sum())


def test_of_all_means_that_answer_to_the_gradient_it_errs_least() -> None:
    root = np.random.default_rng(RNG_SEED).normal(size=(15, 15))
    covariance = root @ root.T + np.eye(15)
    best = _shares(covariance)[0]
    least = best @ covariance @ best
    assert least == pytest.approx(1 / (GRADIENT[0] @ np.linalg.solve(covariance, GRADIENT[0])))
    for step in np.random.default_rng(RNG_SEED).normal(size=(20, 15)):
        other = best + 0.1 * (step - GRADIENT[0] * (step @ GRADIENT[0]) / (GRADIENT[0] @ GRADIENT[0]))
        assert other @ GRADIENT[0] == pytest.approx(1.0)
        assert other @ covariance @ other > least


def test_a_pattern_of_one_column_is_an_error_of_that_column() -> None:
    rng = np.random.default_rng(RNG_SEED)
    root = rng.normal(size=(15, 15))
    covariance, pattern = root @ root.T + np.eye(15), rng.normal(size=(3, 15))
    gradient, kept = np.repeat(GRADIENT, 3, axis=0), np.ones((3, 15), np.bool_)
    pattern[1] = 0.0
    kept[2, 4:9] = False
    found = filtered_beside(covariance, kept, gradient, pattern)
    for column in range(3):
        which = np.ix_(kept[column], kept[column])
        both = (covariance + np.outer(pattern[column], pattern[column]))[which]
        np.testing.assert_allclose(found[column, kept[column]], np.linalg.solve(both, gradient[column, kept[column]]))
        assert not found[column, ~kept[column]].any()


def test_an_edge_that_wanders_changes_no_share() -> None:
    root = np.random.default_rng(RNG_SEED).normal(size=(15, 15))
    covariance = root @ root.T + np.eye(15)
    np.testing.assert_allclose(_shares(covariance + 40 * GRADIENT.T @ GRADIENT), _shares(covariance), atol=1e-10)


def test_a_pixel_that_is_not_kept_is_as_if_it_were_not_there() -> None:
    root = np.random.default_rng(RNG_SEED).normal(size=(15, 15))
    covariance = root @ root.T + np.eye(15)
    kept = np.ones((3, 15), np.bool_)
    kept[1, 4:9] = False
    kept[2] = False
    found = filtered(covariance, kept, np.repeat(GRADIENT, 3, axis=0))
    left = kept[1]
    np.testing.assert_allclose(found[1, left], np.linalg.solve(covariance[np.ix_(left, left)], GRADIENT[0, left]))
    assert not found[1, ~left].any()
    assert not found[2].any()


def test_any_pixels_may_be_left_out() -> None:
    rng = np.random.default_rng(RNG_SEED)
    root = rng.normal(size=(19, 19))
    covariance = root @ root.T + 0.02 * np.eye(19)
    kept = rng.random((200, 19)) > rng.random((200, 1))
    gradient = rng.normal(size=(200, 19))
    found = filtered(covariance, kept, gradient)
    for column, mine in enumerate(kept):
        alone = np.linalg.solve(covariance[np.ix_(mine, mine)], gradient[column, mine])
        np.testing.assert_allclose(found[column, mine], alone, rtol=1e-6, atol=1e-8)
        assert not found[column, ~mine].any()
    np.testing.assert_array_equal(filtered(np.eye(19), kept, gradient), np.where(kept, gradient, 0.0))


def test_a_covariance_is_seen_as_it_is() -> None:
    rng = np.random.default_rng(RNG_SEED)
    noise = gaussian_filter1d(rng.normal(size=(40_000, 25)), 1.0, axis=1)[:, 5:20]
    noise /= noise.std()
    kept = rng.random(noise.shape) > 0.2
    lag = np.abs(PLACE[:, None] - PLACE)
    expected = np.exp(-(lag**2) / 4) * np.where(lag == 0, 1.0, 1 - SHRUNK)
    np.testing.assert_allclose(seen_covariance(np.where(kept, noise, 99.0), kept), expected, atol=0.05)


def test_no_speck_outvotes_the_rest() -> None:
    noise = np.random.default_rng(RNG_SEED).normal(size=(2000, 15))
    noise[0, 3] = 1e6
    assert seen_covariance(noise, np.ones(noise.shape, np.bool_))[3, 3] < 1.3 + MOST_NOISES**2 / 2000


def test_patches_are_told_from_grain_and_reach_the_edge_that_nobody_looked_at() -> None:
    rng = np.random.default_rng(RNG_SEED)
    patterns = patch_patterns(PLACE, 1.0)
    noise = rng.normal(size=(20_000, 15)) + 2.0 * rng.normal(size=(20_000, 1)) * patterns[:, 1]
    away = np.abs(PLACE) > 3
    noise[:, ~away] = 50.0
    found = patchy_covariance(noise, np.ones(noise.shape, np.bool_), patterns, away)
    # clipping at some standard deviations takes a little off the strongest
    np.testing.assert_allclose(found, np.eye(15) + 4 * np.outer(patterns[:, 1], patterns[:, 1]), atol=0.7)
    alone = patchy_covariance(rng.normal(size=(20_000, 15)), np.ones((20_000, 15), np.bool_), patterns, away)
    np.testing.assert_allclose(alone, np.eye(15), atol=0.05)
