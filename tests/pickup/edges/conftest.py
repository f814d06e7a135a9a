"""Photographs of grooves whose edges are known, drawn at their true places to a fraction of a pixel; and practice ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.special import ndtr

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.signal_path import StillPicture

MICROGRAPHS = Path(__file__).parents[3].parent / "shared" / "data" / "micrographs"


@dataclass(frozen=True)
class Photograph:
    """A picture to be drawn.

    The grooves lie `pitch_px` apart, the first one `first_px` from the upper border, and are `width_px` wide; each edge
    swings by its own tone. Land has the level `land`, walls `wall`; the light falls off along and across; noise has the
    standard deviation `noise`, more on the land by `land_noise`, and is made alike over `noise_blur_px`. Along the bottom,
    half way between the edges, runs a line that is brighter than the walls by `bottom`, a Gaussian of standard deviation
    `bottom_px`.
    """

    rows: int = 300
    columns: int = 400
    grooves: int = 3
    pitch_px: float = 100.0
    first_px: float = 20.3
    width_px: float = 60.0
    land: float = 150.0
    wall: float = 70.0
    blur_px: float = 1.3
    noise: float = 8.0
    land_noise: float = 0.0
    noise_blur_px: float = 0.0
    swing_px: float = 4.0
    period_px: float = 80.0
    light: float = 0.0
    line: float = 0.0
    bottom: float = 0.0
    bottom_px: float = 1.5
    seed: int = 7

    def edges(self) -> FloatArray:
        """True rows of the edges, shape (groove, wall, column)."""
        x = np.arange(self.columns)
        rows = np.empty((self.grooves, 2, self.columns))
        for groove in range(self.grooves):
            for wall, offset in ((OUTER, 0.0), (INNER, self.width_px)):
                phase = 1.7 * groove + 0.9 * wall
                swing = np.sin(2 * np.pi * x / (self.period_px * (1 + 0.13 * wall)) + phase)
                bend = 3.0 * ((x / self.columns) - 0.5) ** 2
                rows[groove, wall] = self.first_px + groove * self.pitch_px + offset + self.swing_px * swing + bend
        return rows

    def levels(self) -> FloatArray:
        """Grey levels without noise."""
        row = np.arange(self.rows)[:, None]
        inside = np.zeros((self.rows, self.columns))
        lines, lines_of_bottom = np.zeros((2, self.rows, self.columns))
        for outer, inner in ((edge[OUTER], edge[INNER]) for edge in self.edges()):
            inside += ndtr((row - outer) / self.blur_px) - ndtr((row - inner) / self.blur_px)
            lines_of_bottom += np.exp(-0.5 * ((row - 0.5 * (outer + inner)) / self.bottom_px) ** 2)
            for edge in (outer, inner):
                lines += np.exp(-0.5 * ((row - edge) / self.blur_px) ** 2)
        level = self.land + (self.wall - self.land) * inside + self.line * lines + self.bottom * lines_of_bottom
        fall = 1 - self.light * (row / self.rows + np.arange(self.columns) / self.columns) / 2
        return level * fall

    def still(
        self, *, dust: tuple[tuple[float, float, float], ...] = (), halo_px: tuple[float, float] = (0.0, 0.0)
    ) -> StillPicture:
        """The picture; dust is burnt discs of (row, column, radius), with halos so long along the columns and the rows."""
        rng = np.random.default_rng(self.seed)
        clean = self.levels()
        grain = rng.standard_normal(clean.shape)
        if self.noise_blur_px:
            grain = gaussian_filter(grain, self.noise_blur_px)
            grain /= grain.std()
        land = np.clip((clean - self.wall) / (self.land - self.wall), 0, 1)
        level = clean + (self.noise + self.land_noise * land) * grain
        row, column = np.mgrid[: self.rows, : self.columns]
        burnt = np.zeros(clean.shape, np.bool_)
        for at, where, radius in dust:
            burnt |= (row - at) ** 2 + (column - where) ** 2 < radius**2
        if all(halo_px):
            along, across = halo_px
            distance = np.asarray(distance_transform_edt(~burnt, sampling=(1 / across, 1 / along)))
            level += (255.0 - level) * np.exp(-distance)
        level = np.where(burnt, 255.0, level)
        return still(np.clip(np.rint(level), 0, 255).astype(np.uint8))


def still(image: np.ndarray, *, pixel_pitch_m: float = 1e-6, white_level: int = 255) -> StillPicture:  # type: ignore[type-arg]
    """A picture all of which is seen."""
    return StillPicture(0, image, 0.0, 0.0, pixel_pitch_m, white_level, np.ones(image.shape, np.bool_))


@pytest.fixture
def photograph() -> Callable[..., Photograph]:
    """Makes photographs."""
    return Photograph


@pytest.fixture
def picture_of() -> Callable[..., StillPicture]:
    """Makes a picture of grey levels."""
    return still


@pytest.fixture
def micrograph() -> Callable[[str], np.ndarray]:  # type: ignore[type-arg]
    """Grey levels of a practice micrograph, turned so that its grooves run along the columns."""

    def grey(name: str) -> np.ndarray:  # type: ignore[type-arg]
        path = MICROGRAPHS / f"{name}.png"
        if not path.is_file():
            pytest.skip("the micrographs are not beside the repository (shared/data/micrographs)")
        with Image.open(path) as image:
            return np.ascontiguousarray(np.asarray(image)[..., 0].T)

    return grey
