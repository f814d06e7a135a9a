"""The imperfect rig: what really happened while each group was filmed.

The turntable creeps in uneven steps and never starts a group quite where it was told; focus drifts; the record is warped;
the stage is moved; now and then a flash fails. Each group draws its own errors from a hashed seed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gramoscope.apparatus.bench import Sequence
from gramoscope.conventions import FloatArray, rad
from gramoscope.errors import require
from gramoscope.turntable.wow import Wow

STREAM = 0x216


@dataclass(frozen=True)
class Rig:
    """How far the rig is from the one in the manifest. Everything is off by default.

    Parameters
    ----------
    frame_step_share : float
        Standard deviation of the steps between frames, relative to the nominal step.
    group_position_m : float
        Standard deviation of where a group starts; group 0 starts at s = 0 whatever happens.
    wow : Wow
        With which the sound was cut.
    warp_m, warp_length_m : float
        Amplitude and wavelength along the groove of the record's slow up and down.
    focus_drift_m : float
        Amplitude of the slow change of focus over the groups; the first quarter of a swing takes `focus_drift_groups`.
    focus_drift_groups : float
    inner_angle_error_rad, outer_angle_error_rad : float
        Of the walls against the manifest.
    stage_wander_m : float
        Standard deviation of the stage's radial position from group to group; the log knows it.
    dim : float
        Share of the light that is left, above 0.
    black_share, saturated_share, lost_share : float
        Share of groups in which a frame is black, a frame is blown out, and of groups that were never stored.
    dirt : int
        Specks on the camera's window, which stay where they are in the picture.
    """

    frame_step_share: float = 0.0
    group_position_m: float = 0.0
    wow: Wow = field(default_factory=Wow)
    warp_m: float = 0.0
    warp_length_m: float = 40e-3
    focus_drift_m: float = 0.0
    focus_drift_groups: float = 50.0
    inner_angle_error_rad: float = 0.0
    outer_angle_error_rad: float = 0.0
    stage_wander_m: float = 0.0
    dim: float = 1.0
    black_share: float = 0.0
    saturated_share: float = 0.0
    lost_share: float = 0.0
    dirt: int = 0

    def __post_init__(self) -> None:
        sizes = (self.frame_step_share, self.group_position_m, self.stage_wander_m, self.dirt)
        require(min(sizes) >= 0, f"spreads {sizes}", "zero or more")
        require(self.warp_length_m > 0, f"a warp {self.warp_length_m} m long", "a positive length")
        require(self.focus_drift_groups > 0, f"a drift over {self.focus_drift_groups} groups", "a positive number")
        require(self.dim > 0, f"{self.dim} of the light", "a positive share")
        shares = (self.black_share, self.saturated_share, self.lost_share)
        require(min(shares) >= 0 and max(shares) <= 1, f"shares of groups {shares}", "0 … 1")

    def surface_height_m(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return how high the warp lifts the record at the places s."""
        return np.asarray(self.warp_m * np.sin(2 * np.pi * np.asarray(arc_m, np.float64) / self.warp_length_m))

    def filmed(self, number: int, *, sequence: Sequence, seed: int) -> FilmedGroup:
        """Return what happened while a group was filmed.

        Parameters
        ----------
        number : int
            Of the group, from 0.
        sequence : Sequence
            What was meant to happen.
        seed : int
        """
        rng = np.random.default_rng([seed, STREAM, number])
        frames = sequence.frames_per_group
        # every draw is made whether it is used or not, so that one imperfection does not change the others
        position, stage, steps = rng.standard_normal(), rng.standard_normal(), rng.standard_normal(frames - 1)
        black, saturated, lost = rng.random(3) < (self.black_share, self.saturated_share, self.lost_share)
        victims = rng.integers(frames, size=2)
        start_m = number * sequence.group_step_m + self.group_position_m * position * (number > 0)
        step_m = sequence.frame_step_m * np.maximum(0, 1 + self.frame_step_share * steps)
        light = np.full(frames, self.dim)
        light[victims[0]] *= 10.0 if saturated else 1.0
        light[victims[1]] *= 0.0 if black else 1.0
        return FilmedGroup(
            arc_start_m=start_m + np.concatenate([[0.0], np.cumsum(step_m)]),
            nominal_start_m=number * sequence.group_step_m
            + np.arange(frames, dtype=np.float64) * sequence.frame_step_m,
            stage_m=float(self.stage_wander_m * stage),
            focus_error_m=float(self.focus_drift_m * np.sin(np.pi / 2 * number / self.focus_drift_groups)),
            light=light,
            lost=bool(lost),
        )


@dataclass(frozen=True, eq=False)
class FilmedGroup:
    """The truth about one group.

    Attributes
    ----------
    arc_start_m, nominal_start_m : float64 arrays, shape (frame,)
        Where column 0 of each frame really was, and where the log says it was.
    stage_m : float
        Radial position of the microscope.
    focus_error_m : float
        How much too high the sharp planes were.
    light : float64 array, shape (frame,)
        Factor on the exposure of each frame.
    lost : bool
        Whether the group never reached the disk.
    """

    arc_start_m: FloatArray
    nominal_start_m: FloatArray
    stage_m: float
    focus_error_m: float
    light: FloatArray
    lost: bool


PERFECT_RIG = Rig()
MODEST_RIG = Rig(
    frame_step_share=0.03, group_position_m=0.5e-6, warp_m=1e-6, focus_drift_m=0.5e-6, stage_wander_m=0.0, dirt=2
)
ROUGH_RIG = Rig(
    frame_step_share=0.08,
    group_position_m=3e-6,
    wow=Wow(depth=0.003),
    warp_m=4e-6,
    focus_drift_m=2e-6,
    inner_angle_error_rad=rad(1.5),
    outer_angle_error_rad=rad(-1.0),
    stage_wander_m=2e-6,
    dim=0.6,
    black_share=0.01,
    saturated_share=0.01,
    lost_share=0.005,
    dirt=8,
)

RIGS = {"none": PERFECT_RIG, "modest": MODEST_RIG, "rough": ROUGH_RIG}
