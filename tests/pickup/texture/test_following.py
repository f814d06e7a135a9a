"""Windows that follow a path: what they show, and how it changes when the path is moved."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from gramoscope.conventions import FloatArray
from gramoscope.pickup.texture.following import (
    BLOCK,
    GENTLE,
    REACH,
    SHARP,
    STEPS,
    TAPS,
    across,
    channels,
    follow,
    interpolation_taps,
    shifted,
    step_mixtures,
    step_of,
    stepped,
    wide_rows,
)

HALF_PX = 9
WAVES = np.random.default_rng(4).uniform((0.03, 0.01, -3), (0.22, 0.2, 3), (12, 3))
"""Cycles a row, cycles a column, phase."""


def _value(column: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A smooth picture anywhere, and its derivative with the row."""
    angle = 2 * np.pi * (WAVES[:, 0] * row[..., None] + WAVES[:, 1] * column[..., None]) + WAVES[:, 2]
    return np.cos(angle).sum(axis=-1), (-2 * np.pi * WAVES[:, 0] * np.sin(angle)).sum(axis=-1)


def _seen(picture: np.ndarray, path: np.ndarray, half_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Window and derivative, rows first."""
    wide = follow(picture, path, half_px).T
    return wide[REACH:-REACH], _derivative(wide, GENTLE)


def _derivative(rows: np.ndarray, slope: FloatArray) -> np.ndarray:
    """Of all rows but the outermost eight, shape (row, column)."""
    more = REACH - slope.size
    return np.asarray(across(len(rows) - 2 * REACH, slope) @ rows[more : len(rows) - more])


@pytest.fixture
def picture() -> np.ndarray:
    column, row = np.mgrid[:150, :130]
    return _value(column, row)[0].astype(np.float32)


@pytest.fixture
def path() -> np.ndarray:
    """A slope of a third of a row a column, and a wobble."""
    column = np.arange(150)
    return 37.3 + 0.33 * column + 2.6 * np.sin(0.11 * column + 0.4)


def _places(path: np.ndarray, half_px: int = HALF_PX) -> tuple[np.ndarray, np.ndarray]:
    row = path + np.arange(-half_px, half_px + 1)[:, None]
    return np.broadcast_to(np.arange(path.size), row.shape), row


def test_a_window_shows_the_picture_along_a_sloping_path_and_how_it_changes(
    picture: np.ndarray, path: np.ndarray
) -> None:
    window, derivative = _seen(picture, path, HALF_PX)
    value, slope = _value(*_places(path))
    assert window.shape == derivative.shape == (2 * HALF_PX + 1, 150)
    # places are known to a thousandth of a row, values to a hundredth
    np.testing.assert_allclose(window, value, atol=0.02 * np.std(slope))
    np.testing.assert_allclose(derivative, slope, atol=0.06 * np.std(slope))


def test_between_rows_it_agrees_with_a_spline(picture: np.ndarray, path: np.ndarray) -> None:
    window, _ = _seen(picture, path, HALF_PX)
    spline = map_coordinates(picture.astype(np.float64), _places(path), order=5)
    assert np.std(window - spline) < 0.005 * np.std(spline)


def test_the_derivative_is_what_happens_when_the_path_is_moved(picture: np.ndarray, path: np.ndarray) -> None:
    _, derivative = _seen(picture, path, HALF_PX)
    step = 1 / 8
    higher, lower = (_seen(picture, path + side * step, HALF_PX)[0] for side in (1, -1))
    moved = (higher - lower) / (2 * step)
    assert np.std(moved - derivative) < 0.025 * np.std(derivative)


def test_a_window_on_whole_rows_is_the_picture_itself(picture: np.ndarray) -> None:
    path = np.round(np.linspace(40, 71, 150))
    window, _ = _seen(picture, path, HALF_PX)
    column, row = _places(path)
    np.testing.assert_allclose(window, picture[column, row.astype(int)], atol=1e-5)


@pytest.mark.parametrize("row", [-60.3, -3.7, 2.2, 127.6, 188.0])
def test_beyond_the_picture_its_outermost_row_is_repeated(picture: np.ndarray, row: float) -> None:
    window, _ = _seen(picture, np.full(150, row), HALF_PX)
    beyond = np.pad(picture, ((0, 0), (100, 100)), mode="edge")
    inside, _ = _seen(beyond, np.full(150, row + 100), HALF_PX)
    np.testing.assert_allclose(window, inside, atol=1e-5)


def test_the_picture_stays_as_it_was(picture: np.ndarray, path: np.ndarray) -> None:
    before = picture.copy()
    picture.flags.writeable = path.flags.writeable = False
    follow(picture, path, HALF_PX)
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize("half_px", [1, 4, 9, 12])
@pytest.mark.parametrize("width", [1, BLOCK - 1, BLOCK, BLOCK + 22])
def test_a_window_of_any_size_has_eight_rows_more_on_each_side(
    picture: np.ndarray, path: np.ndarray, half_px: int, width: int
) -> None:
    found = follow(picture[:width], path[:width], half_px)
    assert found.shape == (width, wide_rows(half_px)) == (width, 2 * half_px + 17)
    assert found.dtype == np.float32
    more = follow(picture, path, half_px + 3)
    np.testing.assert_allclose(found, more[:width, 3:-3], atol=1e-6)


@pytest.mark.parametrize("half_px", [4, HALF_PX])
@pytest.mark.parametrize("width", [BLOCK, BLOCK + 22])
def test_channels_are_weighted_sums_of_the_rows(
    picture: np.ndarray, path: np.ndarray, half_px: int, width: int
) -> None:
    basis = np.random.default_rng(3).normal(size=(wide_rows(half_px), 5)).astype(np.float32)
    found = channels(picture[:width], path[:width], half_px, basis)
    direct = follow(picture[:width], path[:width], half_px).astype(np.float64) @ basis
    assert found.shape == (width, 5)
    np.testing.assert_allclose(found, direct, atol=1e-5 * np.abs(direct).max())


def test_a_path_in_steps_is_the_nearest_and_what_is_left_is_told(path: np.ndarray) -> None:
    rows, aside = np.stack([path, path - 50]), np.empty((2, path.size))
    before = rows.copy()
    stepped(rows, aside)
    np.testing.assert_array_equal(rows * STEPS, np.round(rows * STEPS))
    np.testing.assert_allclose(rows + aside, before, atol=1e-12)
    assert 0.4 / STEPS < np.abs(aside).max() <= 0.5 / STEPS


def test_channels_are_mixed_of_the_picture_as_of_a_window(picture: np.ndarray, path: np.ndarray) -> None:
    basis = np.random.default_rng(3).normal(size=(wide_rows(HALF_PX), 5)).astype(np.float32)
    rows = path.copy()
    stepped(rows, np.empty_like(rows))
    mixtures = step_mixtures(basis)
    assert mixtures.shape == (STEPS, wide_rows(HALF_PX) + TAPS - 1, 5)
    places = [step_of(row, HALF_PX + REACH) for row in rows]
    inside = [x for x, (first, _) in enumerate(places) if 0 <= first <= picture.shape[1] - mixtures.shape[1]]
    assert len(inside) > 100
    found = [picture[x, places[x][0] :][: mixtures.shape[1]].astype(float) @ mixtures[places[x][1]] for x in inside]
    direct = follow(picture, rows, HALF_PX).astype(np.float64) @ basis
    np.testing.assert_allclose(found, direct[inside], atol=1e-5 * np.abs(direct).max())


@pytest.mark.parametrize("px", [-383 / 512, -0.25, 0.0, 0.3125, 511 / 512])
def test_a_window_is_shifted_as_if_the_path_had_been(picture: np.ndarray, px: float) -> None:
    # on whole rows, for what lies between rows is interpolated once only
    path = np.round(np.linspace(40, 71, 150))
    wide = follow(picture, path, HALF_PX)
    rows = wide.shape[1] - 10
    moved = follow(picture, path + px, HALF_PX)[:, 5:-5]
    assert shifted(rows, px).shape == (rows, rows + 10)
    np.testing.assert_allclose(wide @ shifted(rows, px).T, moved, atol=1e-5)


@pytest.mark.parametrize("degree", range(7))
def test_across_is_exact_for_polynomials_up_to_the_sixth_degree(degree: int) -> None:
    row = np.linspace(-1.2, 0.9, 24)
    derivative = _derivative(np.stack([row**degree, -3 * row**degree], axis=1), GENTLE)
    exact = degree * row[REACH:-REACH] ** max(degree - 1, 0) * (row[1] - row[0])
    np.testing.assert_allclose(derivative, np.stack([exact, -3 * exact], axis=1), atol=1e-12)


def test_across_is_not_exact_for_the_seventh() -> None:
    row = np.arange(24.0) - 11
    derivative = _derivative((row**7)[:, None], GENTLE)[:, 0]
    assert np.abs(derivative - 7 * row[REACH:-REACH] ** 6).max() > 1


@pytest.mark.parametrize("slope", [GENTLE, SHARP])
def test_across_is_exact_for_a_straight_line(slope: np.ndarray) -> None:
    line = np.outer(np.arange(6.0 + 2 * slope.size), [0.0, 1.0, -2.5]) + 4
    np.testing.assert_allclose(across(6, slope) @ line, np.tile([0.0, 1.0, -2.5], (6, 1)), atol=1e-12)


def _share_kept(slope: np.ndarray, frequency: float) -> np.ndarray:
    """Of the derivative of cos(2πkr), where it is not near zero."""
    row = np.arange(200.0)
    turn = 2 * np.pi * frequency
    true = -turn * np.sin(turn * row[REACH:-REACH])
    found = _derivative(np.cos(turn * row)[:, None], slope)[:, 0]
    return np.asarray((found / true)[np.abs(true) > 0.5 * turn])


@pytest.mark.parametrize("frequency", [0.1, 0.2, 0.3, 0.4])
def test_a_sharp_slope_is_exact_to_a_few_hundredths(frequency: float) -> None:
    np.testing.assert_allclose(_share_kept(SHARP, frequency), 1, atol=0.06)


@pytest.mark.parametrize("frequency", [0.05, 0.1, 0.2, 0.3, 0.35, 0.4])
def test_a_sharp_slope_holds_where_a_gentle_one_fades(frequency: float) -> None:
    np.testing.assert_allclose(_share_kept(SHARP, frequency), 1, atol=0.15)
    gentle = _share_kept(GENTLE, frequency)
    if frequency <= 0.2:
        np.testing.assert_allclose(gentle, 1, atol=0.025)
    if frequency >= 0.35:
        assert (gentle < 0.7).all()
        assert (_share_kept(SHARP, frequency) > 0.85).all()


@pytest.mark.parametrize(("frequency", "error"), [(0.1, 0.01), (0.2, 0.005), (0.33, 0.012), (0.4, 0.11)])
def test_between_rows_nearly_all_is_kept_that_is_not_too_fine(frequency: float, error: float) -> None:
    fraction = np.linspace(0, 1, 41)
    wave = np.exp(2j * np.pi * frequency * np.arange(-4, 6))
    found = interpolation_taps(fraction) @ wave
    assert np.abs(found - np.exp(2j * np.pi * frequency * fraction)).max() < error


def test_the_weights_of_the_rows_add_up_to_one_and_mirror_each_other() -> None:
    taps = interpolation_taps(np.array([0.0, 0.3, 0.5, 0.7, 1.0]))
    np.testing.assert_allclose(taps.sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(taps[0], np.arange(10) == 4, atol=1e-6)
    np.testing.assert_allclose(taps[-1], np.arange(10) == 5, atol=1e-6)
    np.testing.assert_allclose(taps[1], taps[3, ::-1], atol=1e-6)
