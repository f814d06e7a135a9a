"""The blur by discs of changing size against brute force, conservation and optics."""

import numpy as np
import pytest

from gramoscope.simulation.blur_grids import COARSE, LARGEST_PX, PARTS, PER_ROW, SMALL, TO_LARGE_PX, TO_MIDDLE_PX, grid
from gramoscope.simulation.disc_blur import blur, scatter

TANGENT = 0.8554  # tan(asin 0.65)
FLOOR_PX = 0.9


def _row_of_source(source: float) -> float:
    return (source + 0.5) / PER_ROW - 0.5


def _brute_force(light: np.ndarray, radius_px: np.ndarray, slope_tan: np.ndarray, *, floor_px: float) -> np.ndarray:
    """Spread both parts of every source over discs drawn with 16 × 16 points a pixel: obvious and slow."""
    rows, columns = light.shape[0] // PER_ROW, light.shape[1]
    points = 16
    y, x = ((np.arange(n * points) + 0.5) / points - 0.5 for n in (rows, columns))
    fine = np.zeros((rows * points, columns * points))
    for source, column in np.ndindex(*light.shape):
        for aside in ((np.arange(PARTS) + 0.5) / PARTS - 0.5) / PER_ROW:
            square = (radius_px[source, column] + slope_tan[source, column] * aside) ** 2 + floor_px**2
            away = y[:, None] - _row_of_source(source) - aside
            inside = away**2 + (x[None, :] - column) ** 2 <= square
            whole = radius_px[source, column] ** 2 + floor_px**2
            ramp = 1 + slope_tan[source, column] * radius_px[source, column] / whole * away
            fine += light[source, column] * inside * ramp / (np.pi * square * PARTS * PER_ROW)
    return fine.reshape(rows, points, columns, points).mean(axis=(1, 3))


def _spot(radius_px: float, *, source: int, column: int, tilt: float = 0.0) -> np.ndarray:
    """Blur one point of light of unit energy."""
    light = np.zeros((144 * PER_ROW, 152), np.float32)
    light[source, column] = PER_ROW
    radius = np.full_like(light, radius_px)
    return scatter(light, radius, np.full_like(light, tilt), floor_px=FLOOR_PX, margin_px=0)[0]


