"""Eight filters abreast come to what one filter after the other comes to, whatever befell the stretches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.conventions import FloatArray
from gramoscope.errors import GramoscopeError
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm import cleaning
from gramoscope.tonearm.batch import Batch, batch_of
from gramoscope.tonearm.cleaning import agitations, contradicted
from gramoscope.tonearm.groove_model import Beliefs, beginning, beliefs, moves, robustly
from gramoscope.tonearm.groove_prior import GroovePrior
from gramoscope.tonearm.linear_gaussian import Readings, blank, forward
from gramoscope.tonearm.place_samples import PlaceSamples
from gramoscope.tonearm.stretches import handed_over, stretch_of

GROUPS = 19
"""Two eights and three."""
GAINS = np.array([-0.9, 1.1])
GATE = 5.0
UNSURE = 6
"""Samples at the beginning of a stretch."""
PRIORS = (GroovePrior(6000.0, 4e4, 6e4, 0.03, 1.0, 3e-3), GroovePrior(9000.0, 5e4, 6e4, 0.03, 1.0, 2e-3))


def _hurt(traces: list[WallTrace], lose: Callable[..., WallTrace], seed: int, wild: float) -> list[WallTrace]:
    """Wild samples, walls and pieces of them that nobody saw, and walls that jump."""
    rng, hurt = np.random.default_rng(seed), []
    for number, trace in enumerate(traces):
        offset = trace.offset_m.copy()
        offset[rng.random(offset.shape) < wild] += 1e-6
        if number % 5 == 1:
            offset[number % 2, 20 + number :] += 40e-6
        trace = replace(trace, offset_m=offset)
        if number % 4 == 2:
            trace = lose(trace, [0, 1] if number % 8 == 2 else [1], slice(40, 40 + 4 * number))
        if number in (7, 12):
            trace = lose(trace, [0] if number == 7 else [0, 1], slice(None))
        hurt.append(trace)
    return hurt


def _batch(bench: Any, lose: Callable[..., WallTrace], seed: int, wild: float) -> tuple[Batch, Beliefs]:
    courses = [bench.course(lambda f: 1 / (1 + (f / 2000) ** 2), rms, groups=GROUPS, seed=seed + i) for i, rms in enumerate((0.03, 0.01))]  # fmt: skip  # noqa: E501
    traces = _hurt(bench.traces(*courses, groups=GROUPS, seed=seed), lose, seed, wild)
    # some stretches are shorter than others
    traces = [_cut(trace, 165 - 7 * (number % 3)) for number, trace in enumerate(traces)]
    level = np.random.default_rng(seed).uniform(0.005, 0.03, (GROUPS, 2))
    stretches = [(one, level[i]) for i, one in enumerate(handed_over(stretch_of(trace) for trace in traces))]
    return batch_of(stretches, bench.step_m), beliefs(PRIORS, bench.step_m)


def _cut(trace: WallTrace, samples: int) -> WallTrace:
    names = ("offset_m", "offset_sigma_m", "slope", "slope_sigma", "flags")
    return replace(trace, **{name: getattr(trace, name)[:, :samples] for name in names})


def _alone(batch: Batch, i: int, step_m: float) -> tuple[PlaceSamples, np.ndarray, Readings]:
    first, samples = int(batch.first_bin[i]), batch.samples()[i]
    measured = samples.measured(first, first + int(batch.size[i]))
    return samples, measured, samples.part(measured).readings(first_bin=first, step_m=step_m, gains=GAINS)


@pytest.mark.parametrize("wild", [0.0, 0.03, 0.2])
@pytest.mark.parametrize("seed", range(2))
def test_what_others_contradict_is_told_as_by_one_filter_after_the_other(
    bench: Any, lose: Callable[..., WallTrace], seed: int, wild: float
) -> None:
    batch, believed = _batch(bench, lose, seed, wild)
    found = contradicted(batch, believed, GAINS, gate=GATE)
    for i in range(GROUPS):
        first, stop = int(batch.first_bin[i]), int(batch.first_bin[i] + batch.size[i])
        samples, measured, readings = _alone(batch, i, bench.step_m)
        model = believed.model(first, batch.level[i])
        trusted = ~samples.suspect[measured]
        followed = robustly(
            moves([model], first, stop), readings, trusted, beginning(model, first), gate=GATE, resume_bin=first
        )
        expected = samples.suspect.copy()
        expected[measured] = ~followed.accepted
        # a reading that is rejected before anything is known is 10⁻⁹ of what was not known away: either may be wrong of it
        np.testing.assert_array_equal(
            found[i, :, UNSURE : batch.size[i]], expected.reshape(2, -1, order="F")[:, UNSURE:]
        )
    assert np.mean(found[batch.share > 0.5]) >= 0.5 * wild


def test_a_stretch_that_loses_its_wall_is_taken_by_itself(
    bench: Any, lose: Callable[..., WallTrace], monkeypatch: pytest.MonkeyPatch
) -> None:
    batch, believed = _batch(bench, lose, 3, 0.0)
    by_itself = []
    monkeypatch.setattr(cleaning, "robustly", lambda *given, **more: by_itself.append(1) or robustly(*given, **more))
    contradicted(batch, believed, GAINS, gate=GATE)
    # those that jump, and no others
    assert len(by_itself) == len(range(1, GROUPS, 5))


def _agitation_alone(batch: Batch, believed: Beliefs, i: int, step_m: float) -> FloatArray:
    """By the filter of one stretch, in NumPy."""
    first = int(batch.first_bin[i])
    samples, measured, readings = _alone(batch, i, step_m)
    model, trusted = believed.model(first, batch.level[i]), ~samples.suspect[measured]
    bins = int(readings.bin[-1]) + 1 if readings.bin.size else 1
    factor = np.ones(bins)
    both = np.flatnonzero((readings.bin[1:] == readings.bin[:-1]) & trusted[1:] & trusted[:-1])
    for _ in range(cleaning.AGITATION_ROUNDS):
        restless = replace(model, from_bin=0, agitation=factor)
        found = forward(moves([restless], 0, bins), readings, blank(model.covariance), allowed=trusted)
        away = readings.value - np.einsum("ij,ij->i", readings.h, found.mean[readings.bin])
        share = away**2 / (found.expected + readings.variance)
        apart = np.minimum((away[both] - away[both + 1]) ** 2, (away[both] + away[both + 1]) ** 2)
        agree = apart < cleaning.AGREEMENT * (readings.variance[both] + readings.variance[both + 1])
        surprise = np.where(agree, np.minimum(share[both], share[both + 1]), 0.0)
        excess = np.ones(bins)
        for begin in range(0, bins, cleaning.AGITATION_BINS // 2):
            end = begin + cleaning.AGITATION_BINS
            near = surprise[(readings.bin[both] >= begin) & (readings.bin[both] < end)]
            if near.size >= cleaning.AGITATION_BINS // 2:
                ratio = np.median(near) / cleaning.NORMAL_MEDIAN
                if ratio > cleaning.AGITATED:
                    excess[begin:end] = np.maximum(excess[begin:end], ratio)
        if not (excess > 1).any():
            break
        factor = np.minimum(factor * excess**2, cleaning.AGITATION_LIMIT)
    return factor


@pytest.mark.parametrize("wild", [0.0, 0.05])
def test_restlessness_is_that_of_one_filter_after_the_other(
    bench: Any, lose: Callable[..., WallTrace], wild: float
) -> None:
    batch, believed = _batch(bench, lose, 5, wild)
    # half of the stretches are louder than is believed of them
    batch = replace(batch, level=batch.level * np.where(np.arange(GROUPS) % 2, 0.02, 1.0)[:, None])
    believed = replace(believed, priors=(replace(PRIORS[0], floor=1e-5), replace(PRIORS[1], floor=1e-5)))
    found = agitations(batch, believed, GAINS)
    for i in range(GROUPS):
        np.testing.assert_allclose(found[i], _agitation_alone(batch, believed, i, bench.step_m), rtol=1e-6)
    assert sum(one.max() > 1 for one in found) >= GROUPS // 3
    assert sum(one.max() == 1 for one in found) >= 2


def test_samples_of_a_batch_are_those_of_its_stretches(bench: Any, lose: Callable[..., WallTrace]) -> None:
    batch, _ = _batch(bench, lose, 6, 0.1)
    for i, samples in enumerate(batch.samples()):
        size = int(batch.size[i])
        np.testing.assert_array_equal(samples.wall, np.tile([0, 1], size))
        np.testing.assert_array_equal(samples.bin, np.rint(samples.arc_m / bench.step_m))
        np.testing.assert_allclose(samples.arc_m, batch.arc_start_m[i] + np.repeat(np.arange(size), 2) * bench.step_m)
        np.testing.assert_array_equal(samples.gate_variance, batch.variance[i, :, :size].ravel(order="F"))
        kept = batch.share[i, :, :size].ravel(order="F") > 1e-3
        np.testing.assert_array_equal(samples.place_m[kept], batch.place_m[i, :, :size].ravel(order="F")[kept])
        assert np.isnan(samples.place_m[~kept]).all()


def test_samples_as_far_apart_as_no_others_are_refused(bench: Any, lose: Callable[..., WallTrace]) -> None:
    course = bench.tone(500.0, 0.01, groups=2)
    stretch = stretch_of(bench.traces(course, course, groups=1)[0])
    with pytest.raises(GramoscopeError, match="one every 4 µm, as before"):
        batch_of([(stretch, np.zeros(2))], 4e-6)
