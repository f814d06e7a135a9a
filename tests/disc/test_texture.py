"""The texture is one and the same record, with the statistics that it claims."""

import numpy as np
import pytest

from gramoscope.disc.texture import ACROSS, POLISHED, POWDER, SHELLAC, Texture, sample_across

PITCH_M = 0.5e-3 / 1280


def test_any_stretch_shows_the_same_record() -> None:
    whole = POWDER.field(-300, 700, pitch_m=PITCH_M, seed=3)
    part = POWDER.field(-47, 210, pitch_m=PITCH_M, seed=3)
    np.testing.assert_array_equal(part, whole[:, 253:463])


def test_another_seed_is_another_record() -> None:
    one, other = (POWDER.field(5, 300, pitch_m=PITCH_M, seed=seed) for seed in (3, 4))
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("texture", [POWDER, SHELLAC, POLISHED])
def test_mean_and_contrast_are_as_stated(texture: Texture) -> None:
    field = texture.field(11, 1500, pitch_m=PITCH_M, seed=1)
    assert field.shape == (ACROSS, 1500)
    assert field.mean() == pytest.approx(1, abs=0.01 * texture.contrast)
    assert field.std() == pytest.approx(texture.contrast, rel=0.02)


@pytest.mark.parametrize("axis", [0, 1])
def test_grains_have_their_size_along_and_across_and_wrap_around(axis: int) -> None:
    # nearly Gaussian, so that the correlation at a lag d is exp(−d²/4σ²)
    texture = Texture(grain_m=1.3e-6, contrast=0.2, skewness=0.01)
    field = texture.field(11, ACROSS, pitch_m=PITCH_M, seed=1) - 1
    sigma_px = 1.3e-6 / PITCH_M / np.sqrt(8 * np.log(2))
    for lag in (1, 2, 3):
        shifted = np.roll(field, lag, axis=0) if axis == 0 else field
        pair = (field, shifted) if axis == 0 else (field[:, lag:], field[:, :-lag])
        expected = np.exp(-(lag**2) / (4 * sigma_px**2))
        assert np.mean(pair[0] * pair[1]) / field.var() == pytest.approx(expected, abs=0.01)


def test_looking_up_between_texels_passes_through_them() -> None:
    field = SHELLAC.field(0, 60, pitch_m=PITCH_M, seed=2)
    rows = np.arange(60) * 7 - 200
    on = sample_across(field, rows * PITCH_M, pitch_m=PITCH_M)
    np.testing.assert_allclose(on, field[rows + ACROSS // 2, np.arange(60)], atol=1e-5)
    far = sample_across(field, (rows + ACROSS) * PITCH_M, pitch_m=PITCH_M)
    np.testing.assert_allclose(far, on, atol=1e-5)
