"""What both witnesses say of a window whose covariance is known, and how near that comes to what can be known at all.

The texture is white along the groove, smooth over a row or two, and blurred the more the further a row lies from the sharp
one: two rows have the covariance H(i) H(j) ρ(i − j) at every frequency, in closed form. All that a witness has to say is
heard, through as many filters as its form has; every row is a channel.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import fft, ndimage

from gramoscope.pickup.texture import likelihood
from gramoscope.pickup.texture.filter_bank import FilterBank, root, strongest_filters, witness_forms
from gramoscope.pickup.texture.following import REACH, follow, wide_rows
from gramoscope.pickup.texture.likelihood import (
    QUIET_BAND,
    TAPER,
    TAPER_PX,
    believable,
    best_shares,
    quiet_power,
    said,
    softened,
)
from gramoscope.pickup.texture.spectrum import Band

BAND = Band(0.02, 0.35)
HALF_PX, WIDTH, HEIGHT, LENGTH = 8, 1000, 49, 1200
SHARP_ROW = 23.0
BLUR_PX_PER_ROW = 0.35
SMOOTH_ROWS = 1.5
NOISE = 0.01
MOVE_PX = 0.2


def _response(away: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Of a Gaussian disc that grows with the distance from the sharp row, and never is a point."""
    sigma = np.hypot(0.6, BLUR_PX_PER_ROW * away)
    return np.exp(-2 * (np.pi * frequency * sigma[..., None]) ** 2)


def _picture(rng: np.random.Generator) -> np.ndarray:
    """One texture, columns first."""
    grains = ndimage.gaussian_filter1d(rng.normal(size=(HEIGHT, LENGTH)), SMOOTH_ROWS, axis=0, mode="wrap")
    grains *= np.sqrt(2 * np.sqrt(np.pi) * SMOOTH_ROWS)
    response = _response(np.arange(HEIGHT) - SHARP_ROW, np.fft.rfftfreq(LENGTH))
    rows = fft.irfft(fft.rfft(grains) * response, LENGTH)[:, :WIDTH]
    return np.ascontiguousarray((rows + np.sqrt(NOISE) * rng.normal(size=rows.shape)).T, np.float32)


def _covariance(move_px: float, half_px: int = HALF_PX) -> np.ndarray:
    """Of the texture in a window whose path lies beside the sharp row by so much."""
    place = np.arange(-half_px, half_px + 1)
    response = _response(place + move_px, np.fft.rfftfreq(LENGTH)[BAND.bins(LENGTH)])
    near = np.exp(-((place[:, None] - place) ** 2) / (4 * SMOOTH_ROWS**2))
    return np.einsum("if,jf,ij->fij", response, response, near)


def _change(move_px: float) -> np.ndarray:
    """Its derivative: a row's response H(i) falls by 4 (π f b)² i H(i) a row."""
    place = np.arange(-HALF_PX, HALF_PX + 1) + move_px
    frequency = np.fft.rfftfreq(LENGTH)[BAND.bins(LENGTH)]
    fall = -4 * (np.pi * frequency[:, None] * BLUR_PX_PER_ROW) ** 2 * place
    return _covariance(move_px) * (fall[:, :, None] + fall[:, None, :])


@dataclass(frozen=True)
class Known:
    """What that texture says by both witnesses, Fisher's information of one column, and the second witness' constant."""

    banks: tuple[FilterBank, ...]
    loudness: np.ndarray
    spectra: np.ndarray
    fisher: float
    constant: float


def _bank(form: np.ndarray, spectra: np.ndarray) -> tuple[FilterBank, float]:
    """All that a form has to say, of loudness 1, and how loud it was."""
    rows = form.shape[1]
    filters, sign = strongest_filters(form, spectra, root(spectra), rows - 1)
    np.testing.assert_allclose(
        np.einsum("k,fki,fkj->fij", sign, filters, filters), form, atol=1e-6 * np.abs(form).max(), err_msg="all of it"
    )
    loudness = 2 / LENGTH * np.einsum("fki,fij,fkj->", filters, spectra, filters, optimize=True)
    filters /= np.sqrt(loudness)
    whole = np.eye(rows, dtype=np.float32)
    return FilterBank(whole, filters.astype(np.float32), sign.astype(np.float32), whole), float(loudness)


