"""Section 5.1 and figures 5a–b: where flow is found, and what the groove-orientation constraint does to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import ndimage

from experiments.seed_paper.page import FOLDER, Claim, Page, percent
from experiments.seed_paper.take import NOISE_RATE_HZ, Take, film_in_memory, noise_sound, short_bench
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.listening import ink
from gramoscope.pickup.flow.derivatives import FOUR_POINT, Derivatives, group_derivatives, texture_contrast
from gramoscope.pickup.flow.horn_schunck import Flow, GrooveHornSchunck, HornSchunck
from gramoscope.pickup.registration import frame_shifts, register
from gramoscope.pickup.seed_paper import Reading, SeedPaperPickup
from gramoscope.player.recipe import load_recipe
from gramoscope.signal_path import FrameGroup, ImageArray
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene

SEED, GROUP, FRAMES = 11, 6, 12
SHARP_REACH_PX = 8.0
"""Points so near to the true line of a stripe count as inside a sharp zone: the blur is then under seven pixels."""
LAID_SHORT = 0.2
"""In the second test the frames are laid so much too closely on each other: a small, exactly known flow remains."""
WEIGHTS = ((0.5, 0.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.0, 0.5), (0.5, 0.5, 0.5), (0.5, 2.0, 2.0), (0.1, 0.1, 0.1), (2.0, 2.0, 2.0))


@dataclass(frozen=True)
class FlowError:
    """Error of a flow against the exact one, inside and outside the sharp zones."""

    angle_deg: float
    angle_spread_deg: float
    end_point_px: float
    outside_angle_deg: float
    outside_end_point_px: float


@dataclass(frozen=True, eq=False)
class Case:
    """Derivatives with the flow that they truly have, pixels a frame along the groove."""

    name: str
    derivatives: Derivatives
    flow_px: float


def angular_error_deg(flow: Flow, true_u_px: float) -> FloatArray:
    """Return the angle between (u, v, 1) and (u₀, 0, 1) at every point, the measure of Barron, Fleet and Beauchemin."""
    u, v = flow.u.astype(np.float64), flow.v.astype(np.float64)
    cosine = (u * true_u_px + 1) / np.sqrt((u**2 + v**2 + 1) * (true_u_px**2 + 1))
    return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))


def flow_error(flow: Flow, true_u_px: float, sharp: BoolArray) -> FlowError:
    """Return the mean errors of a flow inside and outside the sharp zones."""
    angle = angular_error_deg(flow, true_u_px)
    end_point = np.hypot(flow.u - true_u_px, flow.v)
    return FlowError(
        angle_deg=float(angle[sharp].mean()),
        angle_spread_deg=float(angle[sharp].std()),
        end_point_px=float(end_point[sharp].mean()),
        outside_angle_deg=float(angle[~sharp].mean()),
        outside_end_point_px=float(end_point[~sharp].mean()),
    )


def space_time_derivatives(images: ImageArray, *, smoothing_px: float = 1.5) -> Derivatives:
    """Return the derivatives at the middle frame of a raw film: Gaussian in space and time, four-point differences."""
    smooth = ndimage.gaussian_filter(images.astype(np.float32), smoothing_px, mode="nearest")
    middle = len(images) // 2
    along, across = (ndimage.correlate1d(smooth[middle], FOUR_POINT, axis=axis, mode="nearest") for axis in (1, 0))
    return Derivatives(along, across, np.tensordot(FOUR_POINT, smooth[middle - 2 : middle + 3], axes=1))


def sharp_zones(rows: FloatArray, shape: tuple[int, ...]) -> BoolArray:
    """Return which points lie within `SHARP_REACH_PX` of the true line of a stripe."""
    distance = np.abs(np.arange(shape[0])[:, None, None] - rows.T[None, :, :])
    return np.asarray(distance.min(axis=2) <= SHARP_REACH_PX)


def film() -> Take:
    """Film the group that this page looks at: fading in is over, and the groove swings."""
    scene = Scene(short_bench(frames=FRAMES, groups=GROUP + 1), seed=SEED)
    sound = noise_sound(low_hz=200, high_hz=4000, seconds=0.1, seed=SEED)
    return film_in_memory(sound, NOISE_RATE_HZ, scene, [GROUP])


def cases(group: FrameGroup) -> list[Case]:
    """Return raw frames, frames laid over each other with steps that are too short, and frames that lie right."""
    step_px = float(np.diff(group.arc_start_m).mean()) / group.pixel_pitch_m
    shift, _ = frame_shifts(group)
    index = np.arange(FRAMES)
    short = register(group.images, shift * (1 - LAID_SHORT), index)
    right = register(group.images, shift, index)
    raw = [
        Case("raw frames", space_time_derivatives(group.images), -step_px),
        Case("laid a fifth too short", group_derivatives(short, smoothing_px=1.0), -LAID_SHORT * step_px),
        Case("registered", group_derivatives(right, smoothing_px=1.0), 0.0),
    ]
    return [replace(case, derivatives=case.derivatives.scaled(1 / texture_contrast(case.derivatives.x))) for case in raw]


def _solve(pickup: SeedPaperPickup, case: Case, weights: tuple[float, float, float], step_m: float) -> Flow:
    alpha, beta, gamma = weights
    method = (
        GrooveHornSchunck(alpha=alpha, beta=beta, gamma=gamma) if beta or gamma else HornSchunck(alpha=alpha)
    )
    return replace(pickup, flow=method)._flow(case.derivatives, np.array([step_m]))


def flow_errors(take: Take, pickup: SeedPaperPickup) -> dict[tuple[str, tuple[float, float, float]], FlowError]:
    """Return the error of the flow of every case with every set of weights."""
    group = take.groups[0]
    errors = {}
    for case in cases(group):
        width = case.derivatives.x.shape[1]
        sharp = sharp_zones(take.stripe_rows(group, np.arange(width, dtype=np.float64)), case.derivatives.x.shape)
        inside = np.zeros_like(sharp)
        inside[8:-8, 16:-32] = True
        for weights in WEIGHTS:
            # the shear of the walls belongs to the whole motion; what remains after registration has its share of it
            flow = _solve(pickup, case, weights, abs(case.flow_px) * group.pixel_pitch_m)
            cut = Flow(flow.u[8:-8, 16:-32], flow.v[8:-8, 16:-32])
            errors[case.name, weights] = flow_error(cut, case.flow_px, sharp[8:-8, 16:-32])
    return errors
