"""The angle of the walls, by the test tones of a stereo record.

A tone that was cut on one wall alone moves the other edge too if the walls do not stand at 45°: moving by n along its normal,
one wall takes the groove along by n/√2 and lets it rise by as much, which moves the edges by n/√2 (1 ± cot φ). The other edge
then swings ρ times as far, in step, with

    ρ = (1 − cot φ) / (1 + cot φ),    φ = 45° + arctan ρ.

A cutter that moves less in depth than sideways makes the same groove as steeper walls, and is undone in the same way. Only what
is beyond doubt is told: one tone and hardly anything else on each wall, of different periods, that leak in step and equally.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from scipy.optimize import minimize_scalar
from scipy.special import ndtr, stdtrit

from gramoscope.conventions import INNER, OUTER, BoolArray, ComplexArray, FloatArray
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import GrooveEdges

MOST_COLUMNS, MOST_WIDTHS = 2048, 30
"""Of a stretch, about its middle: so many columns, or widths of the groove if that is more. Over longer ones a hole that is off
the centre smears a tone."""
LEAST_MEASURED = 0.6
"""An edge of which less was measured says nothing."""
LEAST_STRETCHES = 3
"""What they disagree by is the error."""
LEAST_PERIODS, LEAST_PERIOD_PX = 2.0, 6.0
"""Of a tone in a stretch; slower ones are not told from the spiral, and faster ones not from grain."""
STANDS_OUT = 30.0
"""A line has so many times the power of the median frequency."""
APART = 3.0
"""Two tones differ by as many periods in a stretch."""
LEAST_EXPLAINED = 0.5
"""R² of both tones together, on each wall; the rest may be noise."""
SIGMAS = 3.0
STEP_SLACK, CROSSTALK_SLACK = 0.03, 0.02
"""Crosstalk so small, or so alike, is not held against the tones: edges are read no better than that."""
LEAST_SCATTER_PX = 1e-6
LEAST_SIGMA = 0.002
"""Of crosstalk: a few stretches may agree by chance."""
MOST_CROSSTALK = 0.27
"""Walls of 30 … 60°."""
FINER = 8
"""Frequencies in a whole number of periods."""


@dataclass(frozen=True)
class WallAngleFinding:
    """What test tones say of the walls.

    Attributes
    ----------
    angle_rad, sigma_rad : float
        φ of both walls and its standard error; NaN where it is not told.
    period_px : (float, float)
        Of the tones, in columns, of the inner and the outer wall's; NaN where none was found.
    crosstalk, crosstalk_sigma : (float, float)
        How far the other edge swings with each of them, over how far its own does, in step.
    stretches : int
        How many were looked at.
    reason : str or None
        Why nothing is told; None when it is.
    """

    angle_rad: float = float("nan")
    sigma_rad: float = float("nan")
    period_px: tuple[float, float] = (float("nan"), float("nan"))
    crosstalk: tuple[float, float] = (float("nan"), float("nan"))
    crosstalk_sigma: tuple[float, float] = (float("nan"), float("nan"))
    stretches: int = 0
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class _Edge:
    """Rows of an edge about a parabola, in the columns in which they were measured."""

    column: FloatArray
    row_px: FloatArray
    sigma_px: FloatArray
    columns: int

    @classmethod
    def of(cls, row_px: FloatArray, sigma_px: FloatArray, measured: BoolArray) -> _Edge:
        column = np.flatnonzero(measured).astype(np.float64)
        return cls(column, row_px[measured], sigma_px[measured], measured.size)

    def bent(self) -> FloatArray:
        """A constant, a slope and a bend: the spiral, and how the record lay."""
        return np.asarray(np.polynomial.legendre.legvander(2 * self.column / self.columns - 1, 2), np.float64)

    def spectrum(self, length: int) -> FloatArray:
        """Power of displacement, Hann window."""
        bent, weight = self.bent(), 1 / self.sigma_px
        rest = self.row_px - bent @ np.linalg.lstsq(bent * weight[:, None], self.row_px * weight, rcond=None)[0]
        window = np.hanning(self.columns + 2)[1:-1]
        swing, seen = np.zeros(self.columns), self.column.astype(np.intp)
        swing[seen] = rest * window[seen]
        return np.asarray(np.abs(scipy.fft.rfft(swing, length) / window[seen].sum()) ** 2, np.float64)

    def tones(self, periods_px: FloatArray) -> tuple[ComplexArray, float, float]:
        """Complex amplitudes; weighted mean squares of what is left without the tones, and with them."""
        turning = np.exp(2j * np.pi * self.column[:, None] / periods_px)
        bent, n = self.bent(), periods_px.size
        weight = 1 / self.sigma_px[:, None]
        design = np.hstack([turning.real, turning.imag, bent]) * weight
        row = self.row_px * weight[:, 0]
        found = np.linalg.lstsq(design, row, rcond=None)[0]
        without = design[:, 2 * n :] @ np.linalg.lstsq(design[:, 2 * n :], row, rcond=None)[0]
        squares = [float(np.sum((row - model) ** 2) / np.sum(weight**2)) for model in (without, design @ found)]
        return found[:n] - 1j * found[n : 2 * n], squares[0], squares[1]


def wall_angle(grooves: Sequence[GrooveEdges]) -> WallAngleFinding:
    """Return the angle of the walls, as far as test tones tell it.

    Parameters
    ----------
    grooves : sequence of GrooveEdges
        Stretches of one record, with both edges; others do not count. All of one scale, and of about one radius.

    Returns
    -------
    WallAngleFinding
        With a `reason` for anything but a stereo record's test tones: music, one tone on both walls, silence.
    """
    stretches = [pair for pair in map(_pair, grooves) if pair is not None]
    if len(stretches) < LEAST_STRETCHES:
        return WallAngleFinding(
            stretches=len(stretches), reason=f"{len(stretches)} stretches show both edges, {LEAST_STRETCHES} are needed"
        )
    periods_px = np.array([_period_px([pair[wall] for pair in stretches]) for wall in (INNER, OUTER)])
    told: dict[str, Any] = {"period_px": _two(periods_px), "stretches": len(stretches)}
    columns = max(pair[INNER].columns for pair in stretches)
    for name, wall in (("inner", INNER), ("outer", OUTER)):
        if np.isnan(periods_px[wall]):
            return WallAngleFinding(**told, reason=f"no tone stands out on the {name} wall")
    if abs(columns / periods_px[INNER] - columns / periods_px[OUTER]) < APART:
        return WallAngleFinding(**told, reason="both walls have the same tone")
    return _by_crosstalk(stretches, periods_px, told)


def _by_crosstalk(
    stretches: Sequence[tuple[_Edge, _Edge]], periods_px: FloatArray, told: dict[str, Any]
) -> WallAngleFinding:
    fits = [[edge.tones(periods_px) for edge in pair] for pair in stretches]
    swing = np.array([[fit[0] for fit in pair] for pair in fits])
    squares = np.array([[fit[1:] for fit in pair] for pair in fits]).mean(axis=0)
    explained = 1 - squares[:, 1] / squares[:, 0]
    if explained.min() < LEAST_EXPLAINED:
        return WallAngleFinding(**told, reason=f"there is more than a tone on each wall (R² {explained.min():.2f})")
    # each tone's share in what the other edge's scatter lets it tell
    scatter_px = np.sqrt(np.maximum(squares[::-1, 1], LEAST_SCATTER_PX**2))
    own = np.stack([swing[:, wall, wall] for wall in (INNER, OUTER)], axis=1) / scatter_px
    other = np.stack([swing[:, 1 - wall, wall] for wall in (INNER, OUTER)], axis=1) / scatter_px
    crosstalk, sigma = np.array([_crosstalk(own[:, [wall]], other[:, [wall]]) for wall in (INNER, OUTER)]).T
    told |= {"crosstalk": _two(crosstalk.real), "crosstalk_sigma": _two(sigma.real)}
    out_of_step = np.abs(crosstalk.imag) > np.maximum(np.abs(crosstalk.real), STEP_SLACK) + SIGMAS * sigma.imag
    if out_of_step.any():
        return WallAngleFinding(**told, reason="the tones leak out of step, which no angle makes them do")
    if abs(crosstalk.real[0] - crosstalk.real[1]) > CROSSTALK_SLACK + SIGMAS * np.hypot(*sigma.real):
        return WallAngleFinding(**told, reason="the two tones do not leak equally")
    both, sigma_both = _crosstalk(own, other)
    if abs(both.real) > MOST_CROSSTALK:
        return WallAngleFinding(**told, reason="the tones leak more than walls of 30 to 60° let them")
    angle, slope = np.pi / 4 + np.arctan(both.real), 1 / (1 + both.real**2)
    return WallAngleFinding(**told, angle_rad=float(angle), sigma_rad=float(slope * sigma_both.real))


def _pair(groove: GrooveEdges) -> tuple[_Edge, _Edge] | None:
    """Both edges of the middle of a stretch; None if one of them was hardly measured."""
    columns = groove.flags.shape[1]
    seen = (groove.flags & np.uint16(NOT_MEASURED)) == 0
    both = seen.all(axis=0)
    width_px = float(np.median(np.abs(np.diff(groove.row_px[:, both], axis=0)))) if both.any() else 0.0
    most = max(MOST_COLUMNS, round(MOST_WIDTHS * width_px))
    first = max(columns - most, 0) // 2
    middle = slice(first, first + most)
    measured = seen[:, middle]
    if measured.mean(axis=1).min() < LEAST_MEASURED:
        return None
    row, sigma = groove.row_px[:, middle], groove.row_sigma_px[:, middle]
    return _Edge.of(row[INNER], sigma[INNER], measured[INNER]), _Edge.of(row[OUTER], sigma[OUTER], measured[OUTER])


def _period_px(edges: Sequence[_Edge]) -> float:
    """Period of the tone whose velocity is the greatest of all that stand out; NaN if none does."""
    columns = max(edge.columns for edge in edges)
    length = FINER * columns
    power = np.mean([edge.spectrum(length) for edge in edges], axis=0)
    frequency = np.arange(power.size) / length
    possible = (frequency >= LEAST_PERIODS / columns) & (frequency <= 1 / LEAST_PERIOD_PX)
    clear = possible & (power > STANDS_OUT * np.median(power[possible])) if possible.any() else possible
    if not clear.any():
        return float("nan")
    near = frequency[np.argmax(np.where(clear, frequency**2 * power, 0.0))]
    return _best_period_px(edges, near, 0.75 / columns)


def _best_period_px(edges: Sequence[_Edge], frequency: float, reach: float) -> float:
    """The period about a frequency that leaves least of all edges together."""

    def left(one: float) -> float:
        return sum(edge.tones(np.array([1 / one]))[2] for edge in edges)

    found = minimize_scalar(
        left, bounds=(frequency - reach, frequency + reach), method="bounded", options={"xatol": reach / 100}
    )
    return float(1 / found.x)


def _crosstalk(own: ComplexArray, other: ComplexArray) -> tuple[complex, complex]:
    """How much of its own swing the other edge has, of all tones of all stretches; standard errors of both parts.

    By leaving out one stretch at a time, and so that 68 of 100 are within it, as few as there may be (Student).
    """
    cross, power = (other * own.conj()).sum(axis=1), (np.abs(own) ** 2).sum(axis=1)
    n = len(own)
    each = (cross.sum() - cross) / (power.sum() - power)
    few = stdtrit(n - 1, ndtr(1.0))
    sigma = [few * np.sqrt((n - 1) / n * np.sum((part - part.mean()) ** 2)) for part in (each.real, each.imag)]
    return complex(cross.sum() / power.sum()), complex(*np.maximum(sigma, LEAST_SIGMA))


def _two(values: FloatArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])
