"""The cartridge around the likelihood: what it learns from, what its samples weigh, what it says when it knows nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.conventions import INNER, OUTER
from gramoscope.errors import ArgumentError
from gramoscope.pickup.overlay import TILE_COLUMNS, TILE_ROWS
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.reading import Evidence, Rules
from gramoscope.pickup.texture.samples import STRIDE_PX, samples_of
from gramoscope.pickup.texture.sharpness import sharpness
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture_likelihood import (
    Sight,
    TextureLikelihood,
    TexturePickup,
    sight_of,
    tiles_to_draw,
    worth_reading,
)
from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup
from gramoscope.simulation.scene import filming_bench

WIDTH = 203
RULES = Rules()


def _stretch(displacement_px: np.ndarray) -> Stretch:
    nothing = np.zeros((WIDTH, 5), np.float32)
    return Stretch(nothing, np.ones(WIDTH, bool), np.empty((0, 2), np.int64), displacement_px, np.ones((4, WIDTH)))


def _evidence(rng: np.random.Generator, information: np.ndarray) -> Evidence:
    return Evidence(np.sqrt(information) * rng.normal(size=information.shape), information, np.ones(2))


def test_a_sample_is_the_mean_of_its_columns_weighted_by_what_each_knows() -> None:
    rng = np.random.default_rng(2)
    path, information = rng.normal(5, 1, (2, WIDTH)), rng.uniform(0.5, 3, (2, WIDTH))
    found = _evidence(rng, information)
    place, sigma = samples_of(_stretch(path), found, RULES)
    assert place.shape == sigma.shape == (2, WIDTH // STRIDE_PX)
    each = path + found.score / information
    for sample in (0, 11, 24):
        mine = slice(sample * STRIDE_PX, (sample + 1) * STRIDE_PX)
        for wall in (0, 1):
            weight = information[wall, mine]
            assert place[wall, sample] == pytest.approx(np.average(each[wall, mine], weights=weight))
            assert sigma[wall, sample] == pytest.approx(1 / np.sqrt(weight.sum()))


def test_error_bars_are_true_when_scores_are() -> None:
    rng, everything = np.random.default_rng(3), replace(RULES, most_local_surprise=np.inf)
    information = rng.uniform(0.5, 3, (2, WIDTH))
    z = []
    for _ in range(60):
        place, sigma = samples_of(_stretch(np.full((2, WIDTH), 4.0)), _evidence(rng, information), everything)
        z.append((place - 4.0) / sigma)
    assert np.std(z) == pytest.approx(1, abs=0.04)


def test_samples_are_what_plain_sums_make_of_them() -> None:
    rng = np.random.default_rng(9)
    path, information = rng.normal(5, 1, (2, WIDTH)), rng.uniform(0.5, 3, (2, WIDTH))
    information[0, 80:120] = 0
    found = replace(_evidence(rng, information), surprise=np.array([1.4, 0.1]))
    found.score[1, 120:170] += 3.0
    place, sigma = samples_of(_stretch(path), found, RULES)
    moment, score, known = (
        one[:, : WIDTH // STRIDE_PX * STRIDE_PX].reshape(2, -1, STRIDE_PX).sum(axis=2)
        for one in (information * path + found.score, found.score, information)
    )
    usual = np.array([[1.4], [0.7]])
    with np.errstate(invalid="ignore", divide="ignore"):
        local = [np.where(known > 0, score**2 / (usual * known), 0.0), (known > 0).astype(float)]
        power, samples = (ndimage.gaussian_filter1d(one, 3.0, axis=1, mode="constant") for one in local)
        seen = (known > 0) & (power <= RULES.most_local_surprise * samples)
        assert 0 < np.count_nonzero(~seen[1]) < seen.shape[1]
        np.testing.assert_allclose(place, np.where(seen, moment / known, np.nan), rtol=1e-12)
        np.testing.assert_allclose(sigma, np.where(seen, np.sqrt(usual / known), np.nan), rtol=1e-12)


def test_a_wall_that_nobody_saw_has_no_place() -> None:
    information = np.ones((2, WIDTH))
    information[1] = 0
    information[0, 80:120] = 0
    place, sigma = samples_of(_stretch(np.zeros((2, WIDTH))), _evidence(np.random.default_rng(1), information), RULES)
    np.testing.assert_array_equal(np.isnan(place[0]), (np.arange(25) >= 10) & (np.arange(25) < 15))
    assert np.isnan(place[1]).all()
    np.testing.assert_array_equal(np.isnan(place), np.isnan(sigma))


def test_samples_whose_scores_are_no_noise_are_not_believed() -> None:
    rng, information = np.random.default_rng(6), np.ones((2, WIDTH))
    believed = []
    for _ in range(60):
        place, _ = samples_of(_stretch(np.zeros((2, WIDTH))), _evidence(rng, information), RULES)
        believed.append(np.isfinite(place))
    assert np.mean(believed) > 0.995
    found = _evidence(rng, information)
    # eight samples of one wall that ask for a move of four standard errors
    found.score[1, 72:136] += 4 / np.sqrt(STRIDE_PX)
    place, sigma = samples_of(_stretch(np.zeros((2, WIDTH))), found, RULES)
    assert np.isnan(place[1, 9:17]).all()
    assert np.isfinite(place[1, :4]).all()
    assert np.isfinite(place[1, 22:]).all()
    assert np.isfinite(place[0]).all()
    np.testing.assert_array_equal(np.isnan(place), np.isnan(sigma))
    # no surprise where the whole stretch is as loud
    place, _ = samples_of(_stretch(np.zeros((2, WIDTH))), replace(found, surprise=np.array([1.0, 9.0])), RULES)
    assert np.isfinite(place).all()


@pytest.mark.parametrize(
    ("surprise", "factor"), [(1.0, 1.0), (4.0, 2.0), (0.8, np.sqrt(0.8)), (np.nan, 1.0), (1e3, 3.0)]
)
def test_a_stretch_that_surprises_has_wider_error_bars(surprise: float, factor: float) -> None:
    usual = _evidence(np.random.default_rng(1), np.ones((2, WIDTH)))
    stretch = _stretch(np.zeros((2, WIDTH)))
    _, sigma = samples_of(stretch, usual, RULES)
    _, wider = samples_of(stretch, replace(usual, surprise=np.array([1.0, surprise])), RULES)
    np.testing.assert_array_equal(wider[0], sigma[0])
    np.testing.assert_allclose(wider[1], factor * sigma[1])


def test_nothing_but_noise_has_no_support_in_a_passage_that_shows_stripes() -> None:
    bench = filming_bench(height_px=640)
    cartridge = TextureLikelihood(bench)
    noise = np.random.default_rng(4).normal(120, 4, (4, 640, 640)).astype(np.uint8)
    seen = Sight(0, np.zeros(4), np.zeros(3), sharpness(noise, np.zeros(4)))
    layout = StripeLayout.of_bench(bench, edge_margin_px=-16.0)
    _, alone = TexturePickup(cartridge, layout).searched(seen)
    _, among = TexturePickup(cartridge, layout, usual_sharpness=20 * seen.sharp.typical).searched(seen)
    assert alone.max() > cartridge.rules.least_support > 2 * among.max()


def test_ends_that_cannot_be_read_are_drawn_all_the_same() -> None:
    bench = filming_bench(height_px=640)
    layout, ends = StripeLayout.of_bench(bench, edge_margin_px=-16.0), (slice(0, 130), slice(1150, 1280))

    def drawn(vertical_px: float) -> np.ndarray:
        # so far aside that no shallow stripe is in sight
        moved = np.array([-vertical_px, vertical_px]) - 60.0
        rows = layout.rows(np.repeat(moved[:, None], 1280, axis=1))
        return tiles_to_draw(rows, layout, (640, 1280), ends, half_px=12)

    at_rest, at_the_bottom = drawn(0.0), drawn(layout.from_bottom_px.min() - 6.0)
    middle, end = slice(256 // TILE_COLUMNS, 1024 // TILE_COLUMNS), slice(0, 128 // TILE_COLUMNS)
    assert at_rest[:, middle].any()
    bottom = round(layout.middle_row - 60) // TILE_ROWS
    deep = slice(bottom - 1, bottom + 2)
    assert not at_the_bottom[deep, middle].any()
    assert at_the_bottom[deep, end].all()


@pytest.mark.parametrize(
    ("usable", "most", "read"),
    [
        (slice(0, 200), 1000, slice(0, 200)),
        (slice(81, 150), 1000, slice(56, 174)),
        (slice(81, 190), 1000, slice(56, 200)),
        (slice(10, 190), 64, slice(0, 64)),
        (slice(81, 190), 64, slice(56, 120)),
    ],
)
def test_columns_that_rest_on_few_frames_are_not_read(usable: slice, most: int, read: slice) -> None:
    enough = np.zeros(200, bool)
    enough[usable] = True
    assert worth_reading(enough, most) == read


@pytest.mark.parametrize(("groups", "wanted"), [(1, 1), (5, 5), (64, 64), (65, 64), (6000, 64)])
def test_it_learns_from_groups_all_over_the_passage(groups: int, wanted: int) -> None:
    numbers = TextureLikelihood(Bench()).learning_groups(groups)
    assert numbers.size == np.unique(numbers).size == wanted
    assert numbers[0] == 0
    assert numbers[-1] == groups - 1
    assert np.diff(numbers).max(initial=1) <= np.ceil(groups / wanted) + 2


def test_learning_from_no_group_is_refused() -> None:
    with pytest.raises(ArgumentError, match="0 groups"):
        TextureLikelihood(Bench(), learn_groups=0)


def _blank(number: int, grey: float, *, valid: bool = True) -> FrameGroup:
    images = np.random.default_rng(number).normal(grey, 3, (3, 448, 1280)).clip(0, 255).astype(np.uint8)
    return FrameGroup(
        number=number,
        images=images,
        arc_start_m=number * 470e-6 + 0.8e-6 * np.arange(3),
        stage_m=np.zeros(3),
        pixel_pitch_m=0.390625e-6,
        white_level=255,
        valid=np.full(3, valid),
        problems=("a cable hung loose",),
    )


@pytest.fixture
def cartridge() -> TextureLikelihood:
    return TextureLikelihood(replace(filming_bench(height_px=448), sequence=Sequence(groups=3, frames_per_group=3)))


def test_a_passage_too_short_to_learn_from_is_lost_and_says_why(cartridge: TextureLikelihood) -> None:
    pickup = cartridge.learn(lambda n: _blank(n, 90), 3, map)
    assert not pickup.taught
    trace = pickup.read(_blank(1, 90))
    assert np.isnan(trace.offset_m).all()
    assert (trace.flags & Quality.NO_STRIPE).all()
    assert (trace.flags & Quality.INTERPOLATED).all()
    assert trace.problems[0] == "a cable hung loose"
    assert "group 1 is not read: too little of the stripes is seen to learn their texture" in trace.problems[1]
    assert pickup.sketch(_blank(1, 90)) is None
    assert pickup.calibration["groups"] == 3
    assert trace.arc_start_m == pytest.approx(470e-6 + 3.5 * 0.390625e-6)


def test_a_wall_that_went_astray_goes_along_with_the_other_and_is_not_read(cartridge: TextureLikelihood) -> None:
    pickup = TexturePickup(cartridge, StripeLayout.of_bench(cartridge.bench, edge_margin_px=-16.0))
    film = PROCESSOR.film(_blank(0, 90))
    cells = 160
    path, support = np.zeros((2, cells)), np.ones((pickup.layout.wall.size, cells))
    path[OUTER, 60:90], support[pickup.layout.wall == OUTER] = 14.0, 0.7
    stretch, _ = pickup.stretch(film, sight_of(film), (path, support))
    begun, astray = stretch.first_column, slice(60 * 8, 90 * 8)
    there = slice(astray.start - begun, astray.stop - begun)
    read = stretch.support[:, there].max(axis=1) > 0
    np.testing.assert_array_equal(read, pickup.layout.wall == INNER)
    assert np.abs(stretch.displacement_px[:, there]).max() < 1.0
    assert stretch.support[:, : there.start - 60].min() > 0.6


def test_where_no_wall_is_sure_neither_is_read(cartridge: TextureLikelihood) -> None:
    pickup = TexturePickup(cartridge, StripeLayout.of_bench(cartridge.bench, edge_margin_px=-16.0))
    film = PROCESSOR.film(_blank(0, 90))
    outer, (cells, sure) = pickup.layout.wall == OUTER, (160, 1.2 * cartridge.rules.least_best_support)
    path, support = np.zeros((2, cells)), np.full((outer.size, cells), sure)
    # both walls are faint for a while, and then one of them
    support[:, 40:70] = support[outer, 100:130] = 0.8 * cartridge.rules.least_best_support
    stretch, _ = pickup.stretch(film, sight_of(film), (path, support))
    both, one = (
        slice(first * 8 - stretch.first_column, last * 8 - stretch.first_column)
        for first, last in ((52, 58), (112, 118))
    )
    assert support.min() > cartridge.rules.least_support
    assert stretch.support[:, both].max() == 0
    assert stretch.support[:, one].min() > cartridge.rules.least_support


@pytest.mark.parametrize(("grey", "valid", "flag"), [(0.0, True, Quality.DARK), (90.0, False, Quality.FRAME_LOST)])
def test_a_passage_without_a_usable_frame_is_learned_and_read_without_an_exception(
    cartridge: TextureLikelihood, grey: float, valid: bool, flag: Quality
) -> None:
    pickup = cartridge.learn(lambda n: _blank(n, grey, valid=valid), 3, map)
    trace = pickup.read(_blank(1, grey, valid=valid))
    assert (trace.flags & flag).all()
    assert np.isnan(trace.offset_m).all()
    assert trace.problems[0] == "a cable hung loose"
    assert "too little" not in " ".join(trace.problems)
    assert pickup.sketch(_blank(1, grey, valid=valid)) is None


def test_what_has_been_learned_is_told_to_the_end(cartridge: TextureLikelihood) -> None:
    told: list[tuple[int, int]] = []
    cartridge.learn(lambda n: _blank(n, 90), 3, map, lambda done, total: told.append((done, total)))
    done, totals = zip(*told, strict=True)
    assert list(done) == sorted(done)
    assert len(set(totals)) == 1
    assert done[-1] == totals[0]
