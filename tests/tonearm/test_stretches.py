"""Medians of neighbours, and the samples that disagree with them."""

import numpy as np
import pytest

from gramoscope.quality import NOT_MEASURED, Quality
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm.stretches import (
    HAMPEL_GATE,
    LEAST_SEEN,
    REACH,
    handed_over,
    running_median,
    stretch_of,
    suspects,
)


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


def _trace(seed: int, start_m: float, *, seen: float = 1.0) -> WallTrace:
    """A trace of 60 samples of a micrometre with holes of every kind; of the outer wall so much is seen."""
    rng, place = np.random.default_rng(seed), _places(seed)
    place[1, round(60 * seen) :] = np.nan
    sigma = rng.choice([4e-8, np.nan, 0.0, np.inf], place.shape, p=[0.85, 0.05, 0.05, 0.05])
    flags = rng.choice([0, Quality.SATURATED, Quality.INTERPOLATED], place.shape, p=[0.8, 0.1, 0.1]).astype(np.uint16)
    nothing = np.full(place.shape, np.nan)
    return WallTrace(
        number=seed,
        arc_start_m=start_m,
        arc_step_m=1e-6,
        offset_m=place,
        offset_sigma_m=sigma,
        slope=nothing,
        slope_sigma=nothing,
        correlation_samples=1.0,
        flags=flags,
    )


@pytest.mark.parametrize("seen", [1.0, 0.15])
def test_what_was_not_measured_has_no_place_and_is_flagged(seen: float) -> None:
    trace = _trace(3, 0.0, seen=seen)
    found = stretch_of(trace)
    known = np.isfinite(trace.offset_m) & (trace.offset_sigma_m > 0) & np.isfinite(trace.offset_sigma_m)
    known &= (trace.flags & np.uint16(NOT_MEASURED)) == 0
    sparse = known & (known.mean(axis=1, keepdims=True) < LEAST_SEEN)
    assert sparse.any() == (seen < LEAST_SEEN)
    known &= ~sparse
    np.testing.assert_array_equal(found.place_m, np.where(known, trace.offset_m, np.nan))
    np.testing.assert_array_equal(found.variance, np.where(known, trace.offset_sigma_m**2, np.nan))
    flags = trace.flags | np.where(known, 0, Quality.INTERPOLATED) | np.where(sparse, Quality.SPARSE, 0)
    np.testing.assert_array_equal(found.flags, flags)


def test_where_both_saw_a_wall_one_fades_out_as_the_other_fades_in() -> None:
    before, after = (stretch_of(_trace(seed, start)) for seed, start in ((3, 0.0), (4, 40.2e-6)))
    first, second = handed_over([before, after])
    for one, other, fade in (
        (before, after, (before.arc_m[-1] - before.arc_m) / (before.arc_m[-1] - after.arc_m[0])),
        (after, before, (after.arc_m - after.arc_m[0]) / (before.arc_m[-1] - after.arc_m[0])),
    ):
        nearest = np.round((one.arc_m - other.arc_m[0]) / 1e-6).astype(int)
        inside = (nearest >= 0) & (nearest < 60)
        both = inside & np.isfinite(other.place_m[:, np.clip(nearest, 0, 59)])
        assert 10 < both.sum() < 40
        share = (first if one is before else second).share
        np.testing.assert_allclose(share, np.where(both, np.clip(fade, 0, 1), 1.0), atol=1e-12)
