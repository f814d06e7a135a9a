"""Transforms of sixteen rows at once against those of SciPy."""

import numpy as np
import pytest
from scipy import fft

from gramoscope.conventions import Float32Array
from gramoscope.errors import ArgumentError
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.lane_transform import (
    PAIR,
    fast_length,
    fold,
    let_through,
    plan_for,
    power_between,
    transform,
)

LENGTHS = [2, 4, 6, 8, 10, 12, 30, 90, 96, 250, 486, 1458, 1500, 1536]
EXACT = 1e-5
"""Of single precision, after eleven stages at the most."""


def _rows(length: int, seed: int = 0) -> Float32Array:
    return np.random.default_rng([length, seed]).normal(size=(length, LANES)).astype(np.float32)


def _transformed(line: Float32Array, length: int) -> Float32Array:
    plan, before = plan_for(length), line.copy()
    one, other = np.full((2, length * LANES), np.nan, np.float32)
    where = transform(line, 0, plan.radix, plan.twiddle, one, other)
    np.testing.assert_array_equal(line, before)
    return (one, other)[where]


@pytest.mark.parametrize("length", LENGTHS)
def test_complex_lanes_are_transformed_as_scipy_does(length: int) -> None:
    rows = _rows(length)
    found = _transformed(rows.reshape(-1), length).reshape(-1, 2, LANES)
    expected = fft.fft(rows[0::2].astype(np.float64) + 1j * rows[1::2], axis=0)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[:, 0], expected.real, atol=EXACT * scale)
    np.testing.assert_allclose(found[:, 1], expected.imag, atol=EXACT * scale)


@pytest.mark.parametrize("length", LENGTHS[2:])
def test_filters_hear_the_spectrum_of_the_rows(length: int) -> None:
    rows, plan = _rows(length), plan_for(length)
    first, count = 1, length // 2
    filters = np.random.default_rng(length).normal(size=(count, 4, LANES)).astype(np.float32)
    bins = np.zeros((length // 2 + 1) * PAIR, np.float32)
    let_through(_transformed(rows.reshape(-1), length), plan.turn, filters, first, bins, 8)
    spectrum = fft.rfft(rows.astype(np.float64), axis=0)[first : first + count]
    expected = np.einsum("bkc,bc->bk", filters, spectrum)
    found = bins.reshape(-1, 2, LANES)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[first:, 0, 8:12], expected.real, atol=EXACT * scale)
    np.testing.assert_allclose(found[first:, 1, 8:12], expected.imag, atol=EXACT * scale)
    assert (np.delete(found, range(8, 12), axis=2) == 0).all()
    assert (found[:first] == 0).all()


@pytest.mark.parametrize("length", LENGTHS)
def test_the_way_back_is_that_of_scipy(length: int) -> None:
    rows, plan = _rows(length), plan_for(length)
    spectrum = fft.rfft(rows.astype(np.float64), axis=0)
    bins = np.stack([spectrum.real, spectrum.imag], axis=1).astype(np.float32).reshape(-1)
    folded = np.empty(length * LANES, np.float32)
    fold(bins, plan.turn, folded)
    # their parts are exchanged: the second half of a lane is the even row
    back = _transformed(folded, length).reshape(-1, 2, LANES)[:, ::-1].reshape(length, LANES)
    np.testing.assert_allclose(back, rows, atol=EXACT * np.abs(rows).max())


@pytest.mark.parametrize("least", [1, 2, 7, 97, 1302, 1442, 2001])
def test_fast_lengths_are_even_long_enough_and_not_much_longer(least: int) -> None:
    length = fast_length(least)
    assert length % 2 == 0
    assert least <= length <= max(1.13 * least, least + 3)
    assert np.prod(plan_for(length).radix) == length // 2


@pytest.mark.parametrize("length", [0, 1, 9, 14, 2 * 11])
def test_a_length_with_other_factors_is_refused(length: int) -> None:
    with pytest.raises(ArgumentError, match="an even length"):
        plan_for(length)


@pytest.mark.parametrize("length", LENGTHS[2:])
def test_the_power_of_a_band_is_that_of_the_spectrum(length: int) -> None:
    rows, plan, band = _rows(length), plan_for(length), (1, length // 2 + 1)
    line = _transformed(rows.reshape(-1), length)
    power = np.mean(np.abs(fft.rfft(rows.astype(np.float64), axis=0)[band[0] : band[1]]) ** 2, axis=0)
    for lane in (0, 5, LANES - 1):
        assert power_between(line, plan.turn, band, lane) == pytest.approx(power[lane], rel=1e-4)
