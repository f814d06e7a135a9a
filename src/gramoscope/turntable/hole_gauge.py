"""The gauge for an off-centre hole: it watches where the groove passes the microscope, and fits a turn.

Stage and picture together say the lateral place of each wall, which over the angle φ that the record has turned is

    l_w(φ) = c_w + d φ/2π − e cos φ₀ cos φ − e sin φ₀ sin φ + music

with a constant c_w of each wall and the pitch d of the spiral (see `turntable.off_centre` for signs): linear in its
parameters. The music is the error. Its bass is longer than a stretch, so that errors are counted by blocks of
1/`BLOCKS_A_TURN` of a turn, some hundredths of a second of sound, and longer ones where the passage is longer.

Overlaps of neighbouring stretches say by how much the record moved farther than the capture says, per step
(e/r) cos(φ − φ₀) if the capture's places are angles of the spindle, and nothing if they are true arcs. That is a witness of
its own, which the gauge hears too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import WallTrace
from gramoscope.turntable.blocked_fit import BlockedFit
from gramoscope.turntable.off_centre import OffCentreHole
from gramoscope.turntable.rotation import Rotation

BLOCKS_A_TURN = 24
LEAST_TURNS = 0.75
"""Less of a turn looks like a bend of the spiral."""
LARGEST_WOW_SIGMA = 1e-3
"""An amplitude that is known no better than this share of the radius, 0.1 % of the speed, is not called known."""
LARGEST_WOW = 0.1
"""No hole is farther off, as a share of the radius: what looks like that is a stage that was read wrongly."""
LEAST_SIGMAS = 3.0
"""An amplitude below so many of its standard errors is not worth removing."""


@dataclass(frozen=True)
class HoleFinding:
    """What is known of a hole.

    Attributes
    ----------
    turns : float
        How much of the record the passage covers.
    radius_m : float
        Mean radius of the passage.
    eccentricity_m, eccentricity_sigma_m : float
        Amplitude e; NaN where the fit says nothing at all.
    phase_rad, phase_sigma_rad : float
        φ₀, −π … π.
    pitch_m, pitch_sigma_m : float
        Radius lost a turn, by the film.
    step_wow, step_wow_sigma : float
        Relative excess of the steps between stretches, along cos(φ − φ₀), by their overlaps; NaN without any.
    reason : str or None
        Why the hole is not determined; None when it is.
    """

    turns: float
    radius_m: float
    eccentricity_m: float
    eccentricity_sigma_m: float
    phase_rad: float
    phase_sigma_rad: float
    pitch_m: float
    pitch_sigma_m: float
    step_wow: float
    step_wow_sigma: float
    reason: str | None

    @property
    def wow(self) -> float:
        """Peak of the wow, e/r."""
        return self.eccentricity_m / self.radius_m

    @property
    def wow_sigma(self) -> float:
        """Its standard error."""
        return self.eccentricity_sigma_m / self.radius_m

    @property
    def significant(self) -> bool:
        """Whether there is a hole to speak of."""
        return self.reason is None and self.eccentricity_m > LEAST_SIGMAS * self.eccentricity_sigma_m

    def hole(self, rotation: Rotation) -> OffCentreHole:
        """Return the hole that was found, in a rotation."""
        return OffCentreHole(rotation, self.eccentricity_m, self.phase_rad)


@dataclass
class HoleGauge:
    """Watches stretches pass, and remembers sums.

    Parameters
    ----------
    rotation : Rotation
        The nominal spiral.
    """

    rotation: Rotation
    _places: BlockedFit = field(default_factory=lambda: BlockedFit(5, 1 / BLOCKS_A_TURN))
    _steps: BlockedFit = field(default_factory=lambda: BlockedFit(3, 1 / BLOCKS_A_TURN))
    _first_turn: float = np.inf
    _last_turn: float = -np.inf
    _before_m: float = np.nan
    _before_rad: float = np.nan

    def see(self, trace: WallTrace, step_error_m: float = np.nan) -> None:
        """Take note of a stretch.

        Parameters
        ----------
        trace : WallTrace
            In the order of the passage. Samples that are NaN or not measured do not count.
        step_error_m : float
            By how much farther than nominal it lies from the one before, by their overlap; NaN when that is not known.
        """
        angle = float(self.rotation.angle_of_arc_rad(trace.arc_start_m))
        step_m, step_rad = trace.arc_start_m - self._before_m, angle - self._before_rad
        self._before_m, self._before_rad = trace.arc_start_m, angle
        if np.isfinite(step_error_m) and step_m > 0:
            # the middle of the step, which is what the difference of two places speaks of
            middle = angle - step_rad / 2
            row = np.array([[1.0, np.cos(middle), np.sin(middle)]])
            self._steps.add(middle / (2 * np.pi), row, np.array([step_error_m / step_m]))
        usable = np.isfinite(trace.offset_m) & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
        for wall in np.flatnonzero(usable.any(axis=1)):
            samples = np.flatnonzero(usable[wall])
            self._see_wall(int(wall), angle, trace, float(samples.mean()), float(trace.offset_m[wall, samples].mean()))

    def _see_wall(self, wall: int, angle: float, trace: WallTrace, middle: float, place_m: float) -> None:
        angle += middle * trace.arc_step_m / float(self.rotation.radius_at_m(trace.arc_start_m))
        turn = angle / (2 * np.pi)
        self._first_turn, self._last_turn = min(self._first_turn, turn), max(self._last_turn, turn)
        row = np.array([[wall == 0, wall == 1, turn, np.cos(angle), np.sin(angle)]], np.float64)
        self._places.add(turn, row, np.array([place_m]))

    @property
    def turns(self) -> float:
        """How much of the record was seen."""
        return max(self._last_turn - self._first_turn, 0.0)

    def finding(self) -> HoleFinding:
        """Return what is known by now."""
        b, covariance = self._places.solve()
        inwards, spread = -b[3:], covariance[3:, 3:]
        amplitude, phase = float(np.hypot(*inwards)), float(np.arctan2(inwards[1], inwards[0]))
        along, across = _unit(phase), _unit(phase + np.pi / 2)
        sigma = float(np.sqrt(along @ spread @ along))
        step, step_covariance = self._steps.solve()
        radius = self._mean_radius_m()
        return HoleFinding(
            turns=self.turns,
            radius_m=radius,
            eccentricity_m=amplitude,
            eccentricity_sigma_m=sigma,
            phase_rad=phase,
            phase_sigma_rad=float(np.sqrt(across @ spread @ across)) / amplitude if amplitude > 0 else np.inf,
            pitch_m=float(b[2]),
            pitch_sigma_m=float(np.sqrt(covariance[2, 2])),
            step_wow=float(along @ step[1:]),
            step_wow_sigma=float(np.sqrt(along @ step_covariance[1:, 1:] @ along)),
            reason=self._reason(amplitude, spread, radius),
        )

    def _mean_radius_m(self) -> float:
        if self.turns == 0:
            return self.rotation.radius_m
        middle = np.pi * (self._first_turn + self._last_turn)
        return float(self.rotation.radius_at_m(self.rotation.arc_of_angle_m(middle)))

    def _reason(self, amplitude_m: float, spread: FloatArray, radius_m: float) -> str | None:
        if self.turns < LEAST_TURNS:
            return f"the passage covers {self.turns:.3g} of a turn; {LEAST_TURNS:g} are needed"
        if not np.isfinite(spread).all():
            return "too few stretches were read"
        worst = float(np.sqrt(np.linalg.eigvalsh(spread)[-1]))
        if worst > LARGEST_WOW_SIGMA * radius_m:
            return f"the amplitude is known to {worst * 1e6:.3g} µm only, {100 * worst / radius_m:.2g} % of the radius"
        if amplitude_m > LARGEST_WOW * radius_m:
            return f"an amplitude of {amplitude_m * 1e3:.3g} mm is no hole; see whether stage_um is right"
        return None


def _unit(angle_rad: float) -> FloatArray:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])
