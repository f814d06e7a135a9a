"""Many pixels at a time: the same numbers as NumPy's, wherever in an array they begin, and nothing written beyond."""

import numba
import numpy as np
import pytest

from gramoscope.pickup.film_lanes import (
    COLUMNS,
    PIXELS,
    PRODUCTS,
    SERIES,
    add_lines,
    add_products,
    sum_lines,
    sum_phases,
    write_as_columns,
    write_energies,
    write_in_tone,
)
from gramoscope.pickup.lane_writer import LANES

RNG = np.random.default_rng(8)
WIDTHS = [PIXELS, PIXELS + 1, 3 * PIXELS - 1]


def _normal(*shape: int) -> np.ndarray:
    return RNG.normal(size=shape).astype(np.float32)


@numba.njit
def _sum_lines(film, begins, first, frames, offset, soon, line, place, count):  # type: ignore[no-untyped-def]
    sum_lines(film, begins, first, frames, offset, soon, line, place, count)


@numba.njit
def _sum_phases(lines, step, taps, phases, total, place, count):  # type: ignore[no-untyped-def]
    sum_phases(lines, step, taps, phases, total, place, count)


@numba.njit
def _write_as_columns(total, begin, step, share, first, count, columns, place, height):  # type: ignore[no-untyped-def]
    write_as_columns(total, begin, step, share, first, count, columns, place, height)


@numba.njit
def _write_energies(lines, begin, step, weight, cells, energy, place, height):  # type: ignore[no-untyped-def]
    write_energies(lines, begin, step, weight, cells, energy, place, height)


@numba.njit
def _add_products(film, here, there, count, sums):  # type: ignore[no-untyped-def]
    add_products(film, here, there, count, sums)


@numba.njit
def _write_in_tone(grey, count, curve, series, seen):  # type: ignore[no-untyped-def]
    write_in_tone(grey, count, curve, series, seen)


@numba.njit
def _add_lines(first_line, from_, lines, begins, first, number, step, out, place, count):  # type: ignore[no-untyped-def]
    add_lines(first_line, from_, lines, begins, first, number, step, out, place, count)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("count", WIDTHS)
@pytest.mark.parametrize("frames", [0, 1, 3, 256])
def test_lines_of_film_are_added(dtype: type, count: int, frames: int) -> None:
    # as bright as can be: sums need all their bits
    film = np.where(RNG.uniform(size=1200) < 0.9, np.iinfo(dtype).max, 3).astype(dtype)
    begins = np.r_[-999, RNG.integers(0, 900, frames)]
    line = np.full(count + 9, -1, np.float32)
    # what is called for ahead may lie anywhere
    _sum_lines(film, begins, 1, frames, 100, 10**6, line, 4, count)
    expected = np.sum([film[b + 100 : b + 100 + count].astype(np.int64) for b in begins[1:]], axis=0)
    np.testing.assert_array_equal(line[4 : 4 + count], np.broadcast_to(expected, count).astype(np.float32))
    assert (np.delete(line, slice(4, 4 + count)) == -1).all()


@pytest.mark.parametrize("count", [32, 33, 100])
@pytest.mark.parametrize("phases", [1, 3])
def test_lines_are_interpolated_each_by_taps_of_its_own(count: int, phases: int) -> None:
    lines, taps, step = _normal(phases * 190), _normal(4 * phases), 190
    total = np.zeros(200, np.float32)
    _sum_phases(lines, step, taps, phases, total, 7, count)
    expected = sum(
        np.correlate(line[: count + 3].astype(float), four.astype(float), "valid")
        for line, four in zip(lines.reshape(phases, step), taps.reshape(phases, 4), strict=True)
    )
    np.testing.assert_allclose(total[7 : 7 + count], expected, atol=2e-5)
    assert not total[:7].any()
    assert not total[7 + count + 31 :].any()