def _known(move_px: float = 0.0) -> Known:
    inverse = np.linalg.inv(_covariance(move_px) + NOISE * np.eye(2 * HALF_PX + 1))
    spectra = _covariance(move_px, HALF_PX + REACH) + NOISE * np.eye(wide_rows(HALF_PX))
    forms = witness_forms(inverse, _change(move_px), spread_px=0.0)
    banks, loudness = zip(*(_bank(form, spectra) for form in forms), strict=True)
    answer = inverse @ _change(move_px)
    fisher = float(np.einsum("fij,fji->", answer, answer)) / LENGTH
    return Known(banks, np.array(loudness), spectra, fisher, -float(np.einsum("fii->", answer)) / LENGTH)


@pytest.fixture(scope="module")
def known() -> Known:
    return _known()


def _told(picture: np.ndarray, weight: np.ndarray, known: Known, move_px: float = 0.0) -> np.ndarray:
    window = follow(picture, np.full(WIDTH, SHARP_ROW + move_px), HALF_PX)
    return np.array([said(window, weight, bank, band=BAND, length=LENGTH) for bank in known.banks])


def _said(picture: np.ndarray, known: Known, move_px: float = 0.0) -> np.ndarray:
    return _told(picture, np.ones(WIDTH, np.float32), known, move_px)[:, 40:-40]


def _all_said(known: Known) -> np.ndarray:
    """By both witnesses of a hundred textures, each with its path at several places beside the sharp row."""
    rng = np.random.default_rng(12)
    pictures = [_picture(rng) for _ in range(100)]
    moves = MOVE_PX * np.arange(-2, 3)
    told = np.array([[_said(picture, known, move) for move in moves] for picture in pictures])
    return np.ascontiguousarray(told.transpose(2, 0, 1, 3))


def _believed(told: np.ndarray, known: Known) -> np.ndarray:
    """In its own measure, what is said when the temper is 10⁹."""
    return np.asarray(1e9 * (told.T * known.loudness).T)


@pytest.fixture(scope="module")
def both(known: Known) -> np.ndarray:
    return _all_said(known)


@pytest.fixture(params=[0, 1], ids=["first witness", "second witness"])
def heard(both: np.ndarray, request: pytest.FixtureRequest) -> np.ndarray:
    """What one of them said."""
    return np.asarray(both[request.param])


