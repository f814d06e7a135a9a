"""How wrong claimed errors are is told from the readings alone: white errors, errors that neighbours share, sound, outliers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.tonearm import level
from gramoscope.tonearm.level import EIGHTH_DIFFERENCE, ENOUGH, bend_noise, bend_powers, claim_error
from gramoscope.tonearm.stretches import running_median

SIGMA_M = 5e-8
SAMPLES = 165


def _walls(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of errors in units of what is claimed, shape (stretch, 2, sample)."""
    return SIGMA_M * errors, np.full(errors.shape, SIGMA_M**2)


def _moving_average(weights: np.ndarray, rng: np.random.Generator, stretches: int) -> np.ndarray:
    white = rng.normal(size=(stretches, 2, SAMPLES + weights.size - 1))
    return np.apply_along_axis(np.convolve, -1, white, weights, "valid")


@pytest.mark.parametrize("longest", [1, 3, 5])
@pytest.mark.parametrize("times", [0.8, 1.0, 1.6])
def test_white_errors_are_so_many_times_what_they_claim(times: float, longest: int) -> None:
    errors = np.random.default_rng(1).normal(size=(200, 2, SAMPLES))
    assert claim_error(*_walls(times * errors), longest) == pytest.approx(times, rel=0.03)


@pytest.mark.parametrize("block", [1, 2, 3])
def test_errors_that_neighbours_share_are_those_of_blocks(block: int) -> None:
    # each sample claims what it is off, and shares a part of it with its neighbours: the closed form is the moving average's
    shared = np.array([1.0, 0.1]) / np.hypot(1.0, 0.1)
    weight = np.repeat(EIGHTH_DIFFERENCE, block)
    expected = np.sqrt(np.sum(np.convolve(weight, shared) ** 2) / np.sum(weight**2))
    errors = _moving_average(shared, np.random.default_rng(2), 400)
    assert claim_error(*_walls(errors), block) == pytest.approx(expected, rel=0.03)


def test_longer_blocks_hear_more_of_them() -> None:
    shared = np.array([1.0, 0.1]) / np.hypot(1.0, 0.1)
    errors = _moving_average(shared, np.random.default_rng(3), 400)
    single, blocks = (claim_error(*_walls(errors), longest) for longest in (1, 5))
    assert single < 0.93
    # what is far slower than the errors' own memory has to bear 1.1 times as much
    assert blocks == pytest.approx(1.1 / np.hypot(1.0, 0.1), abs=0.05)


@pytest.mark.parametrize(("times_faster", "longest"), [(1.0, 5), (2.0, 3)])
def test_sound_is_no_error(bench: Any, times_faster: float, longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # its slope falls by 6 dB an octave up to 40 kHz, further than any record's; near the label sounds are half as long
    course = bench.course(lambda f: (f < 40e3) / np.sqrt(1 + (f / 2000) ** 2), 0.03, groups=200, seed=7)
    rng = np.random.default_rng(4)
    starts = rng.uniform(0, 190 * bench.group_step * bench.step_m, (200, 1))
    place = course.place(starts + times_faster * bench.step_m * np.arange(SAMPLES))
    walls = _walls(place[:, np.newaxis] / SIGMA_M + rng.normal(size=(200, 2, SAMPLES)))
    # what sound a block of one sample more hears is seen only if it is more than this
    assert 0.95 < claim_error(*walls, longest) < 1.02 * level.SOUND_GROWS
    monkeypatch.setattr(level, "SOUND_GROWS", np.inf)
    assert claim_error(*walls, longest) > 1.8


def test_outliers_and_holes_are_not_seen() -> None:
    rng = np.random.default_rng(5)
    errors = rng.normal(size=(400, 2, SAMPLES))
    errors[:, :, 20] += 1e3 * rng.normal(size=(400, 2))
    errors[:, 1, 140:] = np.nan
    assert claim_error(*_walls(1.2 * errors), 3) == pytest.approx(1.2, rel=0.35)
    errors[:, :, 20] = np.nan
    assert claim_error(*_walls(1.2 * errors), 3) == pytest.approx(1.2, rel=0.04)


def test_where_hardly_anything_was_seen_claims_are_believed() -> None:
    errors = 2 * np.random.default_rng(6).normal(size=(40, 2, SAMPLES))
    assert claim_error(*_walls(errors[:0]), 3) == 1.0
    assert claim_error(*_walls(errors[:, :, :8]), 3) == 1.0
    few = ENOUGH // (2 * (SAMPLES - 8))
    assert claim_error(*_walls(errors[:few]), 3) == 1.0
    assert claim_error(*_walls(errors[: few + 1]), 3) == pytest.approx(2.0, rel=0.1)
    # an error is never believed to be more than three times, or less than half, of what it claims
    assert claim_error(*_walls(5 * errors), 1) == 3.0
    assert claim_error(*_walls(0.1 * errors), 1) == 0.5


@pytest.mark.parametrize(
    ("lag", "shared"),
    # medians of the same independent readings are not told apart: no film is so coarse
    [(lag, shared) for lag in (1, 3, 6, 16, 50) for shared in (1.0, 4.0, 9.7) if lag > 6 or shared > 1],
)
def test_no_more_is_taken_off_than_errors_bend_however_many_neighbours_share_them(lag: int, shared: float) -> None:
    rng = np.random.default_rng(11)
    error = rng.normal(size=(400, 1000))
    if shared > 1:
        # a Gaussian window of this width makes errors as alike as readings that share so many
        error = ndimage.gaussian_filter1d(error, shared / np.sqrt(4 * np.pi), axis=1, mode="wrap")
        error /= error.std()
    middle = np.vstack([running_median(pair) for pair in error.reshape(-1, 2, 1000)])
    bend = middle[:, 2 * lag :] - 2 * middle[:, lag:-lag] + middle[:, : -2 * lag]
    there, known = bend.var() / 6, bend_noise(lag, shared)
    assert min(0.2, 0.5 * there) - 0.02 < known < 1.15 * there + 0.05


def test_a_tone_is_as_loud_as_it_is_where_neighbours_share_errors_and_claim_too_much() -> None:
    rng, shared, lag, step_m = np.random.default_rng(12), 9.7, 3, 16e-6
    noise = ndimage.gaussian_filter1d(rng.normal(size=(2, 20_000)), shared / np.sqrt(4 * np.pi), axis=1, mode="wrap")
    noise *= 10e-6 / noise.std()
    tone = 40e-6 * np.sin(2 * np.pi * np.arange(20_000) / 40)

    def heard(place_m: np.ndarray, claimed_m: float) -> float:
        powers = bend_powers(
            running_median(place_m),
            np.full(noise.shape, claimed_m**2),
            np.array([-1.0, 1.0]),
            listened="lateral",
            step_m=step_m,
            correlation_samples=shared,
        )
        return float(powers[0])

    # the median of a sine makes more of it than its mean square does
    loud = 1.4826**2 * 0.5 * (40e-6 * (2 - 2 * np.cos(2 * np.pi * lag / 40)) / (lag * step_m)) ** 2
    assert 0 < heard(noise, 10e-6) < 0.1 * loud
    assert heard(tone + noise, 10e-6) == pytest.approx(loud, rel=0.25)
    assert heard(tone + noise, 60e-6) > 0.2 * loud
