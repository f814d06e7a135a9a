"""Quadratic forms of a window, and the few filters whose energies make them up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import fft

from gramoscope.conventions import FloatArray
from gramoscope.pickup.texture.filter_bank import (
    FAINT,
    LEAST_POWER,
    FilterBank,
    common_channels,
    interpolated,
    root,
    row_weights,
    strongest_filters,
    strongest_patterns,
    texture_weight,
    through_channels,
    usual_power,
    witness_forms,
)
from gramoscope.pickup.texture.following import GENTLE, follow
from gramoscope.pickup.texture.spectrum import Band

BAND = Band(0.05, 0.3)
LENGTH = 240
BINS = 61
HALF_PX = 3
ROWS = 2 * HALF_PX + 1
WIDE = ROWS + 16
NOISE = 0.3
INNER = slice(8, -8)


def _positive(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Covariances with nothing that is next to nothing in them."""
    half = rng.normal(size=(*shape, 2 * shape[-1]))
    return np.asarray(half @ half.swapaxes(-1, -2) / (2 * shape[-1]) + 0.1 * np.eye(shape[-1]))


def _symmetric(rng: np.random.Generator, *shape: int) -> np.ndarray:
    form = rng.normal(size=(*shape, shape[-1]))
    return np.asarray(form + form.swapaxes(-1, -2))


def _smooth(ends: np.ndarray) -> np.ndarray:
    """Matrices for each bin between those at both ends of a band."""
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(BINS) / (BINS - 1))[:, None, None]
    return np.asarray((1 - share) * ends[0] + share * ends[1])


def _bank(filters: np.ndarray, sign: np.ndarray) -> FilterBank:
    whole = np.eye(filters.shape[2], dtype=np.float32)
    return FilterBank(whole, filters.astype(np.float32), sign.astype(np.float32), whole)


def _all_filters(form: FloatArray, spectra: FloatArray) -> FilterBank:
    """As many of either sign as there are rows: also those that say nothing."""
    filters, sign = strongest_filters(form, spectra, root(spectra), 2 * form.shape[1])
    return _bank(filters, sign)


def _energies(filters: FloatArray, sign: FloatArray) -> FloatArray:
    """Σ ± U Uᵀ in each bin."""
    return np.einsum("k,fki,fkj->fij", sign, filters, filters)


def _in_band(window: np.ndarray) -> np.ndarray:
    spectrum, bins = fft.rfft(window.astype(np.float64), LENGTH, axis=0), BAND.bins(LENGTH)
    spectrum[: bins.start] = spectrum[bins.stop :] = 0
    return np.asarray(fft.irfft(spectrum, LENGTH, axis=0)[: len(window)])


def test_all_filters_together_say_what_the_form_says() -> None:
    rng = np.random.default_rng(1)
    form, spectra = _smooth(_symmetric(rng, 2, 9)), _smooth(_positive(rng, 2, 9))
    window = rng.normal(size=(LENGTH, 9)).astype(np.float32)
    score, _ = _all_filters(form, spectra).heard(window, band=BAND, length=LENGTH)
    x = fft.rfft(window.astype(np.float64), axis=0)[BAND.bins(LENGTH)]
    said = np.einsum("fi,fij,fj->f", x.conj(), form, x).real
    assert score.sum() == pytest.approx(2 / LENGTH * said.sum(), abs=1e-5 * np.abs(said).sum())


def test_a_form_that_is_the_same_at_all_frequencies_is_heard_column_by_column() -> None:
    rng = np.random.default_rng(2)
    form, spectra = (np.broadcast_to(make(rng, 9), (BINS, 9, 9)) for make in (_symmetric, _positive))
    window = rng.normal(size=(201, 9)).astype(np.float32)
    score, loudness = _all_filters(form, spectra).heard(window, band=BAND, length=LENGTH)
    x = _in_band(window)
    assert score.shape == loudness.shape == (201,)
    np.testing.assert_allclose(score, np.einsum("si,ij,sj->s", x, form[0], x), atol=1e-4 * np.abs(score).max())


