"""The sensor's noise: moments, quantisation, and independence of everything but the seed."""

import numpy as np
import pytest

from gramoscope.camera.noise import NORMAL, SensorNoise
from gramoscope.errors import ArgumentError


def _expose(share: float, *, white_level: int = 65535, seed: int = 3, **noise: float) -> np.ndarray:
    light = np.full((300, 410), share, np.float32)
    return SensorNoise(**noise).expose(light, white_level=white_level, seed=seed)


@pytest.mark.parametrize("electrons", [8.0, 100.0, 3000.0])
def test_photon_noise_has_the_moments_of_poisson(electrons: float) -> None:
    picture = _expose(0.4, full_well_electrons=electrons / 0.4, read_electrons=0.0) * (electrons / 0.4 / 65535)
    assert picture.mean() == pytest.approx(electrons, rel=0.005)
    assert picture.var() == pytest.approx(electrons, rel=0.02)
    skewness = np.mean((picture - picture.mean()) ** 3) / picture.std() ** 3
    assert skewness == pytest.approx(1 / np.sqrt(electrons), abs=0.03)


def test_read_noise_adds_in_quadrature() -> None:
    picture = _expose(0.3, full_well_electrons=4000.0, read_electrons=50.0) * (4000 / 65535)
    assert picture.std() == pytest.approx(np.sqrt(0.3 * 4000 + 50**2), rel=0.01)


def test_the_deviates_are_standard_normal_and_neighbours_do_not_know_each_other() -> None:
    assert NORMAL.mean() == pytest.approx(0, abs=1e-6)
    assert NORMAL.std() == pytest.approx(1, rel=1e-5)
    picture = _expose(0.5).astype(float) - 0.5 * 65535
    for shifted in (picture[:, 1:], picture[1:]):
        pair = picture[: shifted.shape[0], : shifted.shape[1]]
        assert abs(np.mean(pair * shifted) / picture.var()) < 0.012


def test_every_seed_is_a_frame_of_its_own_and_always_the_same() -> None:
    np.testing.assert_array_equal(_expose(0.4, seed=9), _expose(0.4, seed=9))
    one, other = _expose(0.4, seed=9), _expose(0.4, seed=10)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.012


@pytest.mark.parametrize(("white_level", "dtype"), [(255, np.uint8), (4095, np.uint16)])
def test_pixels_end_at_black_and_white(white_level: int, dtype: type) -> None:
    bright, dark = _expose(7.0, white_level=white_level), _expose(np.nan, white_level=white_level)
    assert bright.dtype == dtype
    assert bright.min() == bright.max() == white_level
    assert dark.max() == 0


def test_an_eight_bit_picture_of_the_usual_brightness_has_about_two_and_a_half_levels_of_noise() -> None:
    assert _expose(95 / 255, white_level=255).std() == pytest.approx(2.5, abs=0.2)


def test_an_impossible_sensor_is_refused() -> None:
    with pytest.raises(ArgumentError):
        SensorNoise(full_well_electrons=0)
    with pytest.raises(ArgumentError):
        SensorNoise(read_electrons=-1)
