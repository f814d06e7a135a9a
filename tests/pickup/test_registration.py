"""Frames laid over each other: interpolation, the shifts between them, their mean and their trend."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Sequence
from gramoscope.pickup.flow.derivatives import group_derivatives
from gramoscope.pickup.registration import (
    Canvas,
    cubic_taps,
    frame_shifts,
    pair_shift_px,
    quintic_taps,
    register,
    textured_rows,
)
from gramoscope.signal_path import FrameGroup
from gramoscope.simulation.render import cut_passage, filmed_group, render_group
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene, filming_bench

PITCH_M = 0.4e-6
SOUND = np.sin(2 * np.pi * 910 * np.arange(4800) / 48_000 + 0.3)


def _texture(seed: int = 3, *, rows: int = 37, waves: int = 60) -> Callable[[np.ndarray], np.ndarray]:
    """A picture known at every place between the pixels: a sum of waves of random phase in each row."""
    rng = np.random.default_rng(seed)
    frequency = np.abs(rng.normal(0, 0.7, (rows, waves)))
    phase = rng.uniform(0, 2 * np.pi, (rows, waves))

    def at(columns: np.ndarray) -> np.ndarray:
        angle = frequency[:, :, None] * columns[None, None, :] + phase[:, :, None]
        return 4.0 * np.sqrt(30 / waves) * np.cos(angle).sum(axis=1)

    return at


def _film(shift_px: np.ndarray, *, width: int = 211, noise: float = 0.0, seed: int = 3, rows: int = 37) -> np.ndarray:
    texture, rng = _texture(seed, rows=rows), np.random.default_rng(seed + 1)
    frames = np.array([texture(np.arange(width) + d) for d in shift_px])
    # 16 bit and a factor of a hundred keep the rounding out of the way
    return np.rint(100 * (120 + frames + noise * rng.normal(size=frames.shape))).clip(0).astype(np.uint16)


def _group(images: np.ndarray, *, step_px: float) -> FrameGroup:
    frames = images.shape[0]
    return FrameGroup(
        number=5,
        images=images,
        arc_start_m=7e-3 + np.arange(frames) * step_px * PITCH_M,
        stage_m=np.zeros(frames),
        pixel_pitch_m=PITCH_M,
        white_level=65_535,
        valid=np.ones(frames, bool),
    )


@pytest.mark.parametrize("fraction", [0.0, 0.13, 0.5, 0.86, 1.0])
def test_cubic_taps_reproduce_parabolas(fraction: float) -> None:
    taps, nodes = np.array(cubic_taps(fraction)), np.arange(-1, 3)
    for degree in range(3):
        assert taps @ nodes.astype(float) ** degree == pytest.approx(fraction**degree, abs=1e-14)
    # Catmull and Rom's spline is exact to the second degree only: x³ comes out wrong by f (2f − 1)(f − 1)
    assert taps @ nodes**3 - fraction**3 == pytest.approx(fraction * (2 * fraction - 1) * (fraction - 1), abs=1e-14)


@pytest.mark.parametrize("fraction", [0.0, 0.13, 0.5, 0.86, 1.0])
def test_quintic_taps_reproduce_polynomials_up_to_the_fifth_degree(fraction: float) -> None:
    taps, nodes = np.array(quintic_taps(fraction)), np.arange(-2, 4)
    for degree in range(6):
        assert taps @ nodes.astype(float) ** degree == pytest.approx(fraction**degree, abs=1e-13)


@pytest.mark.parametrize("shift_px", [0.0, 0.3, 2.0, 2.05, 2.31, 2.56, 2.8, 7.2])
def test_a_shift_between_two_frames_is_found_without_bias(shift_px: float) -> None:
    images = _film(np.array([0.0, shift_px]), rows=60)
    found = pair_shift_px(images[0], images[1], expected_px=max(shift_px - 0.7, 0.0), rows=np.arange(60))
    assert found == pytest.approx(shift_px, abs=0.002)


def test_camera_noise_does_not_bias_a_shift() -> None:
    errors = []
    for seed in range(12):
        images = _film(np.array([0.0, 2.3]), noise=4.0, seed=seed)
        errors.append(pair_shift_px(images[0], images[1], expected_px=2.1, rows=np.arange(37)) - 2.3)
    assert np.std(errors) < 0.012
    assert abs(np.mean(errors)) < 3 * np.std(errors) / np.sqrt(12)


def test_a_shift_beyond_reach_is_not_believed() -> None:
    # waves so long that the search would arrive
    phase, column = np.arange(11)[:, None], np.arange(200)[None, :]
    here, there = (np.rint(900 + 500 * np.cos((column + d) / 9 + phase)).astype(np.uint16) for d in (0.0, 5.3))
    rows = np.arange(11)
    assert pair_shift_px(here, there, expected_px=2.1, rows=rows, reach_px=3.3) == pytest.approx(5.3, abs=0.01)
    assert np.isnan(pair_shift_px(here, there, expected_px=2.1, rows=rows, reach_px=3.1))
    assert np.isnan(pair_shift_px(there, here, expected_px=0.4, rows=rows, reach_px=9.0)), (
        "the record does not turn back"
    )


def test_uneven_steps_are_found_one_by_one() -> None:
    steps = 2.1 * (1 + 0.08 * np.array([0.9, -1.1, 0.2, 1.3, -0.6]))
    shift_px, step_m = frame_shifts(_group(_film(np.concatenate([[0.0], np.cumsum(steps)]), noise=2.0), step_px=2.1))
    np.testing.assert_allclose(step_m / PITCH_M, steps, atol=0.012)
    np.testing.assert_allclose(shift_px, np.concatenate([[0.0], np.cumsum(steps)]), atol=0.02)


def test_a_lost_frame_leaves_a_hole_and_the_others_in_their_places() -> None:
    true_px = np.array([0.0, 2.2, 4.1, 6.3, 8.6])
    images = _film(true_px)
    images[2] = 0
    group = replace(_group(images, step_px=2.1), valid=np.array([True, True, False, True, True]))
    shift_px, step_m = frame_shifts(group)
    np.testing.assert_allclose(shift_px, true_px[[0, 1, 3, 4]], atol=0.01)
    np.testing.assert_array_equal(np.isnan(step_m), [False, True, True, False])


def test_where_nothing_can_be_seen_the_nominal_step_stands_in() -> None:
    images = np.random.default_rng(1).integers(90, 110, (3, 31, 90)).astype(np.uint16)
    shift_px, step_m = frame_shifts(_group(images, step_px=2.1))
    lost = np.isnan(step_m)
    assert lost.any()
    np.testing.assert_allclose(np.diff(shift_px)[lost], 2.1)


def test_a_rendered_groove_gives_its_true_steps() -> None:
    bench = replace(
        filming_bench(height_px=430),
        sequence=Sequence(groups=2, frames_per_group=6, frame_step_m=0.87e-6, group_step_m=400e-6),
    )
    scene = Scene(bench, rig=Rig(frame_step_share=0.08), seed=2)
    filmed, pitch_m = filmed_group(scene, 1), bench.sensor.pixel_pitch_m
    images = render_group(scene, cut_passage(SOUND, rate_hz=48_000.0, scene=scene), 1)
    group = replace(_group(images, step_px=1.0), arc_start_m=filmed.nominal_start_m, pixel_pitch_m=pitch_m)
    error_px = (frame_shifts(group)[1] - np.diff(filmed.arc_start_m)) / pitch_m
    nominal_error_px = (0.87e-6 - np.diff(filmed.arc_start_m)) / pitch_m
    assert np.abs(error_px).max() < 0.01
    assert abs(error_px.mean()) < 0.003
    assert np.abs(nominal_error_px).max() > 0.1


def test_rows_with_texture_are_told_from_rows_with_noise_alone() -> None:
    # the noise has nearly as much power as the texture
    image = np.random.default_rng(4).normal(120, 14, (80, 1100))
    image[31:44] += _texture(rows=13)(np.arange(1100))
    np.testing.assert_array_equal(textured_rows(image.clip(0).astype(np.uint8)), np.arange(31, 44))


def test_frames_that_show_the_same_have_their_mean_and_no_trend() -> None:
    picture = np.random.default_rng(5).integers(20, 230, (13, 58)).astype(np.uint8)
    canvas = register(np.repeat(picture[None], 4, axis=0), np.zeros(4), np.arange(4))
    np.testing.assert_array_equal(canvas.frames[1:-2], 4)
    np.testing.assert_array_equal(canvas.mean[:, 1:-2], picture[:, 1:-2])
    np.testing.assert_allclose(canvas.trend, 0, atol=2e-4)


def test_whole_shifts_lay_frames_exactly_over_each_other() -> None:
    record = np.random.default_rng(6).integers(20, 230, (13, 80)).astype(np.uint8)
    shift_px = np.array([0.0, 2.0, 5.0, 9.0])
    images = np.array([record[:, int(d) : int(d) + 60] for d in shift_px])
    canvas = register(images, shift_px, np.arange(4))
    assert canvas.mean.shape == (13, 69)
    covered = canvas.frames > 0
    np.testing.assert_allclose(canvas.mean[:, covered], record[:, :69][:, covered], atol=1e-4)
    np.testing.assert_allclose(canvas.trend, 0, atol=2e-4)


def test_columns_that_no_frame_covers_repeat_their_neighbour() -> None:
    canvas = register(_film(np.array([0.0, 3.0])), np.array([0.0, 3.0]), np.arange(2))
    np.testing.assert_array_equal(canvas.frames[[0, -1]], 0)
    np.testing.assert_array_equal(canvas.mean[:, 0], canvas.mean[:, 1])
    np.testing.assert_array_equal(canvas.mean[:, -1], canvas.mean[:, -3])


def _fading() -> Canvas:
    """Frames 0, 1, 3 and 4 of a picture that gets brighter by 3 levels a frame while it moves."""
    number = np.array([0, 1, 3, 4])
    shift_px = 2.0 * number
    record = np.random.default_rng(7).integers(20, 200, (13, 90)).astype(np.uint8)
    images = np.array([record[:, 2 * k : 2 * k + 70] + 3 * k for k in number]).astype(np.uint8)
    return register(images, shift_px, number)


def test_a_picture_that_brightens_has_that_trend_even_with_a_frame_missing() -> None:
    canvas = _fading()
    np.testing.assert_allclose(canvas.trend[:, canvas.frames >= 2], 3.0, atol=1e-3)
    np.testing.assert_array_equal(canvas.trend[:, canvas.frames < 2], 0.0)
    assert (canvas.frames < 2).any()


def test_the_trend_of_a_wrong_motion_is_the_gradient_times_the_mistake() -> None:
    true_px, assumed_px = 2.1 * np.arange(6), 2.0 * np.arange(6)
    derivatives = group_derivatives(register(_film(true_px), assumed_px, np.arange(6)), smoothing_px=1.0)
    inner = slice(20, 180)
    gradient, trend = derivatives.x[:, inner], derivatives.t[:, inner]
    assert (gradient * trend).sum() / (gradient**2).sum() == pytest.approx(0.1, rel=0.05)
