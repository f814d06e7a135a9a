"""What passages teach: paths get better, error bars are true, and nobody marks his own work."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.conventions import FloatArray
from gramoscope.errors import ArgumentError
from gramoscope.pickup.texture import learning as learning_module
from gramoscope.pickup.texture import stripe_learning
from gramoscope.pickup.texture.following import wide_rows
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.learning import Learning, Lesson
from gramoscope.pickup.texture.likelihood import StripeStatistics
from gramoscope.pickup.texture.reading import Evidence, Model, Rules, evidence, read
from gramoscope.pickup.texture.spectrum import Band, whitening_filter
from gramoscope.pickup.texture.stretch import Stretch

SHORT = Learning(half_px=9, largest_lag_px=60, loading=(0.03, 0.01, 0.003), least_columns=3000, folds=3)
RULES = Rules()
AWAY_FROM_ENDS = slice(60, -60)
BANK = ("basis", "filters", "sign", "usual")
NUMBERS = ("information", "score_power", "mean_score", "columns")


def _learned(stretches: list[Stretch], layout: StripeLayout, spread: Any = map, **changed: Any) -> tuple[Lesson, ...]:
    return replace(SHORT, **changed).learn(stretches, layout, "lateral", RULES, spread)


@pytest.fixture(scope="module")
def lessons(stretches: list[Stretch], layout: StripeLayout) -> tuple[Lesson, ...]:
    return _learned(stretches, layout)


def _read(stretch: Stretch, lessons: tuple[Lesson, ...], fold: int) -> tuple[Stretch, Evidence]:
    return read(stretch, [lesson.without[fold] for lesson in lessons], "lateral", RULES)


def _common(error: FloatArray) -> FloatArray:
    return error.mean(axis=0)[AWAY_FROM_ENDS]


def test_paths_get_better_by_what_the_other_stretches_taught(
    stretches: list[Stretch], lessons: tuple[Lesson, ...], true_px: Callable[[int], FloatArray]
) -> None:
    before, after = [], []
    for number, stretch in enumerate(stretches):
        read_, _ = _read(stretch, lessons, number % 3)
        before.append(_common(stretch.displacement_px - true_px(number)))
        after.append(_common(read_.displacement_px - true_px(number)))
    # the passage cannot know where the stripes lie at rest: a constant of all stretches is left
    assert np.std(before) > 0.4
    assert np.std(after) < 0.3 * np.std(before)


def test_a_stretch_that_nobody_learned_from_is_read_as_well(
    another: Stretch, lessons: tuple[Lesson, ...], true_px: Callable[[int], FloatArray]
) -> None:
    read_, found = read(another, [lesson.whole for lesson in lessons], "lateral", RULES)
    assert np.std(_common(read_.displacement_px - true_px(77))) < 0.3 * np.std(
        _common(another.displacement_px - true_px(77))
    )
    assert (found.information[:, AWAY_FROM_ENDS] > 0).all()
    np.testing.assert_allclose(found.surprise, 1.0, atol=0.6)


def _same(one: Model, other: Model) -> bool:
    if one.tone != other.tone or not np.array_equal(one.whitener, other.whitener):
        return False
    pairs = zip(one.stripes, other.stripes, strict=True)
    return all(
        a is not None
        and b is not None
        and all(np.array_equal(getattr(a.bank, name), getattr(b.bank, name)) for name in BANK)
        and np.array_equal(a.row_power, b.row_power)
        and all(getattr(a, name) == getattr(b, name) for name in NUMBERS)
        for a, b in pairs
    )


def _scattered(pool: ThreadPoolExecutor) -> Callable[..., Iterator[Any]]:
    """A map whose tasks begin in the wrong order."""

    def spread(work: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        listed = list(tasks)
        futures = {i: pool.submit(work, listed[i]) for i in reversed(range(len(listed)))}
        return iter([futures[i].result() for i in range(len(listed))])

    return spread


@pytest.mark.parametrize("threads", [1, 3])
def test_learning_again_with_any_number_of_threads_gives_the_same_bits(
    stretches: list[Stretch], layout: StripeLayout, lessons: tuple[Lesson, ...], threads: int
) -> None:
    with ThreadPoolExecutor(threads) as pool:
        again = _learned(stretches, layout, _scattered(pool))
    for one, other in zip(lessons, again, strict=True):
        assert _same(one.whole, other.whole)
        assert all(_same(a, b) for a, b in zip(one.without, other.without, strict=True))


def _form(statistics: StripeStatistics | None) -> FloatArray:
    """What the filters of a stripe say of the rows of a window, whichever way they are turned."""
    assert statistics is not None
    bank = statistics.bank
    rows = bank.filters.astype(np.float64) @ bank.basis.astype(np.float64).T
    return np.asarray(np.einsum("k,fki,fkj->fij", bank.sign, rows, rows))


def test_no_stretch_is_read_by_spectra_that_it_helped_to_make(
    stretches: list[Stretch], layout: StripeLayout, monkeypatch: pytest.MonkeyPatch
) -> None:
    # what is the whole passage's: the tone, the filter that makes windows white, what witnesses are worth, and in which
    # channels they are heard
    taps = whitening_filter(1 / (1 + (np.linspace(0, 0.5, 129) / 0.05) ** 2), Band())
    monkeypatch.setattr(learning_module, "whitening_filter", lambda power, band: taps)
    monkeypatch.setattr(stripe_learning, "best_shares", lambda answers, powers: np.array([0.3, 0.7]))
    basis, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(wide_rows(SHORT.half_px), SHORT.channels)))
    monkeypatch.setattr(stripe_learning, "common_channels", lambda forms, spectra, patterns, count: basis)
    learned = {"loading": (0.03,), "compressions": (0.0,)}
    spoilt = list(stretches)
    spectrum = np.fft.rfft(spoilt[4].columns, axis=0)
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, spectrum.shape)
    # every row as loud as it was at each frequency, but its neighbours know nothing of it
    torn = np.fft.irfft(
        np.abs(spectrum) * np.exp(1j * np.where(spectrum.imag == 0, 0, phase)), len(spoilt[4].columns), axis=0
    )
    spoilt[4] = replace(spoilt[4], columns=torn.astype(np.float32))
    one, other = (_learned(which, layout, **learned)[0] for which in (stretches, spoilt))
    for k in range(3):
        for a, b in zip(one.without[k].stripes, other.without[k].stripes, strict=True):
            apart = np.linalg.norm(_form(a) - _form(b)) / np.linalg.norm(_form(a))
            assert apart < 1e-4 if k == 4 % 3 else apart > 0.4
    assert not _same(one.whole, other.whole)


def test_paths_are_moved_by_what_the_other_folds_taught(
    stretches: list[Stretch], layout: StripeLayout, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved_by: list[Model] = []

    def noted(stretch: Stretch, model: Model, *rest: Any, **more: Any) -> Evidence:
        moved_by.append(model)
        return evidence(stretch, model, *rest, **more)

    monkeypatch.setattr(learning_module, "evidence", noted)
    (lesson,) = _learned(stretches[:7], layout, loading=(0.03,), least_columns=1000)
    assert len(moved_by) == 7
    for number, model in enumerate(moved_by):
        assert model is lesson.without[number % 3]


def _bright_grains(stretch: Stretch) -> Stretch:
    """The same stretch, its texture skewed."""
    return replace(stretch, columns=(100 * np.exp((stretch.columns - 100) / 14)).astype(np.float32))


def test_bright_grains_on_a_dark_ground_are_read_in_a_tone_that_hears_them_all(
    stretches: list[Stretch], layout: StripeLayout, true_px: Callable[[int], FloatArray]
) -> None:
    skewed = [_bright_grains(stretch) for stretch in stretches]
    one, other = (_learned(skewed, layout, loading=(0.03, 0.003), compressions=which) for which in ((0.0,), (0.0, 0.9)))
    assert [lesson.whole.tone.compression for lesson in other] == [0.0, 0.9]
    assert other[-1].whole.precision > 2 * one[-1].whole.precision
    assert all(model.tone == other[-1].whole.tone for model in other[-1].without)
    linear, compressed = (
        np.std(
            [
                _common(_read(stretch, lessons, number % 3)[0].displacement_px - true_px(number))
                for number, stretch in enumerate(skewed)
            ]
        )
        for lessons in (one, other)
    )
    assert compressed < 0.8 * linear


def test_texture_that_is_not_skewed_is_read_as_it_is(stretches: list[Stretch], layout: StripeLayout) -> None:
    dark = [replace(stretch, columns=stretch.columns - 75) for stretch in stretches]
    chosen = _learned(dark, layout, loading=(0.003,))[0].whole
    other = _learned(dark, layout, loading=(0.003,), compressions=(0.9,))[0].whole
    assert chosen.tone.compression == 0
    assert chosen.precision > 1.5 * other.precision


def test_the_first_exact_round_decides_the_tone_of_all_that_follow(
    stretches: list[Stretch], layout: StripeLayout, monkeypatch: pytest.MonkeyPatch
) -> None:
    weighed: list[float] = []

    def told(model: Model) -> float:
        weighed.append(model.tone.compression)
        return {0.2: 1.0, 0.0: 2.0, 0.9: 3.0, 0.5: 4.0}[model.tone.compression]

    monkeypatch.setattr(Model, "precision", property(told))
    few = stretches[:6]
    lessons = _learned(
        few, layout, loading=(0.03, 0.003, 0.01, 0.003), compressions=(0.2, 0.0, 0.5, 0.9), least_columns=1000
    )
    assert [lesson.whole.tone.compression for lesson in lessons] == [0.2, 0.5, 0.5, 0.5]
    assert weighed == [0.2, 0.2, 0.0, 0.5, 0.9, 0.5, 0.5]
    level = np.median([stretch.columns.mean() for stretch in few])
    assert lessons[1].whole.tone.level == pytest.approx(level)
    assert not np.array_equal(lessons[0].whole.whitener, lessons[1].whole.whitener)
    np.testing.assert_array_equal(lessons[1].whole.whitener, lessons[3].whole.whitener)


def test_the_inputs_stay_as_they_were(stretches: list[Stretch], layout: StripeLayout) -> None:
    names = ("columns", "usable", "burnt", "displacement_px", "support")
    before = {name: getattr(stretches[0], name).copy() for name in names}
    _learned(stretches[:6], layout, loading=(0.03,), least_columns=1000)
    for name in names:
        np.testing.assert_array_equal(getattr(stretches[0], name), before[name])


def test_a_stripe_seen_too_little_is_not_read(stretches: list[Stretch], layout: StripeLayout) -> None:
    seldom = []
    for number, stretch in enumerate(stretches):
        support = stretch.support.copy()
        support[1] *= number % 4 == 0
        seldom.append(replace(stretch, support=support))
    lesson = _learned(seldom, layout, loading=(0.03,))[-1]
    assert lesson.whole.stripes[0] is not None
    assert lesson.whole.stripes[1] is None
    assert all(model.stripes[1] is None for model in lesson.without), "nor by those that did not miss it"


def test_two_groups_teach_nothing_and_say_so(stretches: list[Stretch], layout: StripeLayout) -> None:
    for lesson in _learned(stretches[:2], layout):
        assert lesson.whole.stripes == (None, None)


def test_after_each_round_somebody_is_told(stretches: list[Stretch], layout: StripeLayout) -> None:
    told: list[int] = []
    SHORT.learn(stretches[:4], layout, "lateral", RULES, map, lambda: told.append(1))
    assert len(told) == len(SHORT.loading)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"half_px": 3}, "3 rows"),
        ({"folds": 1}, "1 folds"),
        ({"loading": ()}, "no rounds"),
        ({"compressions": ()}, "no tone"),
        ({"band_low": 0.4, "band_high": 0.3}, "a band"),
        ({"compressions": (0.0, 1.0)}, "1.0"),
        ({"spread_noises": -1.0}, "-1.0 standard errors"),
        ({"spread_limit_px": 1.0}, "1.0 px"),
        ({"channels": 17}, "17 channels"),
        ({"channels": 4}, "4 of 4 channels"),
        ({"filters": 5}, "5 filters"),
    ],
)
def test_impossible_settings_are_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        Learning(**changed)
