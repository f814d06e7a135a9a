"""Medians of neighbours, and the samples that disagree with them."""

import numpy as np
import pytest

from gramoscope.tonearm.stretches import HAMPEL_GATE, REACH, running_median, suspects


def _places(seed: int) -> np.ndarray:
    """A steep course with noise, wild samples and holes."""
    rng = np.random.default_rng(seed)
    place = 8e-7 * np.arange(60) + 4e-8 * rng.normal(size=(2, 60))
    place[rng.random(place.shape) < 0.1] += 3e-6
    place[rng.random(place.shape) < 0.15] = np.nan
    place[0, 20:35] = np.nan
    return place


def _lower_median(values: np.ndarray) -> float:
    known = np.sort(values[np.isfinite(values)])
    return float(known[(known.size - 1) // 2]) if known.size else float("nan")


@pytest.mark.parametrize("seed", range(3))
def test_medians_and_suspects_are_those_of_their_definition(seed: int) -> None:
    place = _places(seed)
    padded = np.pad(place, ((0, 0), (REACH, REACH)), constant_values=np.nan)
    middle, wild, away = np.empty_like(place), np.zeros(place.shape, np.bool_), np.empty_like(place)
    near = np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1, axis=1)
    for wall, i in np.ndindex(place.shape):
        middle[wall, i] = _lower_median(near[wall, i])
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(middle, ((0, 0), (REACH, REACH)), constant_values=np.nan), 2 * REACH + 1, axis=1
    )
    sigma = 4e-8
    for wall, i in np.ndindex(place.shape):
        slope = (around[wall, i, -1] - around[wall, i, 0]) / (2 * REACH)
        level = near[wall, i] - (slope if np.isfinite(slope) else 0.0) * np.arange(-REACH, REACH + 1)
        spread = _lower_median(np.abs(level - _lower_median(level)))
        away[wall, i] = place[wall, i] - _lower_median(level)
        wild[wall, i] = abs(away[wall, i]) > HAMPEL_GATE * (sigma + spread)
    apart = np.minimum(abs(away[0] - away[1]), abs(away[0] + away[1]))
    wild &= ~(apart < HAMPEL_GATE * np.sqrt(2) * sigma)
    np.testing.assert_array_equal(running_median(place), middle)
    found = suspects(place, np.full(place.shape, sigma**2), running_median(place))
    np.testing.assert_array_equal(found, wild)
    assert 3 < found.sum() < 20
