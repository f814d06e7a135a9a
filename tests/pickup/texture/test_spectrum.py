"""Cross-spectra of rows whose cross-spectra are known."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import fft

from gramoscope.errors import ArgumentError
from gramoscope.pickup.texture.likelihood import softened
from gramoscope.pickup.texture.spectrum import (
    Band,
    CrossSpectra,
    LagSums,
    filtered,
    precision,
    square,
    whitening_filter,
)

BAND = Band()
LENGTH = 1024
WIDTH = 700
LAG_PX = 80
SMOOTH_BINS = 16.0
FREQUENCY = np.arange(LENGTH // 2 + 1) / LENGTH
# symmetric, as a groove has no preferred direction: the cross-spectra are real
FILTERS = np.array([[0.1, 0.5, 1.0, 0.5, 0.1], [-0.3, 0.2, 0.8, 0.2, -0.3], [0.0, -0.4, 0.9, -0.4, 0.0]])


def _true_spectra(length: int) -> np.ndarray:
    """H_i(f) H_j(f) of one noise through three filters, and a little noise of each row's own."""
    response = np.array([fft.rfft(np.roll(np.pad(taps, (0, length - 5)), -2)).real for taps in FILTERS])
    return np.einsum("if,jf->fij", response, response) + 0.1 * np.eye(3)


def _rows(rng: np.random.Generator, width: int = WIDTH) -> np.ndarray:
    noise = rng.normal(size=width + 4)
    rows = np.array([np.convolve(noise, taps, mode="valid") for taps in FILTERS])
    return np.ascontiguousarray((rows + np.sqrt(0.1) * rng.normal(size=rows.shape)).T, np.float32)


def _weight(rng: np.random.Generator, width: int = WIDTH) -> np.ndarray:
    """With a hole somewhere."""
    valid = np.ones(width, bool)
    hole = rng.integers(100, 500)
    valid[hole : hole + 120] = False
    return softened(valid)


def _summed(rng: np.random.Generator, windows: int) -> LagSums:
    total = CrossSpectra(3, LENGTH)
    for _ in range(windows):
        total.see(_rows(rng), _weight(rng))
    return total.lags(LAG_PX)


def test_known_cross_spectra_are_found_without_bias_whatever_is_missing() -> None:
    found = _summed(np.random.default_rng(8), 300).spectra(FREQUENCY, largest_lag_px=LAG_PX)
    true = _true_spectra(LENGTH)
    scale = np.sqrt(np.einsum("fi,fj->fij", *(2 * [np.diagonal(true, axis1=1, axis2=2)])))
    error = (found - true) / scale
    # 170 000 columns over twice the lag window: an error of 2.6 % in each bin
    assert np.abs(error.mean(axis=0)).max() < 0.006
    assert error.std() < 0.035
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))


def test_the_covariance_of_a_column_is_found_whatever_is_missing() -> None:
    total = _summed(np.random.default_rng(8), 300)
    true = FILTERS @ FILTERS.T + 0.1 * np.eye(3)
    np.testing.assert_allclose(total.covariance, true, atol=0.02 * np.diag(true).max())


def test_columns_are_counted_by_the_square_of_their_weight() -> None:
    rng, total, count = np.random.default_rng(8), CrossSpectra(3, LENGTH), 0.0
    for _ in range(3):
        weight = 0.7 * _weight(rng)
        count += float((weight.astype(np.float64) ** 2).sum())
        total.see(_rows(rng), weight)
    assert total.lags(LAG_PX).columns == pytest.approx(count, rel=1e-6)


def test_the_error_falls_as_the_root_of_the_columns() -> None:
    rng = np.random.default_rng(5)
    true = _true_spectra(LENGTH)
    few, many = (
        np.mean([(_summed(rng, n).spectra(FREQUENCY, largest_lag_px=LAG_PX) - true).std() for _ in range(6)])
        for n in (4, 64)
    )
    assert few / many == pytest.approx(4, rel=0.2)


