"""Pictures laid on each other: known shifts come back, and what does not match is not believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import fourier_shift, gaussian_filter

from gramoscope.signal_path import StillPicture
from gramoscope.tonearm.stitch import Stitch

ROWS, COLUMNS, STEP = 70, 240, 160
PITCH_M = 2.5e-6


def picture(image: np.ndarray, number: int = 0, step_px: float = STEP) -> StillPicture:
    return StillPicture(
        number=number,
        image=np.clip(np.rint(image), 0, 255).astype(np.uint8),
        arc_start_m=number * step_px * PITCH_M,
        lateral_start_m=0.0,
        pixel_pitch_m=PITCH_M,
        white_level=255,
        seen=np.ones(image.shape, np.bool_),
    )


def surface(seed: int = 2) -> np.ndarray:
    """Land and groove from side to side, with grain: what runs along the groove must not fool the match."""
    rng = np.random.default_rng(seed)
    grain = gaussian_filter(rng.standard_normal((ROWS + 40, 600)), 1.2)
    land = np.where((np.arange(ROWS + 40) // 22) % 2 == 0, 150.0, 70.0)[:, None]
    return gaussian_filter(land + 30 * grain / grain.std(), 0.8)


def pair(shift_px: float, row_px: float, noise: float = 1.0) -> tuple[StillPicture, StillPicture]:
    """Two pictures of a surface; the second starts `STEP` + shift further along and shows everything `row_px` lower."""
    rng = np.random.default_rng(7)
    whole = surface()
    moved = np.fft.ifft2(fourier_shift(np.fft.fft2(whole), (row_px, -shift_px))).real
    first, second = whole[20:-20, 50 : 50 + COLUMNS], moved[20:-20, 50 + STEP : 50 + STEP + COLUMNS]
    return tuple(
        picture(image + noise * rng.standard_normal(image.shape), number)
        for number, image in enumerate((first, second))
    )


@pytest.mark.parametrize(("shift_px", "row_px"), [(0.0, 0.0), (0.37, -0.21), (-6.44, 3.5), (11.25, -7.8)])
def test_known_shifts_come_back_to_a_twentieth_of_a_pixel(shift_px: float, row_px: float) -> None:
    before, after = pair(shift_px, row_px)
    stitch = Stitch()
    match = stitch.match(stitch.texture(before, STEP - 24, COLUMNS), stitch.texture(after, 0, COLUMNS - STEP + 24))
    assert match.error_m / PITCH_M == pytest.approx(shift_px, abs=0.05)
    # everything lies lower in the second picture by so much, so the picture itself starts higher
    assert match.row_error_m / PITCH_M == pytest.approx(row_px, abs=0.05)
    assert match.correlation > 0.9


def test_other_surfaces_are_not_believed() -> None:
    before, _ = pair(0.0, 0.0)
    stitch = Stitch()
    stranger = picture(surface(seed=9)[20:-20, :COLUMNS], 1)
    match = stitch.match(stitch.texture(before, STEP - 24, COLUMNS), stitch.texture(stranger, 0, 104))
    assert np.isnan(match.error_m)
    assert match.correlation < 0.4


def test_too_narrow_an_overlap_is_not_believed() -> None:
    before, after = pair(0.0, 0.0)
    stitch = Stitch()
    match = stitch.match(stitch.texture(before, COLUMNS - 20, COLUMNS), stitch.texture(after, 0, 20))
    assert np.isnan(match.error_m)
    assert stitch.texture(before, COLUMNS + 9, COLUMNS + 50).strip.shape[1] == 0


def test_what_is_not_seen_has_no_texture() -> None:
    before, _ = pair(0.0, 0.0)
    half = replace(before, seen=np.arange(ROWS)[:, None] + np.zeros((ROWS, COLUMNS)) > 30)
    strip = Stitch().texture(half, 10, 90).strip
    assert not strip[:30].any()
    assert strip[40:].any()


def test_a_texture_begins_where_it_says() -> None:
    before, _ = pair(0.0, 0.0)
    texture = Stitch().texture(before, 30, 60)
    assert texture.strip.shape == (ROWS, 30)
    assert texture.arc_start_m == pytest.approx(30 * PITCH_M)
