"""What is in focus: sharp texture that moves as the record moves, and not dirt, blur or noise."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.pickup.flow.derivatives import Derivatives, group_derivatives, texture_contrast
from gramoscope.pickup.flow.horn_schunck import Flow, HornSchunck
from gramoscope.pickup.in_focus import InFocus
from gramoscope.pickup.registration import register

STRIPE = slice(61, 72)
DIRT = (slice(62, 71), slice(128, 148))
"""A speck right on the stripe."""
STEP_PX = 2


def _film(*, dirt: bool) -> np.ndarray:
    """Five frames of a stripe of texture that moves by two columns a frame, under a window with a speck of dirt."""
    rng = np.random.default_rng(3)
    record = 110 + rng.normal(0, 1.5, (121, 330))
    record[STRIPE] += np.apply_along_axis(np.convolve, 1, rng.normal(0, 20, (11, 330)), [0.3, 0.4, 0.3], "same")
    frames = np.array([record[:, STEP_PX * k : STEP_PX * k + 311] for k in range(5)])
    if dirt:
        speck = rng.normal(0, 35, (9, 20))
        frames[:, *DIRT] = 80 + speck
    return frames.clip(0, 255).astype(np.uint8)


def _seen(images: np.ndarray) -> tuple[Derivatives, Flow]:
    canvas = register(images, STEP_PX * np.arange(5.0), np.arange(5))
    derivatives = group_derivatives(canvas, smoothing_px=1.0)
    scaled = derivatives.scaled(1 / texture_contrast(derivatives.x))
    return scaled, HornSchunck(alpha=0.5, iterations=100).flow(scaled)


def test_the_stripe_is_in_focus_and_the_blurred_rest_is_not() -> None:
    mask = InFocus().mask(*_seen(_film(dirt=False)))
    assert mask[STRIPE, 10:-10].mean() > 0.3
    assert mask[:50].mean() < 0.01
    assert mask[85:].mean() < 0.01


def test_dirt_that_stands_still_is_no_texture_of_the_record() -> None:
    derivatives, flow = _seen(_film(dirt=True))
    # laid over the record's motion the dirt slides backwards by the step, over columns 128 … 156
    spot = (slice(63, 70), slice(132, 150))
    with_flow, without = InFocus().mask(derivatives, flow)[spot].mean(), InFocus().mask(derivatives, None)[spot].mean()
    # by sharpness alone the dirt passes for texture
    assert without > 0.2
    assert with_flow < 0.4 * without
    assert np.abs(flow.u[spot]).mean() > 0.5


def test_what_moves_across_the_groove_is_not_the_record() -> None:
    derivatives, flow = _seen(_film(dirt=False))
    across = Flow(np.zeros_like(flow.u), np.full_like(flow.v, -0.6))
    assert not InFocus().mask(derivatives, across).any()
    assert InFocus(flow_tolerance_px=0.7).mask(derivatives, across).any()


def test_camera_noise_alone_is_hardly_ever_in_focus() -> None:
    rng = np.random.default_rng(4)
    images = (110 + rng.normal(0, 12, (5, 121, 311))).astype(np.uint8)
    assert InFocus().mask(*_seen(images)).mean() < 5e-3


def test_points_are_in_focus_at_the_share_of_contrast_that_is_asked() -> None:
    x = np.zeros((40, 41), np.float32)
    x[7], x[9] = 0.59, -0.61
    derivatives = Derivatives(x, np.zeros_like(x), np.zeros_like(x))
    mask = InFocus(contrast_share=0.6).mask(derivatives, None)
    assert mask[9].all()
    assert mask.sum() == 41
    # against a background everywhere as strong as a fifth of the contrast nothing weaker than the contrast itself counts
    noisy = replace(derivatives, x=np.where(x == 0, np.float32(0.13), x))
    assert not InFocus(background_share=5.0).mask(noisy, None).any()


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_more_light_changes_nothing(gain: float) -> None:
    images = _film(dirt=False).astype(np.uint16) * 100
    mask = InFocus().mask(*_seen(images))
    bright = InFocus().mask(*_seen((images * gain).astype(np.uint16)))
    assert (mask != bright).mean() < 1e-3