def _along_wall(slope: float, offset_px: float, *, rows: int = 200, columns: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Radii and slopes of a plane that is sharp at the middle of the picture."""
    place = _row_of_source(np.arange(PER_ROW * (rows + 2 * LARGEST_PX)))
    depth = slope * (place - LARGEST_PX - rows / 2 + offset_px)
    radius = np.repeat((depth * TANGENT)[:, None], columns + 2 * LARGEST_PX, axis=1).astype(np.float32)
    return radius, np.full_like(radius, slope * TANGENT)


def test_random_light_on_a_tilted_wall_agrees_with_brute_force() -> None:
    rng = np.random.default_rng(8)
    light = rng.random((40, 24)).astype(np.float32)
    radius = np.repeat(np.linspace(-2.9, 5.1, 40)[:, None], 24, axis=1).astype(np.float32)
    slope = np.full_like(radius, 0.42)
    expected = _brute_force(light, radius, slope, floor_px=FLOOR_PX)
    found = scatter(light, radius, slope, floor_px=FLOOR_PX, margin_px=0)[0]
    # doing nothing would leave an error of 0.2 rms
    assert np.sqrt(np.mean((light.reshape(20, PER_ROW, 24).mean(axis=1) - expected) ** 2)) > 0.15
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.003


@pytest.mark.parametrize("radius_px", [0.0, -1.7, 4.3, 9.5, -12.0, 13.0, 30.0, 49.5, 58.5])
def test_no_energy_is_lost(radius_px: float) -> None:
    for tilt in (0.0, 0.6):
        assert _spot(radius_px, source=141, column=81, tilt=tilt).sum() == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("radius_px", [1.1, 4.2, *TO_MIDDLE_PX, np.mean(TO_MIDDLE_PX), 22.0, *TO_LARGE_PX, 49.7])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_spread_has_the_second_moment_of_a_disc_on_every_grid(radius_px: float, axis: int) -> None:
    first, second = [], []
    for place in range(PER_ROW * COARSE):  # wherever the point lies in its block of the largest grid
        source, column = 68 * PER_ROW + place, 76 + place // PER_ROW
        profile = _spot(radius_px, source=source, column=column).sum(axis=1 - axis)
        away = np.arange(len(profile)) - (_row_of_source(source) if axis == 0 else column)
        first.append((profile * away).sum())
        second.append((profile * away**2).sum())
    assert np.mean(first) == pytest.approx(0, abs=1e-3)
    # columns lie everywhere alike, so that what the edge of a box does in its last pixel is not averaged;
    # of a uniform disc R²/4 along one axis, and of the pixel that catches the light 1/12
    variance = (radius_px**2 + FLOOR_PX**2) / 4 + 1 / 12
    assert np.mean(second) == pytest.approx(variance, rel=(0.005, 0.03)[axis])


@pytest.mark.parametrize("slope", [0.4, 1.0, -1.0])
@pytest.mark.parametrize("offset_px", [0.0, 0.37])
def test_a_wall_of_even_brightness_looks_even_however_tilted(slope: float, offset_px: float) -> None:
    radius, tilt = _along_wall(slope, offset_px)
    light = np.full_like(radius, 0.7)
    np.testing.assert_allclose(blur(light, radius, tilt, floor_px=FLOOR_PX, margin_px=LARGEST_PX), 0.7, rtol=1e-5)


@pytest.mark.parametrize("slope", [0.4, 1.0, -1.0])
def test_the_ramp_keeps_scattered_light_even_along_a_tilted_wall(slope: float) -> None:
    radius, tilt = _along_wall(slope, 0.37)

    def raw(slope_tan: np.ndarray) -> float:
        even = scatter(np.ones_like(radius), radius, slope_tan, floor_px=FLOOR_PX, margin_px=LARGEST_PX)[1]
        return float(even[80:-80].mean())

    assert raw(tilt) == pytest.approx(1, abs=0.012)
    if abs(slope) == 1:
        assert raw(np.zeros_like(tilt)) > 1.1  # without the ramp the crowding shows


def test_a_wall_is_sharp_only_where_it_is_in_focus() -> None:
    radius, tilt = _along_wall(1.0, 0.0)
    light = np.random.default_rng(5).random(radius.shape).astype(np.float32)
    picture = blur(light, radius, tilt, floor_px=FLOOR_PX, margin_px=LARGEST_PX)
    contrast = picture.std(axis=1)
    assert 98 <= np.argmax(contrast) <= 102
    assert contrast[100] > 5 * contrast[130]


def test_blurring_is_linear_in_light() -> None:
    rng = np.random.default_rng(2)
    radius, tilt = _along_wall(0.9, 0.2, rows=40, columns=32)
    one, other = rng.random((2, *radius.shape)).astype(np.float32)
    both, first, second = (
        blur(light, radius, tilt, floor_px=FLOOR_PX, margin_px=LARGEST_PX) for light in (one + 2 * other, one, other)
    )
    np.testing.assert_allclose(both, first + 2 * second, rtol=2e-5)


def test_tabulated_discs_have_unit_area() -> None:
    discs = grid(1, 1, per_row=4, largest_px=9.0, bins_per_px=16)
    energy = (discs.half * 2 * discs.density).astype(float)
    # four parts a row: distances 1/8, 3/8 … on one side and −1/8, −3/8 … on the other, four of them apart in one disc
    for part in range(4):
        away = np.abs(np.arange(part, 80, 4) - 39.5)
        np.testing.assert_allclose(energy[away.astype(int)].sum(axis=0), 1, rtol=1e-5)
    assert SMALL.per_row == PARTS * PER_ROW
    assert LARGEST_PX % COARSE == 0
