"""How scores become steps: both walls together, one wall alone, and what the cut does not use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import ArgumentError
from gramoscope.pickup.overlay import places_brighter
from gramoscope.pickup.texture import reading
from gramoscope.pickup.texture.filter_bank import FilterBank
from gramoscope.pickup.texture.hearing import add_up, clear_columns, listen, told, told_by
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.learning import Learning
from gramoscope.pickup.texture.likelihood import StripeStatistics
from gramoscope.pickup.texture.reading import (
    Evidence,
    Model,
    Rules,
    evidence,
    read,
    spaced,
    step,
)
from gramoscope.pickup.texture.spectrum import Band
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.tone import Tone

WIDTH = 800
RULES = Rules()
COLUMN = np.arange(WIDTH)


def _evidence(missing_px: FloatArray, information: FloatArray | float = 2.0) -> Evidence:
    """Walls that lie by so much beside their paths, and say so without noise."""
    i = np.broadcast_to(np.asarray(information, np.float64), missing_px.shape).copy()
    return Evidence(missing_px * i, i, np.ones(2))


def _walls(inner_px: float, outer_px: float) -> FloatArray:
    return np.tile([[inner_px], [outer_px]], WIDTH)


@pytest.mark.parametrize(
    ("cut", "missing"),
    [("lateral", (0.3, 0.3)), ("vertical", (-0.3, 0.3)), ("stereo", (0.3, -0.1)), ("stereo", (0.0, 0.4))],
)
def test_what_is_missing_is_what_the_path_is_moved_by(cut: Cut, missing: tuple[float, float]) -> None:
    np.testing.assert_allclose(step(_evidence(_walls(*missing)), cut, RULES), _walls(*missing), atol=1e-12)


@pytest.mark.parametrize(("cut", "sign"), [("lateral", 1.0), ("vertical", -1.0)])
def test_a_silent_wall_goes_along_with_the_other(cut: Cut, sign: float) -> None:
    information = np.full((2, WIDTH), 2.0)
    information[INNER, 300:500] = 0
    swing = 0.3 * np.sin(2 * np.pi * COLUMN / 300)
    moved = step(_evidence(np.array([sign * swing, swing]), information), cut, RULES)
    np.testing.assert_allclose(moved[INNER], sign * moved[OUTER], atol=1e-12)
    assert np.abs(moved[OUTER] - swing)[50:-50].max() < 0.05


def test_a_silent_wall_of_a_stereo_cut_stays_where_it_is() -> None:
    information = np.full((2, WIDTH), 2.0)
    information[INNER] = 0
    moved = step(_evidence(_walls(0.4, 0.2), information), "stereo", RULES)
    assert (moved[INNER] == 0).all()
    np.testing.assert_allclose(moved[OUTER], 0.2)


def test_nothing_seen_moves_nothing() -> None:
    for cut in ("lateral", "vertical", "stereo"):
        assert (step(_evidence(_walls(0.4, 0.2), 0.0), cut, RULES) == 0).all()


@pytest.mark.parametrize(("cut", "sign"), [("lateral", 1.0), ("vertical", -1.0)])
def test_what_the_cut_does_not_use_follows_slowly(cut: Cut, sign: float) -> None:
    fast, slow = np.sin(2 * np.pi * COLUMN / 150), np.full(WIDTH, 0.5)
    # walls that move as the cut does not let them
    against = np.array([-sign * fast, fast])
    assert np.abs(step(_evidence(0.5 * against), cut, RULES))[:, 200:-200].max() < 0.1
    steady = step(_evidence(np.array([-sign * slow, slow])), cut, RULES)
    np.testing.assert_allclose(steady[OUTER], 0.5, atol=0.01)
    np.testing.assert_allclose(steady[INNER], -sign * 0.5, atol=0.01)


def test_a_wall_that_knows_more_has_more_to_say() -> None:
    information = np.array([np.full(WIDTH, 3.0), np.full(WIDTH, 1.0)])
    fast = 0.4 * np.sin(2 * np.pi * COLUMN / 150)
    moved = step(_evidence(np.array([fast, 0 * fast]), information), "lateral", RULES)
    middle = slice(200, -200)
    assert (moved.mean(axis=0) * fast)[middle].sum() / (fast**2)[middle].sum() == pytest.approx(0.75, abs=0.1)


def test_no_step_is_larger_than_the_rules_allow() -> None:
    moved = step(_evidence(_walls(9.0, 9.0)), "lateral", RULES)
    assert np.abs(moved).max() <= 2 * RULES.largest_step_px
    assert step(_evidence(_walls(9.0, 9.0)), "stereo", RULES).max() == RULES.largest_step_px


def test_steps_are_as_quiet_as_the_rules_allow_and_not_quieter_than_sound_needs() -> None:
    rng = np.random.default_rng(4)
    information = 0.5

    def noise_px(rules: Rules) -> float:
        score = np.sqrt(information) * rng.normal(size=(40, 2, WIDTH))
        steps = [step(Evidence(one, np.full((2, WIDTH), information), np.ones(2)), "stereo", rules) for one in score]
        return float(np.std(np.array(steps)[:, :, 100:-100]))

    assert noise_px(Rules(smooth_px=20.0, step_noise_px=0.18)) == pytest.approx(0.18, rel=0.15)
    least = 1 / np.sqrt(2 * np.sqrt(np.pi) * 20 * information)
    assert noise_px(Rules(smooth_px=20.0, step_noise_px=5.0)) == pytest.approx(least, rel=0.15)


def test_a_stretch_that_is_longer_than_the_passage_taught_is_refused(another: Stretch, layout: StripeLayout) -> None:
    deaf = FilterBank(*(np.zeros(shape, np.float32) for shape in ((35, 5), (1, 2, 5), (2,), (5, 16))))
    known = StripeStatistics(deaf, 1.0, 1.0, 0.0, np.ones(35), 900)
    model = Model(layout, Tone(), np.ones(1), 9, Band(), 864, (known, known))
    with pytest.raises(ArgumentError, match="a stretch of 900 columns") as told:
        evidence(another, model, RULES)
    assert "at most 864" in str(told.value)


def test_a_model_is_as_precise_as_all_its_stripes_together(layout: StripeLayout) -> None:
    deaf = FilterBank(*(np.zeros(shape, np.float32) for shape in ((35, 5), (1, 2, 5), (2,), (5, 16))))
    one, other = (
        StripeStatistics(deaf, answer, power, 0.0, np.ones(35), columns)
        for answer, power, columns in ((4.0, 8.0, 900), (0.5, 0.1, 7000))
    )
    model = Model(layout, Tone(), np.ones(1), 9, Band(), 64, (one, None, other))
    # the error of a mean of n columns is √(J/n)/I
    assert model.precision == pytest.approx(900 * 4.0**2 / 8 + 7000 * 0.5**2 / 0.1)
    assert replace(model, stripes=(None, None)).precision == 0


def _clear(stretch: Stretch, layout: StripeLayout, **changed: object) -> np.ndarray:
    still = replace(stretch, displacement_px=np.full((2, 900), 0.3), **changed)
    rows, clear = clear_columns(still, layout, np.array([0]), half_px=9, least_support=RULES.least_support)
    np.testing.assert_allclose(rows, layout.rest_row[0] + 0.3)
    return clear[0]


def test_columns_that_are_burnt_thin_or_without_stripe_are_not_clear(another: Stretch, layout: StripeLayout) -> None:
    assert _clear(another, layout).all()
    burnt, usable, support = np.zeros(another.columns.shape, bool), another.usable.copy(), another.support.copy()
    row = round(layout.rest_row[0])
    burnt[100:110, row - 4 : row + 4] = True
    burnt[200:210, row - 4] = True
    burnt[300:310, row + 20 :] = True
    np.testing.assert_array_equal(places_brighter(burnt.astype(np.float32), np.float32(0.5)), np.argwhere(burnt))
    spoilt = np.flatnonzero(~_clear(another, layout, burnt=places_brighter(burnt.astype(np.float32), np.float32(0.5))))
    np.testing.assert_array_equal(spoilt, np.arange(100, 110), "one grain is none")
    usable[:40] = False
    np.testing.assert_array_equal(np.flatnonzero(~_clear(another, layout, usable=usable)), np.arange(40))
    support[0, 500:] = 0.5 * RULES.least_support
    support[1] = 0
    np.testing.assert_array_equal(np.flatnonzero(~_clear(another, layout, support=support)), np.arange(500, 900))
    away = replace(another, displacement_px=np.full((2, 900), 1e3))
    assert not clear_columns(away, layout, np.arange(2), half_px=9, least_support=0.0)[1].any()


def test_a_damaged_place_says_nothing_and_spoils_nothing(
    stretches: list[Stretch], another: Stretch, layout: StripeLayout, true_px: Callable[[int], FloatArray]
) -> None:
    learning = Learning(half_px=9, largest_lag_px=60, loading=(0.03, 0.01), least_columns=3000, folds=3)
    models = [lesson.whole for lesson in learning.learn(stretches, layout, "lateral", RULES, map)]
    columns = another.columns.copy()
    columns[400:480] = 100.0  # neither wall
    columns[600:606, 60:] += 300.0  # a scratch over the inner wall
    path, found = read(replace(another, columns=columns), models, "lateral", RULES)
    assert (found.information[:, 425:455] == 0).all()
    assert (found.score[:, 425:455] == 0).all()
    assert (found.information[INNER, 596:610] < 1e-6).all()
    assert (found.information[OUTER, 596:610] > 0).all()
    whole, _ = read(another, models, "lateral", RULES)
    far = np.r_[60:330, 700:840]
    assert np.std((path.displacement_px - whole.displacement_px).mean(axis=0)[far]) < 0.1
    # the bridge is as wrong as the start was, no worse
    assert np.abs(path.displacement_px - true_px(77)).max() < np.abs(another.displacement_px - true_px(77)).max() + 0.7
    assert np.isfinite(evidence(path, models[-1], RULES).score).all()


def _noisy(one: Stretch, seed: int) -> Stretch:
    noise = 3.0 * np.random.default_rng([seed, 9]).normal(size=one.columns.shape)
    return replace(one, columns=(one.columns + noise).astype(np.float32))


def test_where_texture_tells_little_paths_are_better_when_both_sides_are_heard(
    stretches: list[Stretch], another: Stretch, layout: StripeLayout, true_px: Callable[[int], FloatArray]
) -> None:
    errors, spreads = np.zeros((2, 2)), []
    for draw, k in np.ndindex(errors.shape):
        noisy = [_noisy(one, 100 * draw + i) for i, one in enumerate(stretches)]
        noises = (0.0, 4.0)[k]
        learning = Learning(
            half_px=9,
            largest_lag_px=60,
            loading=(0.03, 0.01, 0.003, 0.001, 0.001),
            least_columns=3000,
            folds=3,
            spread_noises=noises,
            spread_limit_px=min(noises, 0.8),
        )
        models = [lesson.whole for lesson in learning.learn(noisy, layout, "lateral", RULES, map)]
        paths = [read(_noisy(another, 1000 * draw + 70 + i), models, "lateral", RULES)[0] for i in range(16)]
        errors[draw, k] = np.std([(one.displacement_px - true_px(77)).mean(axis=0)[60:-60] for one in paths])
        spreads.append([model.spread_px for model in models])
    # a path settles where the score is zero, and there its noise looks like an answer
    assert errors[:, 1].mean() < 0.95 * errors[:, 0].mean()
    assert spreads[0] == [0.0] * 5
    assert spreads[1][0] == 0.8
    known = models[-2].path_noise_px(RULES.smooth_px)
    assert spreads[-1][-1] == pytest.approx(min(4.0 * known, 0.8))


@pytest.fixture(scope="module")
def seven(stretches: list[Stretch], layout: StripeLayout) -> list[Model]:
    loading = (0.03, 0.03, 0.01, 0.003, 0.001, 0.001, 0.001)
    learning = Learning(half_px=9, largest_lag_px=60, loading=loading, least_columns=3000, folds=3)
    return [lesson.whole for lesson in learning.learn(stretches, layout, "lateral", RULES, map)]


PLAIN = replace(RULES, gain=1.0, momentum=0.0)
HURRIED_AND_PLAIN = ((5, RULES), (7, PLAIN), (5, PLAIN))


def test_five_hurried_rounds_follow_treble_better_than_seven_plain_ones(
    seven: list[Model],
    with_treble: Callable[[float], tuple[Stretch, FloatArray]],
    true_px: Callable[[int], FloatArray],
) -> None:
    middle, column = slice(60, -60), np.arange(900)
    stretch, tone = with_treble(45.0)
    wave = np.exp(2j * np.pi * column / 45)[middle]
    kept, error = [], []
    for rounds, rules in HURRIED_AND_PLAIN:
        path, _ = read(stretch, [seven[i] for i in spaced(7, rounds)], "lateral", rules)
        found = (path.displacement_px - true_px(78)).mean(axis=0)[middle]
        kept.append(abs(found @ wave) / abs(tone[0, middle] @ wave))
        error.append(np.std(found - tone[0, middle]))
    assert 1.05 > kept[0] > kept[1] + 0.05 > kept[2] + 0.1
    assert error[0] < error[1] < error[2]


def test_five_hurried_rounds_end_where_seven_plain_ones_do(
    seven: list[Model], another: Stretch, true_px: Callable[[int], FloatArray]
) -> None:
    start = another.displacement_px - true_px(77)
    across_it = replace(another, displacement_px=true_px(77) - start)
    left, error = [], []
    for rounds, rules in HURRIED_AND_PLAIN[:2]:
        models = [seven[i] for i in spaced(7, rounds)]
        one, other = (read(which, models, "lateral", rules)[0].displacement_px for which in (another, across_it))
        left.append(np.std((one - other).mean(axis=0)[60:-60]) / np.std(2 * start[0, 60:-60]))
        error.append(np.std((one - true_px(77)).mean(axis=0)[60:-60]))
    assert max(left) < 0.08
    assert error[0] < 1.25 * error[1] < 0.4 * np.std(start)


@pytest.mark.parametrize("rules", [RULES, PLAIN, Rules(gain=0.8, momentum=0.5)])
def test_steps_are_as_long_as_the_rules_say_and_go_on_as_long(
    another: Stretch, monkeypatch: pytest.MonkeyPatch, seven: list[Model], rules: Rules
) -> None:
    tone = np.tile(np.sin(2 * np.pi * np.arange(900) / 90.0 + 0.4), (2, 1))

    def told(stretch: Stretch, *_: object, **__: object) -> Evidence:
        return Evidence(9.0 * (tone - stretch.displacement_px), np.full((2, 900), 9.0), np.ones(2))

    monkeypatch.setattr(reading, "evidence", told)
    read_, _ = read(replace(another, displacement_px=0 * tone), seven[:5], "lateral", rules)
    # known to a tenth of what the rules allow, so smoothed by the least; a sine stays one
    share = np.exp(-2 * (np.pi * rules.smooth_px / 90) ** 2)
    place = move = 0.0
    for _ in range(5):
        move = rules.gain * share * (1 - place) + rules.momentum * move
        place += move
    middle = slice(250, -250)
    np.testing.assert_allclose(read_.displacement_px[:, middle], place * tone[:, middle], atol=0.01)


def test_a_path_is_judged_where_it_ends(seven: list[Model], another: Stretch) -> None:
    path, found = read(another, seven[:3], "lateral", RULES)
    again = evidence(path, seven[2], RULES)
    for name in ("score", "information", "surprise"):
        np.testing.assert_array_equal(getattr(found, name), getattr(again, name))


def test_what_is_told_in_one_kernel_is_what_is_told_step_by_step(seven: list[Model], another: Stretch) -> None:
    model = seven[-1]
    ear, seen, limits = model.ear, another.in_tone(model.tone), RULES.power_limits

    def heard(rows: np.ndarray, clear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        said, weight = np.empty(rows.shape), np.empty(rows.shape, np.float32)
        listen(seen.columns, rows, clear, ear.half_px, *ear.for_listening, limits, said, weight)
        return said, weight

    at_once = told(ear, model.layout, seen, least_support=RULES.least_support, power_limits=limits)
    in_steps = told_by(heard, ear, model.layout, seen, least_support=RULES.least_support)
    for name in ("score", "information", "said", "weight"):
        np.testing.assert_array_equal(getattr(at_once, name), getattr(in_steps, name))
    assert at_once.information.max() > 0


def test_channels_are_those_of_the_whitened_window(seven: list[Model], another: Stretch, layout: StripeLayout) -> None:
    model, row = seven[-1], layout.rows(another.displacement_px)[0]
    statistics = model.stripes[0]
    assert statistics is not None
    window = model.window(another.columns, row)
    assert window.shape == (900, 35)
    expected = window.astype(np.float64) @ statistics.bank.basis
    found = model.channels(another.columns, row, statistics.bank)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("count", "rounds", "which"),
    [
        (7, 5, [1, 2, 4, 5, 6]),
        (3, 5, [0, 1, 2]),
        (7, 1, [6]),
        (7, 7, [0, 1, 2, 3, 4, 5, 6]),
        (6, 3, [1, 3, 5]),
        (1, 1, [0]),
    ],
)
def test_rounds_are_evenly_spaced_and_end_with_the_last_model(count: int, rounds: int, which: list[int]) -> None:
    assert spaced(count, rounds) == which


def test_a_tone_is_laid_upon_a_picture_once(another: Stretch) -> None:
    tone = Tone(100.0, 0.9)
    before = another.columns.copy()
    seen = another.in_tone(tone)
    np.testing.assert_array_equal(seen.columns, tone(before))
    np.testing.assert_array_equal(another.columns, before)
    assert seen.in_tone(tone) is seen
    assert another.in_tone(Tone(80.0, 0.0)) is another
    with pytest.raises(AssertionError):
        seen.in_tone(Tone(100.0, 0.5))


def test_what_is_said_beside_a_path_counts_as_if_it_had_been_said_of_the_path() -> None:
    # stripes that answer 4 and 1 to a row, of a path that is missed by 0.3 rows on one wall and −0.1 on the other
    information, wall, missed = np.array([4.0, 1.0, 1.0]), np.array([0, 1, 1]), np.array([0.3, -0.1])
    aside, weight = np.random.default_rng(1).uniform(-0.5, 0.5, (3, 50)) / 32, np.full((3, 50), 0.5, np.float32)
    said = information[:, None] * (missed[wall][:, None] + aside)
    score, known = np.zeros((2, 2, 50))
    add_up(said, weight, aside, wall, information, score, known)
    np.testing.assert_allclose(score / known, np.broadcast_to(missed[:, None], (2, 50)), atol=1e-12)
    np.testing.assert_allclose(known[:, 0], [2.0, 1.0])