def test_the_loudness_is_the_sum_of_all_energies() -> None:
    rng = np.random.default_rng(3)
    filters, sign = rng.normal(size=(BINS, 4, 5)), np.array([-1.0, -1.0, 1.0, 1.0])
    window = rng.normal(size=(180, 5)).astype(np.float32)
    score, loudness = _bank(filters, sign).heard(window, band=BAND, length=LENGTH)
    spectrum = np.zeros((LENGTH // 2 + 1, 4), complex)
    bins = BAND.bins(LENGTH)
    spectrum[bins] = np.einsum("fkc,fc->fk", filters, fft.rfft(window.astype(np.float64), LENGTH, axis=0)[bins])
    p = fft.irfft(spectrum, LENGTH, axis=0)[:180]
    np.testing.assert_allclose(score, p**2 @ sign, atol=1e-5 * loudness.max())
    np.testing.assert_allclose(loudness, (p**2).sum(axis=1), atol=1e-5 * loudness.max())


def _witnesses(rng: np.random.Generator, spread_px: float = 0.0) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """C⁻¹ and C′, the same in all bins, and both forms."""
    inverse, change = np.linalg.inv(_positive(rng, ROWS)), _symmetric(rng, ROWS)
    every = [np.broadcast_to(one, (BINS, ROWS, ROWS)) for one in (inverse, change)]
    forms = witness_forms(every[0], every[1], spread_px=spread_px)
    return inverse, change, list(forms)


def _told(window: np.ndarray, inverse: np.ndarray, change: np.ndarray) -> np.ndarray:
    """−(x − N y)'·y and −½ y·C′y of each column of a wide window; of the noise N y nothing should be heard."""
    y = window[:, INNER] @ inverse
    still = np.pad(NOISE * y, ((0, 0), (8, 8)))
    slope = np.zeros_like(y)
    for k, tap in enumerate(GENTLE, start=1):
        slope += tap * ((window - still)[:, 8 + k : 8 + k + ROWS] - (window - still)[:, 8 - k : 8 - k + ROWS])
    return np.array([-(slope * y).sum(axis=1), -0.5 * np.einsum("si,ij,sj->s", y, change, y)])


def test_the_forms_are_what_the_witnesses_say() -> None:
    rng = np.random.default_rng(4)
    inverse, change, forms = _witnesses(rng)
    window = rng.normal(size=(50, WIDE))
    for form, told in zip(forms, _told(window, inverse, change), strict=True):
        assert form.shape == (BINS, WIDE, WIDE)
        np.testing.assert_allclose(form, form.transpose(0, 2, 1), atol=1e-12)
        np.testing.assert_allclose(np.einsum("si,ij,sj->s", window, form[17], window), told, atol=1e-6)


def test_through_filters_both_witnesses_are_heard_in_each_column() -> None:
    rng = np.random.default_rng(5)
    inverse, change, forms = _witnesses(rng)
    spectra = np.broadcast_to(_positive(rng, WIDE), (BINS, WIDE, WIDE))
    window = rng.normal(size=(200, WIDE)).astype(np.float32)
    for form, told in zip(forms, _told(_in_band(window), inverse, change), strict=True):
        score, _ = _all_filters(form, spectra).heard(window, band=BAND, length=LENGTH)
        np.testing.assert_allclose(score, told, atol=1e-4 * np.abs(told).max())


@pytest.mark.parametrize("cycles", [12, 31, 72])
def test_a_wave_along_the_groove_is_heard_by_what_is_known_at_its_frequency(cycles: int) -> None:
    rng = np.random.default_rng(cycles)
    covariance, changes = _smooth(_positive(rng, 2, ROWS)), _smooth(_symmetric(rng, 2, ROWS))
    forms = witness_forms(np.linalg.inv(covariance), changes, spread_px=0.0)
    turn = 2 * np.pi * cycles / LENGTH * np.arange(LENGTH)
    window = np.outer(np.cos(turn), rng.normal(size=WIDE)) + np.outer(np.sin(turn), rng.normal(size=WIDE))
    mine = cycles - BAND.bins(LENGTH).start
    truth = _told(window, np.linalg.inv(covariance[mine]), changes[mine])
    spectra = np.broadcast_to(_positive(rng, WIDE), (BINS, WIDE, WIDE))
    for form, told in zip(forms, truth, strict=True):
        score, _ = _all_filters(form, spectra).heard(window.astype(np.float32), band=BAND, length=LENGTH)
        np.testing.assert_allclose(score, told, atol=1e-4 * np.abs(told).max())


@pytest.mark.parametrize("spread_px", [0.125, 0.5, 0.8125])
def test_both_sides_of_a_path_are_the_mean_of_what_is_said_beside_it(spread_px: float) -> None:
    rng = np.random.default_rng(6)
    picture = rng.normal(size=(120, 64)).astype(np.float32)
    # on whole rows, for what lies between rows is interpolated once only
    path = np.round(np.linspace(24, 39, 120))
    apart, together = (_witnesses(np.random.default_rng(7), spread)[2] for spread in (0.0, spread_px))
    low, here, high = (follow(picture, path + side, HALF_PX) for side in (-spread_px, 0.0, spread_px))
    for one, both in zip(apart, together, strict=True):
        beside = [np.einsum("si,ij,sj->s", window, one[0], window) for window in (low, high)]
        told = np.einsum("si,ij,sj->s", here, both[0], here)
        np.testing.assert_allclose(told, np.mean(beside, axis=0), atol=1e-4 * np.abs(told).max())
        assert np.std(beside[1] - beside[0]) > 0.1 * np.std(told), "the sides do not say the same"


def _known_form(rng: np.random.Generator, strength: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """A form with given eigenvalues against its spectra, the same in all bins."""
    rows = strength.size
    lower = np.linalg.cholesky(_positive(rng, rows))
    vector, _ = np.linalg.qr(rng.normal(size=(rows, rows)))
    back = np.linalg.solve(lower.T, vector)
    form, spectra = (np.broadcast_to(one, (BINS, rows, rows)) for one in ((back * strength) @ back.T, lower @ lower.T))
    return form, spectra


@pytest.mark.parametrize("count", [2, 4, 6])
def test_the_filters_that_are_kept_are_the_loudest_of_each_sign(count: int) -> None:
    strength = np.array([-5.0, -3.0, -2.0, -0.4, 0.3, 1.0, 4.0, 6.0])
    form, spectra = _known_form(np.random.default_rng(8), strength)
    filters, sign = strongest_filters(form, spectra, root(spectra), count)
    assert filters.shape == (BINS, count, 8)
    np.testing.assert_array_equal(sign, np.repeat([-1.0, 1.0], count // 2))
    power = np.linalg.eigvalsh(filters @ spectra @ filters.transpose(0, 2, 1))
    kept = np.sort(np.abs(np.r_[strength[: count // 2], strength[-(count // 2) :]]))
    np.testing.assert_allclose(power, np.broadcast_to(kept, (BINS, count)), rtol=1e-6)
    # what is left out is what is weak
    lower = np.linalg.cholesky(spectra[0])
    rest = np.linalg.eigvalsh(lower.T @ (form - _energies(filters, sign))[0] @ lower)
    left = np.sort(np.r_[strength[count // 2 : -(count // 2)], np.zeros(count)])
    np.testing.assert_allclose(rest, left, atol=1e-6)


def test_a_form_of_one_sign_has_no_filters_of_the_other() -> None:
    form, spectra = _known_form(np.random.default_rng(9), np.array([0.0, 0.0, 0.5, 2.0, 3.0]))
    filters, sign = strongest_filters(form, spectra, root(spectra), 4)
    assert (filters[:, sign < 0] == 0).all()
    lower = np.linalg.cholesky(spectra[0])
    said = np.linalg.eigvalsh(lower.T @ _energies(filters, sign)[0] @ lower)
    np.testing.assert_allclose(said, [0.0, 0.0, 0.0, 2.0, 3.0], atol=1e-6)
    nothing, _ = strongest_filters(0 * form, spectra, root(spectra), 4)
    assert (nothing == 0).all()


def _turned(angle: FloatArray) -> np.ndarray:
    """Rotations in the plane of the first and second of six rows, and as slowly in that of the third and fifth."""
    turn = np.broadcast_to(np.eye(6), (angle.size, 6, 6)).copy()
    for i, j in ((0, 1), (2, 4)):
        turn[:, i, i] = turn[:, j, j] = np.cos(angle)
        turn[:, i, j] = -np.sin(angle)
        turn[:, j, i] = np.sin(angle)
    return turn


def test_filters_of_neighbouring_frequencies_are_alike_even_where_the_loudest_changes() -> None:
    share = np.arange(BINS) / (BINS - 1)
    # the loudest of either sign gives way to the second in the middle of the band
    strength = np.stack(
        [3 - 2 * share, 1 + 2 * share, 0.1 + 0 * share, -2.5 + 2 * share, -0.5 - 2 * share, -0.1 + 0 * share], axis=1
    )
    turn = _turned(0.9 * share)
    form = turn @ (strength[:, :, None] * turn.transpose(0, 2, 1))
    spectra = _smooth(np.stack([np.eye(6), np.diag([1.2, 1.0, 0.9, 1.0, 1.1, 1.0])]))
    filters, sign = strongest_filters(form, spectra, root(spectra), 4)
    steps = np.linalg.norm(np.diff(filters, axis=0), axis=(1, 2))
    # as far as each filter goes from end to end: two turn by 0.9, and change their loudness
    assert steps.max() < 3 / BINS * np.linalg.norm(filters[0])
    kept = _energies(filters, sign)
    for b in (0, 30, 60):
        lower = np.linalg.cholesky(spectra[b])
        all_said = np.linalg.eigvalsh(lower.T @ form[b] @ lower)
        said = np.linalg.eigvalsh(lower.T @ kept[b] @ lower)
        np.testing.assert_allclose(said[[0, 1, -2, -1]], all_said[[0, 1, -2, -1]], rtol=1e-6)


def test_more_energy_in_a_positive_filter_asks_for_a_higher_row() -> None:
    # asks for a higher row where there is more above than below
    rows = np.arange(7)
    rising = np.exp(-0.5 * (rows - 4.5) ** 2)
    falling = rising[::-1]
    form = np.broadcast_to(np.outer(rising, rising) - np.outer(falling, falling), (BINS, 7, 7))
    one = np.broadcast_to(np.eye(7), form.shape)
    filters, sign = strongest_filters(form, one, one, 2)
    noise = np.random.default_rng(11).normal(size=(LENGTH, 1))
    for middle, asked in ((4.5, 1), (1.5, -1)):
        window = (noise * np.exp(-0.5 * (rows - middle) ** 2)).astype(np.float32)
        score, _ = _bank(filters, sign).heard(window, band=BAND, length=LENGTH)
        assert (np.sign(score) == asked).mean() > 0.99


def test_channels_lose_nothing_of_a_form_that_lies_in_them() -> None:
    rng = np.random.default_rng(12)
    basis = rng.normal(size=(9, 4))
    inside, spectra = _smooth(_symmetric(rng, 2, 4)), _smooth(_positive(rng, 2, 9))
    (form,), seen = through_channels((basis @ inside @ basis.T,), spectra, basis)
    np.testing.assert_allclose(seen, basis.T @ spectra @ basis, atol=1e-9)
    np.testing.assert_allclose(form, inside, atol=1e-9 * np.abs(inside).max())


def test_what_channels_do_not_show_is_what_they_lead_to_expect() -> None:
    rng = np.random.default_rng(13)
    basis, form = rng.normal(size=(6, 3)), _symmetric(rng, 1, 6)
    x = rng.normal(size=(6, 6)) @ rng.normal(size=(6, 300))
    z = basis.T @ x
    fit, *_ = np.linalg.lstsq(z.T, x.T)
    expected = fit.T @ z
    (through,), _ = through_channels((form,), (x @ x.T)[np.newaxis], basis)
    said = np.einsum("is,ij,js->s", expected, form[0], expected)
    np.testing.assert_allclose(np.einsum("is,ij,js->s", z, through[0], z), said, atol=1e-6 * said.std())


def _within(basis: FloatArray, wanted: FloatArray) -> np.ndarray:
    """Share of each wanted column that lies in the basis."""
    fit, *_ = np.linalg.lstsq(basis, wanted)
    return np.asarray(1 - np.linalg.norm(wanted - basis @ fit, axis=0) / np.linalg.norm(wanted, axis=0))


def test_common_channels_are_white_in_the_mean_and_show_all_of_some_patterns() -> None:
    rng = np.random.default_rng(15)
    spectra, patterns = _smooth(_positive(rng, 2, 12)), rng.normal(size=(12, 3))
    forms = tuple(_smooth(_symmetric(rng, 2, 12)) for _ in range(2))
    basis = common_channels(forms, spectra, patterns, 7)
    assert basis.shape == (12, 7)
    np.testing.assert_allclose(basis.T @ spectra.mean(axis=0) @ basis, np.eye(7), atol=1e-9)
    np.testing.assert_allclose(_within(basis, patterns), 1, atol=1e-9)
    assert (_within(basis, rng.normal(size=(12, 3))) < 0.9).all()


def test_common_channels_show_all_of_forms_that_need_no_more() -> None:
    rng = np.random.default_rng(16)
    spectra, patterns = _smooth(_positive(rng, 2, 12)), rng.normal(size=(12, 2))
    looks = [rng.normal(size=(12, 2)) for _ in range(2)]
    forms = tuple(look @ _smooth(_symmetric(rng, 2, 2)) @ look.T for look in looks)
    basis = common_channels(forms, spectra, patterns, 6)
    np.testing.assert_allclose(_within(basis, np.hstack(looks)), 1, atol=1e-6)
    for form in forms:
        (through,), _ = through_channels((form,), spectra, basis)
        np.testing.assert_allclose(basis @ through @ basis.T, form, atol=1e-6 * np.abs(form).max())


@pytest.mark.parametrize("strength", [1e-4, 1.0, 1e4])
def test_a_form_counts_by_where_it_looks_and_not_by_how_loud_it_is(strength: float) -> None:
    rng = np.random.default_rng(17)
    spectra, patterns = _smooth(_positive(rng, 2, 12)), rng.normal(size=(12, 2))
    narrow, broad = rng.normal(size=(12, 1)), rng.normal(size=(12, 6))
    forms = (
        np.broadcast_to(strength * narrow @ narrow.T, spectra.shape),
        np.broadcast_to(broad @ broad.T, spectra.shape),
    )
    # all that the first says is in one channel, of the second in none
    assert _within(common_channels(forms, spectra, patterns, 3), narrow)[0] > 0.8


def test_a_root_is_one() -> None:
    covariance = _positive(np.random.default_rng(18), 5, 7)
    lower = root(covariance)
    np.testing.assert_allclose(lower @ lower.transpose(0, 2, 1), covariance, atol=1e-9)


def test_what_is_next_to_nothing_in_a_root_is_lifted() -> None:
    vector, _ = np.linalg.qr(np.random.default_rng(19).normal(size=(4, 4)))
    lower = root((vector * [0.0, -1e-12, 2.0, 5.0]) @ vector.T)
    power = np.linalg.eigvalsh(lower @ lower.T)
    np.testing.assert_allclose(power, [5 * LEAST_POWER, 5 * LEAST_POWER, 2.0, 5.0], rtol=1e-6)
    assert np.isfinite(root(np.zeros((3, 3)))).all()


def test_the_strongest_patterns_have_the_most_power_when_every_row_counts_the_same() -> None:
    rng = np.random.default_rng(20)
    covariance, gain = _positive(rng, 9), rng.uniform(0.1, 10, 9)
    louder = gain[:, None] * covariance * gain
    patterns = strongest_patterns(louder, 4)
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale)
    np.testing.assert_allclose(patterns.T @ louder @ patterns, np.diag(np.linalg.eigvalsh(correlation)[-4:]), atol=1e-9)
    # a row twice as loud is seen half as much
    alike = strongest_patterns(covariance, 4)
    np.testing.assert_allclose(np.abs(gain[:, None] * patterns), np.abs(alike), atol=1e-9)


def _usual(basis: FloatArray, covariance: FloatArray) -> FilterBank:
    usual = usual_power(covariance, basis, slice(2, -2)).astype(np.float32)
    return replace(_bank(np.zeros((1, 2, basis.shape[1])), np.array([-1.0, 1.0])), usual=usual)


def test_where_channels_show_all_the_power_it_is_that_of_the_rows_by_their_weights() -> None:
    rng = np.random.default_rng(21)
    covariance, basis = _positive(rng, 8), rng.normal(size=(8, 8))
    x = np.linalg.cholesky(covariance) @ rng.normal(size=(8, 400))
    power = _usual(basis, covariance).power((basis.T @ x).T.astype(np.float32))
    direct = x.T**2 @ row_weights(np.diag(covariance), slice(2, -2))
    np.testing.assert_allclose(power, direct, atol=2e-3)
    everything = np.mean(x[2:-2] ** 2 / np.diag(covariance)[2:-2, None], axis=0)
    np.testing.assert_allclose(power[:, 1], everything, atol=2e-3)


def test_the_usual_texture_has_power_one_and_scratches_and_missing_walls_have_not() -> None:
    rng = np.random.default_rng(22)
    covariance = _positive(rng, 9)
    basis = strongest_patterns(covariance, 4)
    bank = _usual(basis, covariance)
    x = np.linalg.cholesky(covariance) @ rng.normal(size=(9, 20_000))

    def power(window: np.ndarray) -> np.ndarray:
        return np.asarray(bank.power((basis.T @ window).T.astype(np.float32)).mean(axis=0))

    np.testing.assert_allclose(power(x), 1, atol=0.03)
    np.testing.assert_allclose(power(0.1 * x), 0.01, atol=0.001)
    scratched = x.copy()
    scratched[3:6] += 12
    assert power(scratched)[1] > 4


def test_noise_alone_is_not_taken_for_texture() -> None:
    """Half the rows of a window show little but noise, and there a missing wall has all the power that is usual."""
    rng = np.random.default_rng(24)
    noise, sharp = 0.02, np.exp(-0.5 * ((np.arange(41) - 20) / 2.0) ** 2)
    blur = np.exp(-0.5 * ((np.arange(41)[:, None] - np.arange(41)) / 1.5) ** 2)
    covariance = np.sqrt(np.outer(sharp, sharp)) * blur + noise * np.eye(41)
    basis = np.linalg.solve(root(covariance).T, np.eye(41)[:, ::3])
    bank = _usual(basis, covariance)
    texture, anything = bank.power(
        rng.normal(0, np.sqrt(noise), (4000, 41)).astype(np.float32) @ basis.astype(np.float32)
    ).mean(axis=0)
    assert texture < 0.1 < 0.3 < anything


def test_rows_count_for_a_faint_texture_so_that_it_is_told_best() -> None:
    rng = np.random.default_rng(25)
    texture, noise = rng.exponential(size=12), 0.1
    texture[3] = 0.0
    weight = texture_weight(noise + texture)
    assert weight @ (noise + texture) == pytest.approx(1)

    def told(weight: np.ndarray) -> float:
        """Share of the texture over its standard error, by Σ w x² of normal rows."""
        return float(weight @ texture / np.sqrt(2 * weight**2 @ (noise + FAINT * texture) ** 2))

    best = told(weight)
    assert best > max(told(weight * (1 + 0.1 * rng.normal(size=12))) for _ in range(100))
    assert best > 2 * told(1 / (noise + texture))
    assert best > 1.04 * told(np.ones(12))
    np.testing.assert_allclose(texture_weight(np.full(6, 3.0)), 1 / 18, rtol=1e-6)


def test_filters_at_other_bins_lie_between_those_that_are_known() -> None:
    filters = np.random.default_rng(23).normal(size=(4, 2, 3))
    bins = np.array([0.1, 0.14, 0.2, 0.3])
    found = interpolated(filters, bins, np.array([0.05, 0.1, 0.12, 0.14, 0.275, 0.3, 0.35]))
    known = [
        filters[0],
        filters[0],
        (filters[0] + filters[1]) / 2,
        filters[1],
        0.25 * filters[2] + 0.75 * filters[3],
        filters[3],
        filters[3],
    ]
    np.testing.assert_allclose(found, known, atol=1e-12)


def test_where_nothing_was_seen_filters_say_nothing_and_nothing_fails() -> None:
    nothing = np.zeros((5, WIDE, WIDE))
    patterns = strongest_patterns(nothing[0], 2)
    basis = common_channels((nothing, nothing), nothing, patterns, 6)
    (form,), seen = through_channels((nothing,), nothing, basis)
    filters, _ = strongest_filters(form, seen, root(seen), 4)
    np.testing.assert_array_equal(filters, 0)
    assert np.isfinite(usual_power(nothing[0], basis, INNER)).all()