def test_what_lies_a_lag_apart_is_summed_as_it_stands() -> None:
    rng, total = np.random.default_rng(2), CrossSpectra(3, LENGTH)
    rows, weight = _rows(rng), _weight(rng)
    total.see(rows, weight)
    found = total.lags(LAG_PX)
    shown = rows.astype(np.float64) * weight[:, None]
    for lag in (0, 1, 17, LAG_PX):
        onward = shown[: WIDTH - lag].T @ shown[lag:]
        # a groove has no direction along itself: both ways count
        expected = (onward + onward.T) / 2
        np.testing.assert_allclose(square(found.product, 3)[lag], expected, atol=1e-4 * np.abs(expected).max() + 1e-3)
        assert found.weight[lag] == pytest.approx(weight[: WIDTH - lag].astype(np.float64) @ weight[lag:], rel=1e-5)


def test_sums_of_windows_add_up_before_and_after_they_are_lags() -> None:
    rng = np.random.default_rng(3)
    one, other = CrossSpectra(3, LENGTH), CrossSpectra(3, LENGTH)
    for total in (one, other):
        total.see(_rows(rng), _weight(rng))
    after = one.lags(LAG_PX) + other.lags(LAG_PX)
    one.add(other)
    before = one.lags(LAG_PX)
    np.testing.assert_allclose(before.product, after.product, rtol=1e-9, atol=1e-9 * np.abs(after.product).max())
    np.testing.assert_allclose(before.weight, after.weight, rtol=1e-9)


@pytest.mark.parametrize("length", [1024, 1025])
def test_lags_do_not_depend_on_the_transform_that_they_were_summed_by(length: int) -> None:
    rng = np.random.default_rng(2)
    rows, weight = _rows(rng), _weight(rng)
    found = []
    for n in (900, length):
        total = CrossSpectra(3, n)
        total.see(rows, weight)
        found.append(total.lags(LAG_PX))
    np.testing.assert_allclose(found[0].product, found[1].product, atol=1e-5 * np.abs(found[0].product).max())
    np.testing.assert_allclose(found[0].weight, found[1].weight, rtol=1e-5)


def test_lags_that_were_not_summed_are_refused() -> None:
    total = _summed(np.random.default_rng(2), 1)
    with pytest.raises(ArgumentError, match="no more than the 80"):
        total.spectra(FREQUENCY, largest_lag_px=LAG_PX + 1)


@pytest.mark.parametrize(("lag", "share"), [(0, 1.0), (20, 1.0), (40, 1.0), (60, 0.5), (80, 0.0), (100, 0.0)])
def test_lags_count_fully_up_to_half_the_window_and_not_beyond_it(lag: int, share: float) -> None:
    rows = np.zeros((WIDTH, 1), np.float32)
    rows[[200, 200 + lag]] = 1.0
    weight = np.ones(WIDTH, np.float32)
    sums = CrossSpectra(rows.shape[1], LENGTH)
    sums.see(rows, weight)
    found = sums.lags(LAG_PX).spectra(FREQUENCY, largest_lag_px=LAG_PX)
    assert fft.irfft(found[:, 0, 0], LENGTH)[lag] * (WIDTH - lag) == pytest.approx(share, abs=0.04)


def _power_laws() -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    return {
        "falls by five orders": lambda f: 1 / (1 + (f / 0.02) ** 4),
        "has a hump": lambda f: 0.01 + np.exp(-((f - 0.1) ** 2) / 0.003),
        "flat": lambda f: np.ones_like(f),
    }


@pytest.mark.parametrize("law", _power_laws())
def test_a_whitened_spectrum_is_flat_in_the_band_and_nothing_outside(law: str) -> None:
    power = _power_laws()[law](np.linspace(0, 0.5, 129))
    taps = whitening_filter(power, BAND)
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-12)
    frequency = np.arange(513) / 1024
    response = np.abs(fft.rfft(np.pad(taps, (0, 1024 - taps.size)))) ** 2
    white_db = 10 * np.log10(response * _power_laws()[law](frequency) + 1e-30)
    # forty-one taps cannot follow what bends within a fortieth of a cycle a pixel
    inside = (frequency > 0.06) & (frequency < 0.3)
    assert np.ptp(white_db[inside]) < 3
    assert white_db[0] < white_db[inside].mean() - 100
    assert (white_db[frequency > 0.45] < white_db[inside].mean() - 15).all()


