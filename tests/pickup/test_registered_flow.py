"""The common motion and what remains of it."""

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow.horn_schunck import HornSchunck
from gramoscope.pickup.flow.registered_flow import common_step_px, registered_flow

HEIGHT, WIDTH = 47, 131


def _film(frames: int, *, step_px: float, stretch: float = 0.0, seed: int = 3) -> np.ndarray:
    """A texture that moves to smaller columns by step + stretch · column, seen from the middle frame."""
    rng = np.random.default_rng(seed)
    texture = ndimage.gaussian_filter(rng.normal(0, 1, (HEIGHT, WIDTH + 200)), 2.0)
    texture = 120 + 30 * texture / texture.std()
    row, column = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    pictures = []
    for k in range(frames):
        place = column + (k - frames // 2) * (step_px + stretch * column)
        pictures.append(ndimage.map_coordinates(texture, [row, place + 80], order=3))
    return np.clip(np.round(pictures), 0, 255).astype(np.uint8)


def test_the_common_step_is_found_from_nothing_and_from_a_guess() -> None:
    film = _film(5, step_px=1.63)
    assert common_step_px(film) == pytest.approx(1.63, abs=0.01)
    assert common_step_px(film, expected_px=2.5) == pytest.approx(1.63, abs=0.01)


def test_frames_without_texture_keep_what_was_expected() -> None:
    assert common_step_px(np.full((4, HEIGHT, WIDTH), 77, np.uint8), expected_px=1.3) == 1.3


@pytest.mark.parametrize("frames", [2, 7])
def test_the_whole_flow_is_that_of_the_texture(frames: int) -> None:
    film = _film(frames, step_px=1.63)
    flow = registered_flow(film, method=HornSchunck(0.5, 100), smoothing_px=1.0)
    assert flow.u.shape == flow.v.shape == (HEIGHT, WIDTH)
    # two frames rounded to whole grey levels are off by up to 0.12 here and there
    assert np.abs(flow.u[5:-5, 12:-12] + 1.63).mean() < 0.02
    assert np.abs(flow.v[5:-5, 12:-12]).mean() < 0.02


def test_a_stretching_texture_is_followed_in_the_coordinates_of_the_middle_frame() -> None:
    stretch = 0.006
    flow = registered_flow(_film(7, step_px=1.2, stretch=stretch), method=HornSchunck(0.5, 200), smoothing_px=1.0)
    column = np.arange(WIDTH)[15:-15]
    # 0.02 px is what a window 3.5 columns off would cost
    np.testing.assert_allclose(flow.u[8:-8, 15:-15].mean(axis=0), -(1.2 + stretch * column), atol=0.03)
    assert flow.u[8:-8, 15:-15].mean() == pytest.approx(-(1.2 + stretch * column).mean(), abs=0.004)


def test_relative_weights_make_the_flow_independent_of_the_contrast() -> None:
    film = _film(4, step_px=1.63)
    pale = (film.astype(np.uint16) * 16).astype(np.uint16)
    a, b = (
        registered_flow(f, method=HornSchunck(0.5, 60), smoothing_px=1.0, relative_weights=True) for f in (film, pale)
    )
    np.testing.assert_allclose(a.u, b.u, atol=2e-4)


def test_a_single_frame_is_refused() -> None:
    with pytest.raises(ArgumentError, match="two or more"):
        registered_flow(np.zeros((1, HEIGHT, WIDTH), np.uint8), method=HornSchunck(), smoothing_px=1.0)