@pytest.fixture(scope="module")
def untempered(known: Known) -> np.ndarray:
    """What both say as long as clusters of grains are believed as the rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(likelihood, "TEMPER", 1e9)
        return _believed(_all_said(known), known)


def _power(told: np.ndarray, weight: np.ndarray | None = None) -> float:
    """Quiet power of one witness in many textures."""
    weight = np.ones(told.shape[-1]) if weight is None else weight
    powers = [quiet_power(one[np.newaxis], weight) for one in told]
    return float(sum(power[0, 0] for power, _ in powers) / sum(size for _, size in powers))


def _answer(told: np.ndarray) -> float:
    return float(told[:, 1].mean() - told[:, 3].mean()) / (2 * MOVE_PX)


def test_a_path_beside_the_stripe_is_told_to_go_back_in_proportion(heard: np.ndarray) -> None:
    mean = heard.mean(axis=(0, 2)) - heard[:, 2].mean()
    slope = (mean[3] - mean[1]) / (2 * MOVE_PX)
    assert slope < 0
    np.testing.assert_allclose(mean, slope * MOVE_PX * np.arange(-2, 3), atol=0.3 * abs(slope) * MOVE_PX)


def test_on_the_stripe_both_sides_are_as_likely(heard: np.ndarray) -> None:
    # the model is symmetric about the sharp row, so is the score, up to chance
    mean, error = heard[:, 2].mean(), heard[:, 2].mean(axis=1).std() / np.sqrt(len(heard))
    assert abs(mean) < 4 * error


def test_what_is_read_from_a_column_is_nearly_all_that_can_be_known(heard: np.ndarray, known: Known) -> None:
    information = _answer(heard)
    columns = heard.shape[2]
    error = heard[:, 2].mean(axis=1) / information
    bound = 1 / np.sqrt(columns * known.fisher)
    # the rows beyond the window add their noise to the derivative; nothing beats the bound but chance
    assert 0.8 < error.std() / bound < 1.7


def test_the_claimed_error_is_the_real_one_or_a_little_more(heard: np.ndarray) -> None:
    information = _answer(heard)
    claimed = np.sqrt(_power(heard[:, 2] - heard[:, 2].mean()) / heard.shape[2]) / information
    assert 0.8 < claimed / (heard[:, 2].mean(axis=1) / information).std() < 1.6


def _true_power(known: Known, one: int, other: int, cycles: float) -> float:
    """What two banks that are believed have in common in a texture, at so many cycles a pixel: E[p q] in pairs of bins."""
    apart = round(cycles * LENGTH)
    bins = len(known.spectra) - apart
    common = [
        known.banks[one].filters[k : k + bins].astype(np.float64)
        @ known.spectra[k : k + bins]
        @ known.banks[other].filters[k : k + bins].transpose(0, 2, 1)
        for k in (0, apart)
    ]
    signs = np.outer(known.banks[one].sign, known.banks[other].sign)
    loudness = known.loudness[one] * known.loudness[other]
    return float(4 / LENGTH * loudness * np.sum(signs * common[0] * common[1]))


def _true_quiet_power(known: Known, one: int, other: int) -> float:
    return float(np.mean([_true_power(known, one, other, cycles) for cycles in np.linspace(*QUIET_BAND, 9)]))


def test_the_second_witness_answers_with_all_that_can_be_known(untempered: np.ndarray, known: Known) -> None:
    second = untempered[1]
    assert _answer(second) == pytest.approx(known.fisher, rel=0.05)
    assert _true_power(known, 1, 1, 0.0) == pytest.approx(known.fisher, rel=1e-3)
    assert _power(second[:, 2]) == pytest.approx(_true_quiet_power(known, 1, 1), rel=0.1)
    # filters differ a little from one end of the quiet band to the other, and have the less in common
    assert 0.75 < _power(second[:, 2]) / known.fisher < 1.1


def test_the_error_of_the_second_witness_is_as_small_as_an_error_can_be(both: np.ndarray, known: Known) -> None:
    pieces = both[1][:, 2].reshape(len(both[1]), 4, -1)
    error = np.std(pieces.mean(axis=2)) / _answer(both[1])
    assert error * np.sqrt(pieces.shape[2] * known.fisher) == pytest.approx(1, abs=0.12)


def test_where_the_texture_is_not_alike_on_both_sides_the_second_witness_has_a_constant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(likelihood, "TEMPER", 1e9)
    rng, known = np.random.default_rng(5), _known(2.5)
    second = _believed(np.array([_said(_picture(rng), known, 2.5) for _ in range(20)]).swapaxes(0, 1), known)[1]
    error = np.sqrt(known.fisher / second.size)
    assert known.constant > 10 * error
    assert second.mean() == pytest.approx(known.constant, abs=4 * error)


def test_both_witnesses_point_the_same_way(both: np.ndarray) -> None:
    first, second = both[:, :, 2].mean(axis=2)
    assert np.corrcoef(first, second)[0, 1] > 0.5
    assert min(_answer(one) for one in both) > 0


def _answers_and_powers(both: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    told = [quiet_power(one, np.ones(one.shape[1])) for one in both[:, :, 2].swapaxes(0, 1)]
    powers = np.sum([power for power, _ in told], axis=0) / np.sum([size for _, size in told])
    return np.array([_answer(one) for one in both]), powers


def test_what_the_first_has_in_common_with_the_score_is_its_answer(untempered: np.ndarray, known: Known) -> None:
    answers, powers = _answers_and_powers(untempered)
    assert _true_power(known, 0, 1, 0.0) == pytest.approx(answers[0], rel=0.05)
    assert powers[0, 1] == pytest.approx(_true_quiet_power(known, 0, 1), rel=0.1)


def test_beside_a_witness_that_knows_all_no_other_is_needed(both: np.ndarray) -> None:
    share = best_shares(*_answers_and_powers(both))
    assert share[1] > 0
    assert abs(share[0]) < 0.1 * share[1]
    together = np.tensordot(share, both, 1)
    errors = [np.std(one[:, 2].mean(axis=1)) / _answer(one) for one in (*both, together)]
    assert errors[2] < 1.02 * min(errors[:2])


def test_a_texture_twice_as_contrasty_says_the_same_with_the_same_model(known: Known) -> None:
    picture = _picture(np.random.default_rng(3))
    # a Gaussian model would believe it four times as much
    for soft, loud in zip(_said(picture, known, 0.5), _said(2 * picture, known, 0.5), strict=True):
        assert loud.mean() / soft.mean() < 2.2
        assert np.corrcoef(soft, loud)[0, 1] > 0.97


def test_columns_without_weight_do_not_speak_into_their_neighbours(known: Known) -> None:
    rng = np.random.default_rng(6)
    picture = _picture(rng)
    valid = np.ones(WIDTH, bool)
    valid[430:520] = False
    weight = softened(valid)
    spoilt = picture.copy()
    spoilt[430:520] += 40 * rng.normal(size=(90, HEIGHT)).astype(np.float32)
    clean, dirty = (_told(one, weight, known) * weight for one in (picture, spoilt))
    np.testing.assert_allclose(dirty / clean.std(axis=1)[:, None], clean / clean.std(axis=1)[:, None], atol=0.02)


def test_witnesses_that_know_nothing_of_each_other_count_by_answer_over_power() -> None:
    answers, powers = np.array([2.0, 0.5]), np.array([7.0, 0.1])
    np.testing.assert_allclose(best_shares(answers, np.diag(powers)), answers / powers, rtol=0.021)


@pytest.mark.parametrize("common", [-0.6, 0.0, 0.4])
def test_witnesses_count_by_what_each_knows_alone(common: float) -> None:
    answers, powers = np.array([1.0, 0.8]), np.array([[1.0, common], [common, 1.0]])
    best = np.array([1.0 - 0.8 * common, 0.8 - common]) / (1 - common**2)
    np.testing.assert_allclose(best_shares(answers, powers), best, rtol=0.06)


@pytest.mark.parametrize(
    ("answer", "common"),
    [(0.0, 0.0), (-0.3, 0.0), (0.0, -0.9), (-0.05, -0.9), (0.1, 0.9)],
    ids=["silent", "contrary", "silent but alike", "contrary but alike", "an echo to be taken off"],
)
@pytest.mark.parametrize("order", [1, -1])
def test_no_witness_counts_that_does_not_answer_or_against_its_own_word(
    answer: float, common: float, order: int
) -> None:
    powers = np.array([[4.0, 2 * common], [2 * common, 1.0]])[::order, ::order]
    share = best_shares(np.array([2.0, answer])[::order], powers)
    np.testing.assert_allclose(share[::order], [0.5, 0.0])


@pytest.mark.parametrize("powers", [np.eye(2), np.zeros((2, 2))])
def test_if_neither_answers_neither_counts(powers: np.ndarray) -> None:
    for answers in ([0.0, 0.0], [-1.0, -2.0], [-1.0, 0.0]):
        np.testing.assert_array_equal(best_shares(np.array(answers), powers), 0)


def test_no_mixture_is_less_precise_than_the_better_witness() -> None:
    rng = np.random.default_rng(10)
    for _ in range(300):
        root = rng.normal(size=(2, 2))
        powers, answers = root @ root.T, rng.normal(0.5, 1, 2)
        share = best_shares(answers, powers)
        assert (share >= 0).all()
        alone = np.max(np.maximum(answers, 0) ** 2 / np.diag(powers))
        if alone > 0:
            assert (share @ answers) ** 2 / (share @ powers @ share) > alone / 1.021


def test_a_weight_is_soft_zero_where_nothing_is_seen_and_one_well_inside() -> None:
    valid = np.ones(300, bool)
    valid[120] = False
    valid[250:] = False
    weight = softened(valid)
    assert (weight[~valid] < 1e-6).all()
    away = np.abs(np.arange(300) - 120)
    np.testing.assert_allclose(weight[(away > 2 * TAPER_PX + 1) & (np.arange(300) < 200)], 1, atol=1e-6)
    assert weight[(away == TAPER_PX)].max() < 0.5
    assert np.abs(np.diff(weight)).max() < 2 / TAPER_PX
    assert (weight >= 0).all()
    assert weight.max() <= 1 + 1e-6


def test_everything_seen_has_weight_one_to_the_very_ends() -> None:
    np.testing.assert_allclose(softened(np.ones(200, bool)), 1, atol=1e-6)
    assert softened(np.zeros(200, bool)).max() == 0


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("often", [2, 20, 120, 1000])
def test_a_weight_between_many_gaps_is_what_is_valid_eroded_and_smoothed(often: int, seed: int) -> None:
    rng = np.random.default_rng([often, seed])
    valid = rng.integers(0, often, 400) > 0
    valid[: rng.integers(0, 3) * 20] = False
    # beyond the ends all is valid as far as erosion goes, and the outermost weight is held by the smoothing
    core = ndimage.minimum_filter1d(np.pad(valid, TAPER_PX, constant_values=True), 2 * TAPER_PX + 1)[TAPER_PX:-TAPER_PX]
    expected = ndimage.convolve1d(core.astype(float), TAPER, mode="nearest")
    np.testing.assert_allclose(softened(valid), expected, atol=1e-6)


@pytest.mark.parametrize("sigma", [0.3, 7.0])
def test_the_quiet_power_of_white_noise_is_its_variance_whatever_is_missing(sigma: float) -> None:
    rng = np.random.default_rng(9)
    valid = np.ones(1200, bool)
    valid[300:480] = False
    weight = 0.5 * softened(valid).astype(np.float64)
    assert _power(sigma * rng.normal(size=(60, 1200)), weight) == pytest.approx(sigma**2, rel=0.06)


def test_the_quiet_power_of_scores_that_agree_is_their_covariance_matrix() -> None:
    rng = np.random.default_rng(9)
    covariance = np.array([[4.0, -1.2], [-1.2, 0.5]])
    noise = np.linalg.cholesky(covariance) @ rng.normal(size=(200, 2, 1200))
    told = [quiet_power(one, np.linspace(0, 1, 1200)) for one in noise]
    found = np.sum([power for power, _ in told], axis=0) / np.sum([size for _, size in told])
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(found / scale, covariance / scale, atol=0.05)


def test_sound_that_paths_have_still_to_follow_is_not_taken_for_noise() -> None:
    rng = np.random.default_rng(9)
    column = np.arange(1200)
    noise = rng.normal(size=(40, 1200))
    music = 3 * np.sin(2 * np.pi * column / 170 + rng.uniform(0, 6, (40, 1)))
    assert _power(noise + music) < 1.3


def test_columns_with_the_usual_texture_are_believed_and_no_others() -> None:
    power = np.mean(np.random.default_rng(1).normal(size=(17, 1000, 2)) ** 2, axis=0)
    assert believable(power, limits=(0.2, 4.0)).all()
    power[200:300, 0] *= 0.01  # a wall that is not there, in noise that is
    power[500:506, 1] *= 144  # a scratch beside what is sharp
    told = believable(power, limits=(0.2, 4.0))
    assert not told[212:288].any()
    assert not told[500:506].any()
    assert told[320:480].all()
    assert told[:180].all()
    assert told[540:].all()


@pytest.mark.parametrize("smooth_px", [1, 7, 25])
@pytest.mark.parametrize("width", [3, 400])
def test_powers_are_judged_by_their_means_over_neighbouring_columns(width: int, smooth_px: int) -> None:
    power = np.random.default_rng(2).exponential(size=(width, 2)).astype(np.float32)
    local = ndimage.uniform_filter1d(power.astype(np.float64), smooth_px, axis=0, mode="nearest")
    limits = (0.9, 1.2)
    assert np.abs(local - limits).min() > 1e-6, "no column is in doubt"
    told = believable(power, limits=limits, smooth_px=smooth_px)
    np.testing.assert_array_equal(told, (local[:, 0] >= limits[0]) & (local[:, 1] <= limits[1]))


def test_what_is_said_is_the_score_over_a_constant_and_the_smoothed_loudness(known: Known) -> None:
    window = follow(_picture(np.random.default_rng(4)), np.full(WIDTH, SHARP_ROW + 0.3), HALF_PX)
    weight = np.ones(WIDTH, np.float32)
    for bank in known.banks:
        score, loudness = bank.heard(window, band=BAND, length=LENGTH)
        local = ndimage.gaussian_filter1d(loudness.astype(np.float64), likelihood.LOUDNESS_PX, mode="nearest")
        told = said(window, weight, bank, band=BAND, length=LENGTH)
        np.testing.assert_allclose(told, score / (likelihood.TEMPER + local), atol=1e-5 * np.abs(told).max())
        assert loudness.mean() == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("gaps", [[], [0], [37], [0, 1, 2], [60, 100], [40, 299]])
def test_a_weight_is_what_is_valid_eroded_and_smoothed(gaps: list[int]) -> None:
    valid = np.ones(300, bool)
    valid[gaps] = False
    core = ndimage.binary_erosion(valid, np.ones(2 * TAPER_PX + 1, bool), border_value=1)
    bell = np.hanning(2 * TAPER_PX + 3)[1:-1]
    smooth = ndimage.convolve1d(core.astype(np.float64), bell / bell.sum(), mode="nearest")
    np.testing.assert_allclose(softened(valid), smooth, atol=1e-6)
