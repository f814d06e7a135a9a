"""Sixteen numbers at a time: the same sums as NumPy's, wherever in an array they begin."""

import numba
import numpy as np

from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.vector_lanes import AT_ONCE, filter_symmetrically, interpolate, mix, power

RNG = np.random.default_rng(5)


def _normal(*shape: int) -> np.ndarray:
    return RNG.normal(size=shape).astype(np.float32)


@numba.njit
def _interpolate(picture, first, soon, taps, tap, window, place, rows):  # type: ignore[no-untyped-def]
    interpolate(picture, first, soon, taps, tap, window, place, rows)


@numba.njit
def _mix(picture, places, number, rows, mixture, begin, out, targets):  # type: ignore[no-untyped-def]
    mix(picture, places, number, rows, mixture, begin, out, targets)


@numba.njit
def _filter(wide, middle, taps, reach, out, place):  # type: ignore[no-untyped-def]
    filter_symmetrically(wide, middle, taps, reach, out, place)


@numba.njit
def _power(seen, first, form, begin, out, place):  # type: ignore[no-untyped-def]
    power(seen, first, form, begin, out, place)


def _outside(written: np.ndarray, place: int, count: int) -> np.ndarray:
    return np.delete(written, slice(place, place + count))


def test_rows_are_interpolated_from_ten() -> None:
    picture, taps, window = _normal(90), _normal(30), np.zeros(60, np.float32)
    # what is called for ahead may lie anywhere
    _interpolate(picture, 7, 10**6, taps, 10, window, 5, 2 * LANES)
    expected = np.correlate(picture[7 : 7 + 2 * LANES + 9].astype(float), taps[10:20].astype(float), "valid")
    np.testing.assert_allclose(window[5 : 5 + 2 * LANES], expected, atol=1e-5)
    assert not _outside(window, 5, 2 * LANES).any()


def test_rows_are_mixed_wherever_they_lie() -> None:
    rows = 7
    picture, mixture, out = _normal(80), _normal(rows + 2, LANES), np.zeros((AT_ONCE + 2) * LANES, np.float32)
    # of the next four places, which are only called for, nothing need be there
    places = np.array([99, 60, 3, 3, 41, *[10**6] * AT_ONCE])
    targets = np.array([0, 4, 2, 1, 3]) * LANES + 5
    _mix(picture, places, 1, rows, mixture.ravel(), 2 * LANES, out, targets)
    for place, target in zip(places[1:5], targets[1:], strict=True):
        expected = picture[place : place + rows].astype(float) @ mixture[2:].astype(float)
        np.testing.assert_allclose(out[target : target + LANES], expected, atol=1e-5)
    assert not _outside(out, 5 + LANES, AT_ONCE * LANES).any()


def test_columns_are_filtered_alike_to_both_sides() -> None:
    reach = 3
    wide, taps = _normal(AT_ONCE + 2 * reach + 1, LANES), _normal(reach + 1)
    out = np.zeros((AT_ONCE + 2) * LANES, np.float32)
    _filter(wide.ravel(), (reach + 1) * LANES, taps, reach, out, LANES)
    both = np.concatenate([taps[:0:-1], taps]).astype(float)
    expected = np.stack([both @ wide[1 + x : 1 + x + both.size].astype(float) for x in range(AT_ONCE)])
    np.testing.assert_allclose(out[LANES:-LANES].reshape(AT_ONCE, LANES), expected, atol=1e-5)
    assert not _outside(out, LANES, AT_ONCE * LANES).any()


def test_the_powers_of_a_column_are_those_of_what_the_halves_of_a_form_make_of_it() -> None:
    seen, form, out = _normal(AT_ONCE + 1, LANES), _normal(LANES, LANES), np.zeros(2 * AT_ONCE + 2, np.float32)
    _power(seen.ravel(), LANES, form.ravel(), 0, out, 1)
    halves = (seen[1:].astype(float) @ form.astype(float)).reshape(AT_ONCE, 2, LANES // 2)
    np.testing.assert_allclose(out[1:-1].reshape(AT_ONCE, 2), (halves**2).sum(axis=2), rtol=1e-5)
    assert not _outside(out, 1, 2 * AT_ONCE).any()
