"""What stretches teach about one stripe of theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.conventions import FloatArray
from gramoscope.errors import ArgumentError
from gramoscope.pickup.texture import stripe_learning
from gramoscope.pickup.texture.filter_bank import witness_forms
from gramoscope.pickup.texture.following import REACH, STEPS, stepped
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import StripeStatistics
from gramoscope.pickup.texture.reading import Model, Rules, evidence
from gramoscope.pickup.texture.spectrum import Band, whitening_filter
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.stripe_learning import StripeLearning, StripeMaterial
from gramoscope.pickup.texture.tone import Tone

RULES = Rules()
BAND = Band()
SHORT = StripeLearning(largest_lag_px=60, least_columns=3000)
FOLDS = 3
WHITENER = whitening_filter(1 / (1 + (np.linspace(0, 0.5, 129) / 0.06) ** 2), BAND)


@pytest.fixture(scope="module")
def true(stretches: list[Stretch], true_px: Callable[[int], FloatArray]) -> list[Stretch]:
    """All stretches with their paths where the walls are."""
    return [replace(one, displacement_px=true_px(number)) for number, one in enumerate(stretches)]


def _material(stretches: list[Stretch], layout: StripeLayout, number: int = 1) -> StripeMaterial:
    blank = Model(layout, Tone(), WHITENER, 9, BAND, 960, ())
    return StripeMaterial(stretches, np.arange(len(stretches)) % FOLDS, FOLDS, blank, number, RULES, map)


@pytest.fixture(scope="module")
def material(true: list[Stretch], layout: StripeLayout) -> StripeMaterial:
    return _material(true, layout)


@pytest.fixture(scope="module")
def known(material: StripeMaterial) -> list[StripeStatistics]:
    return _taught(material)


def _taught(material: StripeMaterial) -> list[StripeStatistics]:
    learned = [one for one in SHORT.learn(material, None, 0.003) if one is not None]
    assert len(learned) == FOLDS + 1
    return learned


def _in_steps(stretch: Stretch, layout: StripeLayout, number: int = 1) -> Stretch:
    """The same stretch, a stripe of it where reading follows it: what is said is then not told from a place beside it."""
    rows = layout.rest_row[number] + stretch.displacement_px
    stepped(rows, np.empty_like(rows))
    return replace(stretch, displacement_px=rows - layout.rest_row[number])


def test_every_fold_is_left_out_once_and_nothing_of_the_whole(material: StripeMaterial, true: list[Stretch]) -> None:
    *without, whole = material.sums(None, 60)
    np.testing.assert_allclose(sum(one.product for one in without), (FOLDS - 1) * whole.product, rtol=1e-9)
    assert whole.columns == pytest.approx(sum(one.columns for one in without) / (FOLDS - 1))
    louder = [replace(one, columns=2 * one.columns) if k % FOLDS == 1 else one for k, one in enumerate(true)]
    *changed, _ = replace(material, stretches=louder).sums(None, 60)
    same = [np.array_equal(one.product, other.product) for one, other in zip(without, changed, strict=True)]
    assert same == [False, True, False]


@pytest.mark.parametrize("number", [0, 1])
def test_the_change_of_spectra_is_what_happens_when_paths_are_moved(
    true: list[Stretch], layout: StripeLayout, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    told: list[tuple[FloatArray, ...]] = []

    def noted(*asked: FloatArray, **more: Any) -> tuple[FloatArray, FloatArray]:
        told.append(asked)
        return witness_forms(*asked, **more)

    monkeypatch.setattr(stripe_learning, "witness_forms", noted)
    few = StripeLearning(largest_lag_px=60, change_lag_px=25, least_columns=1000)
    few.learn(_material(true, layout, number), None, 0.003)
    _, change = told[-1]
    step_px, frequency = 0.2, BAND.frequencies(few.length)
    lower, higher = (
        _material([one.moved(np.full((2, 1), side)) for one in true], layout, number)
        .sums(None, 25)[-1]
        .spectra(frequency, largest_lag_px=25)[:, REACH:-REACH, REACH:-REACH]
        for side in (-step_px, step_px)
    )
    moved = (higher - lower) / (2 * step_px)
    assert change.shape == moved.shape
    # another interpolation, and not the same columns
    assert np.std(change - moved) < 0.1 * np.std(moved)


def test_filters_are_of_loudness_one_together(material: StripeMaterial, known: list[StripeStatistics]) -> None:
    heard = []
    for stretch in material.stretches:
        channels = material.model.channels(stretch.columns, material.clear(stretch)[0], known[-1].bank)
        heard.append(known[-1].bank.heard(channels, band=BAND, length=material.model.length)[1])
    assert np.mean(heard) == pytest.approx(1, abs=0.05)


def test_channels_show_the_usual_texture_of_power_one(material: StripeMaterial, known: list[StripeStatistics]) -> None:
    power = []
    for stretch in material.stretches:
        channels = material.model.channels(stretch.columns, material.clear(stretch)[0], known[-1].bank)
        power.append(known[-1].bank.power(channels))
    assert np.mean(power) == pytest.approx(1, abs=0.03)
    assert all(np.array_equal(one.bank.basis, known[-1].bank.basis) for one in known), "and are those of all folds"


def _evidence(stretches: list[Stretch], material: StripeMaterial, known: list[StripeStatistics]) -> list[FloatArray]:
    """Score and information of each stretch by what the others taught, shape (2, column)."""
    wall = material.model.layout.wall[1]
    models = [replace(material.model, stripes=(None, one)) for one in known]
    found = [evidence(one, models[k], RULES) for one, k in zip(stretches, material.fold, strict=True)]
    return [np.array([one.score[wall], one.information[wall]]) for one in found]


def test_scores_are_zero_on_average_and_answer_to_a_moved_path_as_they_claim(
    true: list[Stretch], layout: StripeLayout
) -> None:
    move_px = 0.1
    # without its mean, which would take digits of single precision: reading does in one step what learning does in two
    even = [replace(one, columns=one.columns - np.float32(100)) for one in true]
    material = _material([_in_steps(one, layout) for one in even], layout)
    known = _taught(material)
    asked = []
    for side in (-move_px, 0.0, move_px):
        moved = [one.moved(np.full((2, 1), side)) for one in material.stretches]
        score, information = np.sum(_evidence(moved, material, known), axis=(0, 2))
        asked.append(score / information)
    assert asked[1] == pytest.approx(0, abs=1e-6 * move_px)
    assert asked[0] - asked[2] == pytest.approx(2 * move_px, rel=0.02)


def test_beside_the_place_where_reading_follows_scores_are_told_by_what_is_known_there(
    material: StripeMaterial, known: list[StripeStatistics], layout: StripeLayout
) -> None:
    there = [_in_steps(one, layout) for one in material.stretches]
    beside_px = 0.3 / STEPS
    beside = [one.moved(np.full((2, 1), beside_px)) for one in there]
    (score, information), (score_, information_) = (
        np.concatenate(_evidence(some, material, known), axis=1) for some in (there, beside)
    )
    np.testing.assert_array_equal(information, information_)
    np.testing.assert_allclose(score - score_, beside_px * information, rtol=1e-9, atol=1e-9)


def test_scores_are_as_good_as_zero_on_paths_anywhere(material: StripeMaterial, known: list[StripeStatistics]) -> None:
    score, information = np.sum(_evidence(material.stretches, material, known), axis=(0, 2))
    assert abs(score / information) < 0.1 / np.sqrt(information), "a tenth of its standard error"


def test_error_bars_of_a_path_that_was_not_learned_from_are_as_claimed(
    material: StripeMaterial, known: list[StripeStatistics]
) -> None:
    # in pieces that are long against grains
    pieces = np.array(_evidence(material.stretches, material, known)).reshape(-1, 2, 10, 90).sum(axis=3)
    assert np.std(pieces[:, 0] / np.sqrt(pieces[:, 1])) == pytest.approx(1, abs=0.2)


def test_a_stripe_seen_too_little_teaches_nothing(material: StripeMaterial) -> None:
    demanding = replace(SHORT, least_columns=20_000)
    assert demanding.learn(material, None, 0.003) == [None] * (FOLDS + 1)


@pytest.mark.parametrize("lag", [20, 60, 150])
def test_bins_are_just_enough_to_tell_all_lags_apart(lag: int) -> None:
    length = replace(SHORT, largest_lag_px=lag).length
    assert 2 * lag < length < 2.2 * lag + 12


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"patterns": 0}, "0 of 16 channels"),
        ({"patterns": 16}, "16 of 16 channels"),
        ({"filters": 3}, "3 filters"),
        ({"filters": 0}, "0 filters"),
        ({"filters": 18}, "18 filters"),
    ],
)
def test_filters_and_channels_that_cannot_be_are_refused(changed: dict[str, int], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        StripeLearning(**changed)
