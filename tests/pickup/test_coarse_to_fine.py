"""Flow between two pictures: motion that is known, kernels against their references, invariances, bad input."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow.coarse_to_fine import CoarseToFine, common_shift_px
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.pickup.flow.motion_tensor import flow_of_cells, motion_tensor, motion_tensor_reference
from gramoscope.pickup.flow.picture_pyramid import halved, picture_pyramid, smoothed

SHAPE = (128, 192)
INSIDE = np.s_[16:-16, 16:-16]


def _texture(seed: int = 3, grain_px: float = 1.5, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=shape), grain_px, mode="wrap")
    return 110 + 35 * field / field.std()


def _pair(u: np.ndarray | float, v: np.ndarray | float, *, grain_px: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """I₂(x + w(x)) = I₁(x)."""
    texture = _texture(grain_px=grain_px)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    first = ndimage.map_coordinates(texture, [row + v, column + u], order=5, mode="grid-wrap")
    return tuple(np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (first, texture))


def _error(flow: Flow, u: np.ndarray | float, v: np.ndarray | float) -> np.ndarray:
    return np.hypot(flow.u - u, flow.v - v)


@pytest.mark.parametrize(("u", "v"), [(0.0, 0.0), (0.3, -0.7), (3.6, 1.2), (-11.3, 7.8)])
def test_a_picture_that_moves_as_a_whole_is_followed(u: float, v: float) -> None:
    error = _error(CoarseToFine().flow(*_pair(u, v, grain_px=2.5)), u, v)
    assert error[INSIDE].mean() < 0.02
    assert error[INSIDE].max() < 0.1


@pytest.mark.parametrize(("down", "along"), [(0, 0), (5, -12), (-7, 30), (0, 90)])
def test_the_common_shift_is_found(down: int, along: int) -> None:
    wide = _texture(shape=(200, 400)).astype(np.float32)
    first, second = wide[40:168, 100:292], wide[40 - down : 168 - down, 100 - along : 292 - along]
    assert common_shift_px(first, second) == (down, along)
    assert common_shift_px(first, np.full_like(first, 7)) == (0, 0)


def test_an_affine_flow_is_followed() -> None:
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    u, v = 1.3 + 0.01 * (column - 96) - 0.006 * (row - 64), -0.4 + 0.008 * (row - 64)
    error = _error(CoarseToFine(looks=2).flow(*_pair(u, v)), u, v)
    assert error[INSIDE].mean() < 0.03


def test_a_darker_lamp_changes_nothing_that_matters() -> None:
    first, second = _pair(2.4, -1.1)
    dim = np.rint(second * 0.9).astype(np.uint8)
    error = [_error(CoarseToFine().flow(first, p), 2.4, -1.1)[INSIDE].mean() for p in (second, dim)]
    assert error[1] < 1.2 * error[0] + 0.005


def test_a_flat_picture_does_not_flow() -> None:
    for level in (0, 90, 255):
        flat = np.full((50, 70), level, np.uint8)
        flow = CoarseToFine().flow(flat, flat)
        assert not flow.u.any()
        assert not flow.v.any()
    flow = CoarseToFine().flow(np.zeros((50, 70), np.uint8), np.full((50, 70), 90, np.uint8))
    assert np.isfinite(flow.u).all()


def test_a_mirrored_or_turned_pair_has_a_mirrored_or_turned_flow() -> None:
    first, second = _pair(2.4, -1.1)
    method = CoarseToFine(rounds=2)
    flow = method.flow(first, second)
    mirrored = method.flow(*(np.ascontiguousarray(p[:, ::-1]) for p in (first, second)))
    np.testing.assert_allclose(mirrored.u[:, ::-1], -flow.u, atol=2e-3)
    np.testing.assert_allclose(mirrored.v[:, ::-1], flow.v, atol=2e-3)
    turned = method.flow(*(np.ascontiguousarray(p.T) for p in (first, second)))
    np.testing.assert_allclose(turned.u.T, flow.v, atol=2e-3)
    np.testing.assert_allclose(turned.v.T, flow.u, atol=2e-3)


def test_a_start_that_is_near_is_as_good_as_the_long_way() -> None:
    first, second = _pair(-11.3, 7.8, grain_px=2.5)
    near = Flow(np.full(SHAPE, -10.5, np.float32), np.full(SHAPE, 7.2, np.float32))
    error = _error(CoarseToFine().flow(first, second, start=near), -11.3, 7.8)
    assert error[INSIDE].mean() < 0.02
    nothing = Flow(*np.zeros((2, *SHAPE), np.float32))
    assert _error(CoarseToFine().flow(first, second, start=nothing), -11.3, 7.8)[INSIDE].mean() > 1


def test_inputs_stay_as_they_are_and_sixteen_bits_do() -> None:
    first, second = _pair(0.3, -0.7)
    kept = first.copy(), second.copy()
    flow = CoarseToFine().flow(first, second)
    np.testing.assert_array_equal(first, kept[0])
    np.testing.assert_array_equal(second, kept[1])
    deep = CoarseToFine().flow(first.astype(np.uint16), second.astype(np.uint16))
    np.testing.assert_array_equal(deep.u, flow.u)


def test_bad_input_is_refused() -> None:
    first, second = _pair(0.0, 0.0)
    with pytest.raises(ArgumentError, match="same shape"):
        CoarseToFine().flow(first, second[:-1])
    with pytest.raises(ArgumentError, match="at least 8"):
        CoarseToFine().flow(first[:7], second[:7])
    with pytest.raises(ArgumentError, match="same shape"):
        CoarseToFine().flow(first, second, start=Flow(*np.zeros((2, 3, 3), np.float32)))
    for settings in (
        {"alpha": 0.0},
        {"robust_levels": 0.0},
        {"edge_px": -1.0},
        {"cell_px": 0},
        {"looks": 0},
        {"rounds": 0},
    ):
        with pytest.raises(ArgumentError):
            CoarseToFine(**settings)


@pytest.mark.parametrize("shape", [(8, 9), (37, 50)])
@pytest.mark.parametrize("cell_px", [1, 3, 4])
def test_the_motion_tensor_agrees_with_its_reference(shape: tuple[int, int], cell_px: int) -> None:
    rng = np.random.default_rng(5)
    first, second = (_texture(seed, shape=shape).astype(np.float32) for seed in (1, 2))
    cells = tuple(-(-size // cell_px) for size in shape)
    u, v = rng.normal(0, 3, (2, *cells)).astype(np.float32)
    fast = motion_tensor(first, second, u, v, cell_px=cell_px, scale=12.0)
    slow = motion_tensor_reference(first, second, u, v, cell_px=cell_px, scale=12.0)
    for a, b in zip(fast, slow, strict=True):
        # a pixel on the very edge of what is seen may fall to either side
        off = np.abs(a - b) > 1e-3 * np.abs(b).max()
        assert off.mean() < 0.002


def test_flow_between_cells_is_linear_and_constant_beyond() -> None:
    field = np.arange(5, dtype=np.float32)[None, :] * np.ones((3, 1), np.float32)
    out = flow_of_cells(field, (12, 20), cell_px=4)
    np.testing.assert_allclose(out[5], np.clip((np.arange(20) + 0.5) / 4 - 0.5, 0, 4), atol=1e-6)


def test_a_plane_stays_a_plane_in_the_pyramid() -> None:
    row, column = np.mgrid[:40, :56]
    plane = (2 * row + 3 * column).astype(np.uint8)
    small, smaller = picture_pyramid(plane, levels=3)[1:]
    for picture, step in ((small, 2), (smaller, 4)):
        middle = [step * np.arange(size) + (step - 1) / 2 for size in picture.shape]
        expected = 2 * middle[0][:, None] + 3 * middle[1]
        np.testing.assert_allclose(picture[3:-3, 3:-3], expected[3:-3, 3:-3], atol=1e-3)


def test_the_pyramid_agrees_with_its_kernels() -> None:
    image = np.random.default_rng(6).integers(0, 256, (11, 14)).astype(np.uint8)
    expected = image.astype(float)
    for axis in (0, 1):
        expected = ndimage.correlate1d(expected, np.array([1, 2, 1]) / 4, axis=axis, mode="nearest")
    np.testing.assert_allclose(smoothed(image), expected, rtol=1e-6)
    for axis in (0, 1):
        wide = ndimage.correlate1d(expected, np.array([1, 3, 3, 1]) / 8, axis=axis, mode="nearest", origin=-1)
        expected = wide.take(range(0, expected.shape[axis], 2), axis)
    assert halved(smoothed(image)).shape == (6, 7)
    np.testing.assert_allclose(halved(smoothed(image)), expected, rtol=1e-5)
