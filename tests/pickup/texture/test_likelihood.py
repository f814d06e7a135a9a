"""The score of a window whose covariance is known: its mean, its power, and how near it comes to what can be known at all.

The texture is white along the groove, smooth over a row or two, and blurred the more the further a row lies from the sharp
one: two rows have the covariance H(i) H(j) ρ(i − j) at every frequency, in closed form.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import fft, ndimage

from gramoscope.pickup.texture.following import follow
from gramoscope.pickup.texture.likelihood import (
    TAPER_PX,
    StripeStatistics,
    believable,
    quiet_power,
    scores,
    softened,
)
from gramoscope.pickup.texture.spectrum import Band

BAND = Band(0.02, 0.35)
HALF_PX, WIDTH, HEIGHT, LENGTH = 8, 1000, 41, 1200
SHARP_ROW = 20.0
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


def _covariance(move_px: float) -> np.ndarray:
    """Of the texture in a window whose path lies beside the sharp row by so much."""
    place = np.arange(-HALF_PX, HALF_PX + 1)
    response = _response(place + move_px, np.fft.rfftfreq(LENGTH)[BAND.bins(LENGTH)])
    near = np.exp(-((place[:, None] - place) ** 2) / (4 * SMOOTH_ROWS**2))
    return np.einsum("if,jf,ij->fij", response, response, near)


@dataclass(frozen=True)
class Known:
    """The model of that texture, and Fisher's information of one column."""

    statistics: StripeStatistics
    fisher: float


@pytest.fixture(scope="module")
def known() -> Known:
    rows = 2 * HALF_PX + 1
    inverse = np.linalg.inv(_covariance(0.0) + NOISE * np.eye(rows))
    change = (_covariance(0.01) - _covariance(-0.01)) / 0.02
    answer = inverse @ change
    fisher = float(np.einsum("fij,fji->", answer, answer)) / LENGTH
    noise = np.full(len(inverse), NOISE, np.float32)
    return Known(
        StripeStatistics(inverse.astype(np.float32), noise, 1.0, 1.0, 0.0, np.ones(rows, np.float32), 1), fisher
    )


def _score(picture: np.ndarray, known: Known, move_px: float = 0.0) -> np.ndarray:
    window, derivative = follow(picture, np.full(WIDTH, SHARP_ROW + move_px), HALF_PX)
    weight = np.ones(WIDTH, np.float32)
    return scores(window, derivative, weight, known.statistics, band=BAND, length=LENGTH)[40:-40]


@pytest.fixture(scope="module")
def heard(known: Known) -> np.ndarray:
    """Scores of fifty textures, each with its path at several places beside the sharp row."""
    rng = np.random.default_rng(12)
    pictures = [_picture(rng) for _ in range(50)]
    moves = MOVE_PX * np.arange(-2, 3)
    return np.array([[_score(picture, known, move) for move in moves] for picture in pictures])


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
    information = (heard[:, 1].mean() - heard[:, 3].mean()) / (2 * MOVE_PX)
    columns = heard.shape[2]
    error = heard[:, 2].mean(axis=1) / information
    bound = 1 / np.sqrt(columns * known.fisher)
    # the rows beyond the window add their noise to the derivative; nothing beats the bound but chance
    assert 0.8 < error.std() / bound < 1.7


def test_the_claimed_error_is_the_real_one_or_a_little_more(heard: np.ndarray) -> None:
    information = (heard[:, 1].mean() - heard[:, 3].mean()) / (2 * MOVE_PX)
    powers = np.sum([quiet_power(score, np.ones(score.size)) for score in heard[:, 2] - heard[:, 2].mean()], axis=0)
    claimed = np.sqrt(powers[0] / powers[1] / heard.shape[2]) / information
    assert 0.8 < claimed / (heard[:, 2].mean(axis=1) / information).std() < 1.6


def test_a_texture_twice_as_contrasty_says_the_same_with_the_same_model(known: Known) -> None:
    picture = _picture(np.random.default_rng(3))
    soft, loud = _score(picture, known, 0.5), _score(2 * picture, known, 0.5)
    # a Gaussian model would believe it four times as much
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
    path = np.full(WIDTH, SHARP_ROW)
    clean, dirty = (
        scores(*follow(one, path, HALF_PX), weight, known.statistics, band=BAND, length=LENGTH) * weight
        for one in (picture, spoilt)
    )
    np.testing.assert_allclose(dirty, clean, atol=0.02 * np.std(clean))


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


@pytest.mark.parametrize("sigma", [0.3, 7.0])
def test_the_quiet_power_of_white_noise_is_its_variance_whatever_is_missing(sigma: float) -> None:
    rng = np.random.default_rng(9)
    valid = np.ones(1200, bool)
    valid[300:480] = False
    weight = 0.5 * softened(valid).astype(np.float64)
    powers = np.sum([quiet_power(sigma * rng.normal(size=1200), weight) for _ in range(60)], axis=0)
    assert powers[0] / powers[1] == pytest.approx(sigma**2, rel=0.06)


def test_sound_that_paths_have_still_to_follow_is_not_taken_for_noise() -> None:
    rng = np.random.default_rng(9)
    column = np.arange(1200)
    noise = rng.normal(size=(40, 1200))
    music = 3 * np.sin(2 * np.pi * column / 170 + rng.uniform(0, 6, (40, 1)))
    powers = np.sum([quiet_power(one, np.ones(1200)) for one in noise + music], axis=0)
    assert powers[0] / powers[1] < 1.3


def test_columns_with_the_usual_texture_are_believed_and_no_others() -> None:
    rng = np.random.default_rng(1)
    power = np.linspace(1, 6, 17).astype(np.float32)
    window = (np.sqrt(power)[:, None] * rng.normal(size=(17, 1000))).astype(np.float32)
    assert believable(window, power, limits=(0.2, 4.0)).all()
    window[:, 200:300] *= 0.1  # a wall that is not there
    window[:, 500:506] *= 12  # a scratch
    told = believable(window, power, limits=(0.2, 4.0))
    assert not told[212:288].any()
    assert not told[500:506].any()
    assert told[320:480].all()
    assert told[:180].all()
    assert told[540:].all()
