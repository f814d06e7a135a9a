"""The coarse search on painted pictures: every path must be found within the reach of the exact reading, three rows."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.camera.film_line import film_line
from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import ArgumentError
from gramoscope.pickup.texture.groove_search import GrooveSearch, best_path
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.sharpness import CELL_PX, cell_energy, ridges, sharpness, sharpness_of, whole_pixels
from gramoscope.simulation.scene import filming_bench

CELLS, HEIGHT = 160, 640
BENCH = filming_bench(height_px=HEIGHT)
LAYOUT = StripeLayout.of_bench(BENCH, edge_margin_px=-16.0)
EXACT_REACH_PX = 3.0


def _wave(amplitude_px: float, cells_a_period: float, phase: float = 0.4) -> FloatArray:
    return amplitude_px * np.sin(2 * np.pi * np.arange(CELLS) / cells_a_period + phase)


def _painted(
    displacement: FloatArray, seed: int = 3, hidden: tuple[int, slice] | None = None, stripes: StripeLayout = LAYOUT
) -> FloatArray:
    """Ridges where stripes can be seen, of the strength that texture happens to have, on a floor of noise."""
    rng = np.random.default_rng(seed)
    row = np.arange(HEIGHT)
    sharp = 0.15 * rng.exponential(size=(CELLS, HEIGHT))
    rows = stripes.rows(displacement)
    seen = stripes.visible(rows, half_px=0)
    for number, wall in enumerate(stripes.wall):
        strength = rng.uniform(0.5, 1.4, CELLS) * seen[number]
        if hidden is not None and hidden[0] == wall:
            strength[hidden[1]] = 0
        sharp += strength[:, None] * np.exp(-((row - rows[number][:, None]) ** 2) / (2 * 2.5**2))
    return np.minimum(sharp, 1.5)


def _found(sharp: FloatArray, cut: Cut) -> tuple[FloatArray, FloatArray]:
    """Where the walls were found, and how sharp each of them was."""
    found, support = GrooveSearch().find(sharp, LAYOUT, cut=cut)
    assert support.shape == (LAYOUT.wall.size, CELLS)
    return found, np.array([support[LAYOUT.wall == wall].max(axis=0) for wall in (INNER, OUTER)])


def _both(lateral: FloatArray, vertical: FloatArray | float = 0.0) -> FloatArray:
    return np.array([lateral - vertical, lateral + vertical])


@pytest.mark.parametrize("seed", range(4))
def test_the_best_path_is_that_of_trying_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    score = 2 * rng.normal(size=(5, 3, 2))
    steps, costs = np.array([2, 1]), np.array([0.3, 0.8])
    places = list(product(range(3), range(2)))

    def total(path: tuple[tuple[int, int], ...]) -> float:
        value = sum(score[k][place] for k, place in enumerate(path))
        for (i, j), (m, n) in pairwise(path):
            if abs(m - i) > steps[0] or abs(n - j) > steps[1]:
                return -np.inf
            value -= costs[0] * (m - i) ** 2 + costs[1] * (n - j) ** 2
        return float(value)

    best = max(product(places, repeat=5), key=total)
    path, value = best_path(score.copy(), steps, costs)
    assert value == pytest.approx(total(best))
    np.testing.assert_array_equal(path.T, best)


def test_a_path_takes_no_forbidden_step() -> None:
    score = np.full((2, 6, 1), -1.0)
    score[0, 0], score[1, 5] = 10, 10
    path, value = best_path(score, np.array([2, 0]), np.array([0.0, 0.0]))
    assert abs(path[0, 1] - path[0, 0]) <= 2
    assert value == 9.0


def test_a_step_costs_as_its_square() -> None:
    score = np.full((2, 3, 1), -10.0)
    score[0, 0], score[1, 0], score[1, 2] = 0.0, 0.0, 1.0
    steps = np.array([2, 0])
    assert best_path(score.copy(), steps, np.array([0.24, 0.0]))[1] == pytest.approx(1 - 4 * 0.24)
    assert best_path(score.copy(), steps, np.array([0.26, 0.0]))[1] == 0.0


QUIET = _wave(9, 41) + _wave(4, 17)
LOUD = {f"loud {phase}": _wave(190, 430, phase) for phase in (0.0, 0.9, 2.1, 3.4, 5.2)}
"""Swings of ± 74 µm at a third of a row a column: stripes cross the glass edge, and the fourth one comes in."""
LATERAL = {"quiet": QUIET, "aside": QUIET + 55, "other side": QUIET - 70, **LOUD}


@pytest.mark.parametrize("lateral", LATERAL.values(), ids=list(LATERAL))
def test_a_lateral_groove_is_found(lateral: FloatArray) -> None:
    found, support = _found(_painted(_both(lateral)), "lateral")
    error = np.abs(found - _both(lateral))
    seen = support > 0.5
    assert seen.mean() > 0.3
    assert np.quantile(error[seen], 0.99) < EXACT_REACH_PX
    assert np.median(error) < 1.5


def test_where_one_wall_is_missing_it_goes_along_with_the_other() -> None:
    hole = slice(60, 100)
    found, support = _found(_painted(_both(QUIET), hidden=(INNER, hole)), "lateral")
    assert np.abs(found[OUTER] - QUIET).max() < EXACT_REACH_PX
    assert np.abs(found[INNER] - QUIET)[hole].max() < EXACT_REACH_PX + GrooveSearch().wall_reach_px
    assert np.median(support[INNER, hole]) < 0.5 * np.median(support[INNER, :60])


def test_a_scratch_leads_nobody_astray() -> None:
    sharp = _painted(_both(QUIET))
    cells = np.arange(CELLS)
    for width in range(-4, 5):
        sharp[cells, np.clip(60 + 3 * cells + width, 0, HEIGHT - 1)] = 1.5
    found, _ = _found(sharp, "lateral")
    assert np.quantile(np.abs(found - QUIET), 0.95) < EXACT_REACH_PX


@pytest.mark.parametrize("left", [0.2, 0.5])
def test_what_a_chip_has_left_of_the_stripes_is_found(left: float) -> None:
    rng = np.random.default_rng(2)
    camera_noise = rng.chisquare(8, (CELLS, HEIGHT)) / 8
    chipped = np.arange(CELLS) >= left * CELLS
    stripes = _painted(_both(QUIET))
    # a little out of focus, on either side of a stripe, its wall is fainter, and still far above the noise
    energy = 180**2 * (stripes + 0.5 * ndimage.gaussian_filter1d(stripes, 12, axis=1)) ** 2
    energy = np.where(chipped[:, None], 0, energy) + 30 * camera_noise
    sharp = sharpness_of(energy.astype(np.float32)).relative
    found, support = _found(sharp, "lateral")
    error = np.abs(found - QUIET)[:, ~chipped]
    assert np.quantile(error, 0.95) < EXACT_REACH_PX
    assert np.median(support[:, ~chipped]) > 5 * np.median(support[:, chipped])


def test_a_vertical_groove_moves_its_walls_against_each_other() -> None:
    vertical = _wave(25, 91) + _wave(4, 15)
    found, _ = _found(_painted(_both(_wave(5, 300), vertical)), "vertical")
    error = np.abs(found - _both(_wave(5, 300), vertical))
    assert np.quantile(error, 0.95) < EXACT_REACH_PX


def test_the_motion_of_a_single_stripe_is_taken_for_one_in_the_direction_of_the_cut() -> None:
    vertical = 54 + _wave(4, 91)
    displacement = _both(np.zeros(CELLS), vertical)
    # both deep stripes are gone, and the inner wall's shallow one is all that is left
    sharp = _painted(displacement, hidden=(OUTER, slice(None)), stripes=replace(LAYOUT, first_row=_only(3)))
    found, _ = _found(sharp, "vertical")
    error = np.abs(found - displacement)
    assert np.quantile(error[INNER], 0.95) < EXACT_REACH_PX
    assert np.quantile(error[OUTER], 0.95) < EXACT_REACH_PX


def test_where_both_deep_stripes_meet_at_the_bottom_neither_is_taken_for_the_other() -> None:
    outer = _wave(3, 90)
    inner = outer - 67 + 26 * (np.arange(CELLS) / CELLS - 0.6) ** 2 / 0.36
    displacement = np.array([inner, outer])
    one, other = LAYOUT.rows(displacement)[1:3]
    deep = LAYOUT.from_bottom_px[1:3].mean() - (outer - inner) / 2
    assert deep.min() < 12 < 16 < deep.max()
    # each as sharp as ever while they are two, and all between them is sharp where they have met
    sharp = _painted(displacement, stripes=replace(LAYOUT, first_row=np.array([HEIGHT, 0, 0, HEIGHT])))
    away = np.abs(np.arange(HEIGHT) - (one + other)[:, None] / 2)
    band = np.random.default_rng(4).uniform(0.4, 1.4, (CELLS, 1)) * np.exp(-0.5 * (away / deep[:, None]) ** 2)
    sharp[deep < 16] = np.maximum(0.05, band)[deep < 16]
    found, _ = _found(sharp, "stereo")
    error = np.abs(found - displacement)
    assert np.quantile(error[:, deep > 20], 0.95) < EXACT_REACH_PX
    assert error[:, deep <= 16].max() < 3 * EXACT_REACH_PX


def _only(number: int) -> FloatArray:
    """First rows of a layout in which no other stripe can be seen."""
    return np.where(np.arange(LAYOUT.wall.size) == number, LAYOUT.first_row, HEIGHT)


def test_a_stereo_groove_has_two_walls_of_their_own() -> None:
    lateral, vertical = _wave(14, 43), _wave(11, 29, 1.3)
    found, _ = _found(_painted(_both(lateral, vertical)), "stereo")
    assert np.quantile(np.abs(found - _both(lateral, vertical)), 0.95) < EXACT_REACH_PX


def test_a_stripe_out_of_sight_has_no_support_and_one_in_sight_has() -> None:
    _, support = GrooveSearch().find(_painted(_both(QUIET)), LAYOUT, cut="lateral")
    assert (support[0] == 0).all(), "the outer stripe beside the glass lies under it"
    assert (np.median(support[1:], axis=1) > 0.4).all()


def test_nothing_but_noise_has_hardly_any_support() -> None:
    nothing = 0.15 * np.random.default_rng(5).exponential(size=(CELLS, HEIGHT))
    _, support = _found(nothing, "lateral")
    _, groove = _found(_painted(_both(QUIET)), "lateral")
    assert np.median(support) < 0.4 * np.median(groove)


def test_a_usual_swing_of_nothing_is_refused() -> None:
    with pytest.raises(ArgumentError, match="usual swing"):
        GrooveSearch(usual_swing_px=0.0)


def _texture(row: float, *, gain: float = 1.0, offset: float = 100.0) -> np.ndarray:
    """One frame: camera noise everywhere, texture about one row, shading across."""
    rng = np.random.default_rng(2)
    away = np.arange(200) - row
    columns = rng.normal(size=(640, 200)) * (1 + 3 * np.exp(-(away**2) / (2 * 3.0**2))) + 0.4 * np.arange(200)
    return np.rint(20 * gain * (columns + offset)).astype(np.uint16).T[np.newaxis].copy()


STILL = np.zeros(1)


def test_the_picture_is_sharp_where_its_texture_is_and_shading_is_none() -> None:
    sharp = sharpness(_texture(83.0), STILL).relative
    assert sharp.shape == (640 // CELL_PX, 200)
    mean = sharp.mean(axis=0)
    assert abs(int(np.argmax(mean)) - 83) <= 2
    assert mean[:60].max() < 0.2
    assert mean[110:].max() < 0.2
    assert np.median(sharp.max(axis=1)) == pytest.approx(1, abs=0.05)


def test_sharpness_does_not_depend_on_brightness_and_contrast() -> None:
    one, other = sharpness(_texture(83.0, gain=7.0, offset=300.0), STILL), sharpness(_texture(83.0), STILL)
    np.testing.assert_allclose(one.relative, other.relative, atol=3e-2)
    assert one.typical == pytest.approx(7 * other.typical, rel=0.02)


@pytest.mark.parametrize(("usual", "share"), [(0.0, 1), (1.0, 1), (4.0, 1), (8.0, 0.5), (400.0, 0.01)])
def test_a_picture_that_is_faint_among_others_is_less_sharp(usual: float, share: float) -> None:
    found = sharpness(_texture(83.0), STILL)
    np.testing.assert_allclose(found.among(usual * found.typical), share * found.relative, rtol=1e-6)


def test_a_picture_without_texture_is_nowhere_sharp() -> None:
    assert (sharpness(np.full((3, 50, 64), 90, np.uint8), np.array([0.0, 2.0, 4.0])).relative == 0).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("height", [4, 21])
@pytest.mark.parametrize(
    ("width", "begin"), [(70, [0, 3, 7]), (70, [0, 3, 60]), (9, [0, 1, 2]), (300, [0, 8, 8, 31]), (300, [5, 0])]
)
def test_the_energy_of_a_cell_is_that_of_the_frames_laid_over_each_other(
    dtype: type, height: int, width: int, begin: list[int]
) -> None:
    rng = np.random.default_rng(7)
    images = rng.integers(0, 250, (len(begin), height, width)).astype(dtype)
    whole = width + max(begin)
    cells = whole // CELL_PX
    total, count = np.zeros((height, whole)), np.zeros(whole)
    for image, first in zip(images, begin, strict=True):
        total[:, first : first + width] += image
        count[first : first + width] += 1
    mean = total / count
    slope = mean[:, 4:-2] - mean[:, 2:-4] + 0.5 * (mean[:, 5:-1] - mean[:, 1:-5])
    square = np.pad(slope**2, ((0, 0), (3, 3)))
    expected = square[:, : cells * CELL_PX].reshape(height, cells, CELL_PX).sum(axis=2).T
    energy = np.empty((cells, height), np.float32)
    cell_energy(*film_line(images), width, np.arange(len(begin)), np.array(begin), whole, energy)
    np.testing.assert_allclose(energy, expected, rtol=1e-4)


def test_uneven_shifts_count_to_whole_pixels() -> None:
    images, shift = np.random.default_rng(7).integers(0, 250, (3, 4, 70)).astype(np.uint8), np.array([0.0, 3.4, 7.7])
    # the last frame ends where the picture does
    assert sharpness(images, shift).relative.shape == (9, 4)


@pytest.mark.parametrize(("frames", "seen"), [(1, [0]), (4, [0, 1, 2, 3]), (12, [0, 4, 7, 11])])
def test_some_frames_show_where_it_is_sharp_from_the_first_to_the_last(frames: int, seen: list[int]) -> None:
    shift = 2.4 * np.arange(frames)
    some, offset, share = whole_pixels(50, shift)
    assert some.tolist() == seen
    assert offset.tolist() == np.minimum(np.rint(shift), share.size - 50)[seen].tolist()
    count = sum((np.arange(share.size) >= first) & (np.arange(share.size) < first + 50) for first in offset)
    np.testing.assert_allclose(share, 1 / count, rtol=1e-6)


def test_a_ridge_stands_over_its_flanks_and_a_plain_is_none() -> None:
    plain = np.tile(np.linspace(3, 4, 90), (5, 1))
    np.testing.assert_allclose(ridges(plain)[:, 20:-20], 0, atol=1e-6)
    plain[:, 41:48] += 2.0
    assert (np.argmax(ridges(plain), axis=1) == 44).all()
    assert ridges(plain)[2, 44] == pytest.approx(2.0)
