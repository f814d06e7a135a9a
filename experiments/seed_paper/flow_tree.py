"""The translating tree of Barron, Fleet and Beauchemin (IJCV 12, 1994): the frames, the true flow, the published ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image
from scipy import ndimage

from experiments.seed_paper.page import SHARED
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.flow_error import angular_error_rad, end_point_error_px
from gramoscope.pickup.flow.frame_derivatives import first_differences, four_point_derivatives, gaussian_derivatives
from gramoscope.pickup.flow.horn_schunck import Flow, HornSchunck
from gramoscope.pickup.flow.registered_flow import registered_flow
from gramoscope.signal_path import ImageArray

FOLDER = SHARED / "data" / "flow" / "translating_tree"
MIDDLE, SIZE_PX = 10, 150
SIGMA, ALPHA, SWEEPS = 1.5, 0.5, 100
PUBLISHED = HornSchunck(alpha=ALPHA, iterations=SWEEPS)
BORDER_ORIGINAL_PX, BORDER_PX = 4, 14
"""Left out of the statistics by the authors' program: twice the reach of its kernels."""
GAUSSIAN_FRAMES = 11
"""Points of the Gaussian, 3 σ to each side."""
TRUE = Flow(np.linspace(1.73, 2.30, SIZE_PX, dtype=np.float32)[None, :], np.zeros((1, SIZE_PX), np.float32))


@dataclass(frozen=True)
class Score:
    """Error of a flow over some points: angle, its spread, and end point."""

    angle_deg: float
    spread_deg: float
    end_point_px: float

    def __str__(self) -> str:
        return f"{self.angle_deg:.2f}° ± {self.spread_deg:.2f}°"


def score(flow: Flow, true: Flow, where: BoolArray) -> Score:
    """Return the error of a flow over the points where `where` holds."""
    angle = np.rad2deg(angular_error_rad(flow, true))[where]
    return Score(float(angle.mean()), float(angle.std()), float(end_point_error_px(flow, true)[where].mean()))


def read_tree() -> ImageArray | None:
    """Return frames 10 to 30, None where they are absent; frame 20 has index `MIDDLE`."""
    if not FOLDER.is_dir():
        return None
    return np.stack([np.asarray(Image.open(FOLDER / f"{number}.pgm")) for number in range(10, 31)])


def inside(border_px: int) -> BoolArray:
    """Return the points at least so far from the border."""
    where = np.zeros((SIZE_PX, SIZE_PX), np.bool_)
    where[border_px : SIZE_PX - border_px, border_px : SIZE_PX - border_px] = True
    return where


def modified_derivatives(tree: ImageArray) -> Derivatives:
    """Return the derivatives of the modified method."""
    return gaussian_derivatives(tree, sigma=SIGMA)


def original_flow(tree: ImageArray) -> Flow:
    """Return the flow of the original method."""
    return PUBLISHED.flow(first_differences(tree[MIDDLE], tree[MIDDLE + 1]))


def fringed_derivatives(tree: ImageArray) -> Derivatives:
    """Return the derivatives as the authors' program takes them.

    It smooths along time, rows and columns in turn, and leaves zeros where a kernel does not fit. The last pass reads the
    zeros of the one before it as if they were a picture: five columns at the left and at the right turn dark.
    """
    place = np.arange(-(GAUSSIAN_FRAMES // 2), GAUSSIAN_FRAMES // 2 + 1)
    kernel = np.exp(-(place**2) / (2 * SIGMA**2)) / (SIGMA * np.sqrt(2 * np.pi))
    fits = inside(GAUSSIAN_FRAMES // 2)
    film: FloatArray = ndimage.correlate1d(tree.astype(np.float64), kernel, axis=0)
    film = ndimage.correlate1d(film, kernel, axis=1, mode="nearest") * fits
    film = ndimage.correlate1d(film, kernel, axis=2, mode="constant") * fits
    return four_point_derivatives(film, border_px=BORDER_PX // 2)


def steep(derivatives: Derivatives, least: float = 5.0) -> BoolArray:
    """Return the points whose gradient is not below the least one, grey levels a pixel."""
    return np.asarray(np.hypot(derivatives.x, derivatives.y) >= least)


def flow_after_registration(tree: ImageArray, method: HornSchunck, *, frames: int = GAUSSIAN_FRAMES) -> Flow:
    """Return the flow at frame 20 of registered frames.

    The tree moves to the right and a record to the left: the frames are taken from last to first, and the flow turns round.
    """
    first = MIDDLE - (frames - 1) // 2
    film = tree[first : first + frames][::-1]
    backwards = registered_flow(film, method=method, smoothing_px=SIGMA)
    return Flow(-backwards.u, -backwards.v)
