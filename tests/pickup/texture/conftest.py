"""A groove without a microscope: texture that is blurred the more the further a row lies from one of two stripes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import fft, ndimage

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.stretch import Stretch

WIDTH, HEIGHT = 900, 120
LAYOUT = StripeLayout(
    rest_row=np.array([29.3, 88.6]),
    wall=np.array([OUTER, INNER]),
    first_row=np.zeros(2),
    last_row=np.full(2, HEIGHT - 1.0),
    middle_row=59.0,
    half_width_px=190.0,
)


def displacement_px(number: int) -> FloatArray:
    """Where both walls of a stretch run: a lateral cut and a slow vertical drift."""
    column, rng = np.arange(WIDTH), np.random.default_rng([number, 1])
    phase, period, drift = rng.uniform(0, 6), rng.uniform(150, 400), rng.uniform(-0.4, 0.4)
    lateral = 2.2 * np.sin(2 * np.pi * column / period + phase)
    return np.array([lateral - drift, lateral + drift])


def treble_px(period_px: float) -> FloatArray:
    """How both walls of a lateral cut move that is heard, too."""
    return np.tile(0.5 * np.sin(2 * np.pi * np.arange(WIDTH) / period_px + 0.7), (2, 1))


def picture(number: int, path_px: FloatArray) -> np.ndarray:
    """What the camera sees of it, columns first, in grey levels."""
    rng = np.random.default_rng([number, 2])
    row = np.arange(HEIGHT)
    grains = ndimage.gaussian_filter1d(rng.normal(size=(HEIGHT, 1024)), 1.5, axis=0)
    away = np.minimum(abs(row - LAYOUT.rest_row[0]), abs(row - LAYOUT.rest_row[1]))
    blur = np.exp(-2 * (np.pi * np.fft.rfftfreq(1024) * np.hypot(0.7, 0.35 * away)[:, None]) ** 2)
    straight = fft.irfft(fft.rfft(grains) * blur, 1024)[:, :WIDTH]
    wall = np.where(row < LAYOUT.middle_row, OUTER, INNER)
    place = row[:, None] - path_px[wall]
    bent = ndimage.map_coordinates(straight, (place, np.broadcast_to(np.arange(WIDTH), place.shape)), order=5)
    return np.ascontiguousarray((100 + 40 * bent + rng.normal(size=bent.shape)).T, np.float32)


def stretch(number: int, sound_px: FloatArray | float = 0.0, error_px: float = 0.6) -> Stretch:
    """The stretch laid ready, its path wrong as a coarse search leaves it, and without the sound."""
    rng = np.random.default_rng([number, 3])
    wrong = ndimage.gaussian_filter1d(rng.normal(size=WIDTH), 40) * error_px * np.sqrt(2 * np.sqrt(np.pi) * 40)
    return Stretch(
        picture(number, displacement_px(number) + sound_px),
        np.ones(WIDTH, bool),
        np.empty((0, 2), np.int64),
        displacement_px(number) + wrong,
        np.ones((2, WIDTH)),
    )


@pytest.fixture(scope="session")
def layout() -> StripeLayout:
    return LAYOUT


@pytest.fixture(scope="session")
def true_px() -> Callable[[int], FloatArray]:
    return displacement_px


@pytest.fixture(scope="session")
def stretches() -> list[Stretch]:
    return [stretch(number) for number in range(12)]


@pytest.fixture(scope="session")
def another() -> Stretch:
    """Number 77, that nobody learns from."""
    return stretch(77)


@pytest.fixture(scope="session")
def with_treble() -> Callable[[float], tuple[Stretch, FloatArray]]:
    """Number 78 with a tone of a given period, and that tone."""
    return lambda period_px: (stretch(78, treble_px(period_px)), treble_px(period_px))