@pytest.mark.parametrize("count", [LANES, LANES + 1, 3 * LANES])
def test_rows_become_columns(count: int) -> None:
    total, share = _normal(LANES, 60), _normal(70)
    columns = np.zeros((count, 30), np.float32)
    _write_as_columns(total.ravel(), 5, 60, share, 9, count, columns.reshape(-1), 8, 30)
    np.testing.assert_array_equal(columns[:, 8 : 8 + LANES], (total[:, 5 : 5 + count] * share[9 : 9 + count]).T)
    assert not np.delete(columns, slice(8, 8 + LANES), axis=1).any()


@pytest.mark.parametrize("cells", [2, 5])
def test_energies_are_those_of_slopes(cells: int) -> None:
    count, lines = 8 * cells, _normal(LANES, 90)
    weight, energy = np.r_[0, _normal(count - 1)].astype(np.float32), np.zeros((cells, 20), np.float32)
    _write_energies(lines.ravel(), LANES, 90, weight, cells, energy.reshape(-1), 3, 20)
    seen = {k: lines[:, LANES + k : LANES + k + count].astype(float) for k in (-2, -1, 1, 2)}
    slope = weight * (seen[1] - seen[-1] + 0.5 * (seen[2] - seen[-2]))
    expected = (slope**2).reshape(LANES, cells, 8).sum(axis=2).T
    np.testing.assert_allclose(energy[:, 3 : 3 + LANES], expected, rtol=1e-5)
    assert not np.delete(energy, slice(3, 3 + LANES), axis=1).any()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("count", [COLUMNS, COLUMNS + 1, 5 * COLUMNS - 1])
def test_products_of_rows_are_exact(dtype: type, count: int) -> None:
    film = RNG.choice(np.array([0, 3, np.iinfo(dtype).max], dtype), 500)
    sums = np.arange(PRODUCTS)
    _add_products(film, 5, 200, count, sums)
    one, other = ({k: film[first + k : first + k + count].astype(np.int64) for k in range(-2, 4)} for first in (5, 200))
    slope = one[2] + one[1] - one[-1] - one[-2]
    expected = [np.sum(slope * factor) for factor in (slope, one[0], *other.values())]
    np.testing.assert_array_equal(sums, np.arange(PRODUCTS) + expected)


@pytest.mark.parametrize("count", WIDTHS)
def test_tones_are_logarithms(count: int) -> None:
    y = np.linspace(np.sqrt(0.5), np.sqrt(2), 400) - 1
    series = np.polynomial.Polynomial.fit(y, np.log1p(y) / y, SERIES - 1).convert().coef.astype(np.float32)
    grey = np.where(np.arange(count) % 100 < 30, RNG.uniform(-20, 255, count), 0).astype(np.float32)
    # black wherever nothing was drawn, all of a piece too
    grey[PIXELS // 2 :] *= count > 2 * PIXELS
    seen = np.full(count + 3, -1, np.float32)
    _write_in_tone(grey, count, np.array([0.01, 0.1, 90], np.float32), series, seen)
    expected = 90 * np.log(0.1 + 0.01 * np.maximum(grey.astype(float), 0))
    np.testing.assert_allclose(seen[:count], expected, rtol=1e-5, atol=1e-4)
    assert (seen[count:] == -1).all()


@pytest.mark.parametrize("number", [0, 1, 4])
@pytest.mark.parametrize("count", [7, PIXELS, PIXELS + 1])
def test_lines_are_added_to_a_line(number: int, count: int) -> None:
    costs, lines, begins = _normal(200), _normal(400), np.array([3, 90, 1, 70, 200, 5, 9, 250, 31])
    out = np.zeros(250, np.float32)
    _add_lines(costs, 6, lines, begins, 1, number, 2, out, 8, count)
    expected = costs[6 : 6 + count].copy()
    for first in begins[1 : 1 + 2 * number : 2]:
        expected += lines[first : first + count]
    np.testing.assert_array_equal(out[8 : 8 + count], expected)
    assert not out[:8].any()
    assert not out[8 + count + 63 :].any()