@pytest.mark.parametrize("beyond", [0, 1, 2, 19, 20])
@pytest.mark.parametrize("count", [1, 4, 33, 1100])
def test_filtering_moves_nothing_and_mirrors_what_lies_outside(count: int, beyond: int) -> None:
    rng = np.random.default_rng(3)
    rows, half = rng.normal(size=(333, count)).astype(np.float32), rng.normal(size=beyond + 1)
    before = rows.copy()
    taps = np.concatenate([half[:0:-1], half])
    mirrored = np.concatenate([rows[:beyond][::-1], rows, rows[len(rows) - beyond :][::-1]])
    direct = np.array([np.convolve(row, taps, mode="valid") for row in mirrored.T]).T
    found = filtered(rows, taps)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, direct, atol=3e-5)
    np.testing.assert_array_equal(rows, before)


def _covariance(values: np.ndarray, seed: int = 1) -> np.ndarray:
    vectors, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(values.size, values.size)))
    return np.broadcast_to((vectors * values) @ vectors.T, (40, values.size, values.size))


def test_the_precision_of_a_safe_matrix_is_its_inverse() -> None:
    c = _covariance(np.array([2.0, 2.0, 2.0, 3.0, 50.0, 7.0, 11.0, 4.0, 900.0]))
    inverse, noise = precision(c, loading=0.0, smooth_bins=SMOOTH_BINS)
    np.testing.assert_allclose(inverse @ c, np.broadcast_to(np.eye(9), c.shape), atol=1e-3)
    np.testing.assert_allclose(noise, 2.0, rtol=1e-5)


def test_what_the_sample_could_not_tell_is_never_below_the_noise() -> None:
    inverse, noise = precision(
        _covariance(np.array([1e-9, 0.0, 6.0, 7.0, 8.0, 9.0])), loading=0.0, smooth_bins=SMOOTH_BINS
    )
    assert np.linalg.eigvalsh(inverse)[:, -1] == pytest.approx(1 / noise[0], rel=1e-3)
    lucky, noise = precision(
        _covariance(np.array([0.1, 1.9, 6.0, 7.0, 8.0, 9.0])), loading=0.0, smooth_bins=SMOOTH_BINS
    )
    assert noise == pytest.approx(1.0, rel=1e-5)
    assert np.linalg.eigvalsh(lucky)[:, -1] == pytest.approx(1.0, rel=1e-4)


def test_a_single_unlucky_bin_leans_on_its_neighbours() -> None:
    c = _covariance(np.array([1.0, 1.0, 3.0, 4.0, 5.0, 6.0])).copy()
    c[20] = _covariance(np.array([1e-6, 1e-6, 3.0, 4.0, 5.0, 6.0]))[0]
    inverse, _ = precision(c, loading=0.0, smooth_bins=SMOOTH_BINS)
    assert np.linalg.eigvalsh(inverse[20])[-1] < 1.1


def test_loading_adds_a_share_of_the_mean_power_to_every_direction() -> None:
    values = np.array([1.0, 1.0, 1.0, 5.0, 12.0, 40.0])
    inverse, _ = precision(_covariance(values), loading=0.3, smooth_bins=SMOOTH_BINS)
    np.testing.assert_allclose(np.sort(1 / np.linalg.eigvalsh(inverse[7])), values + 0.3 * 10, rtol=1e-4)


def test_the_band_is_in_cycles_a_pixel() -> None:
    assert Band(0.02, 0.35).bins(1000) == slice(20, 351)
    np.testing.assert_allclose(Band(0.02, 0.35).frequencies(1000)[[0, 1, -1]], [0.02, 0.021, 0.35], rtol=1e-12)


@pytest.mark.parametrize("width", [1, 7, 25])
def test_rows_shorter_than_the_filter_repeat_their_other_end(width: int) -> None:
    rng = np.random.default_rng(5)
    rows, half = rng.normal(size=(width, 2)).astype(np.float32), rng.normal(size=21)
    place = np.minimum(np.arange(20), width - 1)
    beyond = np.concatenate([rows[place[::-1]], rows, rows[width - 1 - place]])
    taps = np.concatenate([half[:0:-1], half])
    np.testing.assert_allclose(
        filtered(rows, taps).T, [np.convolve(one, taps, mode="valid") for one in beyond.T], atol=3e-5
    )
