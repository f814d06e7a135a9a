"""What an operator wants to see while a record is being filmed: level, sharpness, where stripes run, and what goes wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.conventions import INNER, MICROMETRES_PER_METRE, BoolArray
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import WallTrace

MARGIN_PX = 8.0
"""A stripe so near to an edge is half gone."""
LEAST_READ = 0.5
"""A wall of which less is read is out of focus, or out of sight."""
_WALLS = ("inner", "outer")


@dataclass(frozen=True)
class LiveFigures:
    """A group at a glance.

    Attributes
    ----------
    level_m_s : float
        Root mean square velocity of the groove across, NaN where it was not read.
    read : tuple of float
        Share of each wall's samples that were read, inner and outer; NaN for a wall that the pickup does not read.
    sigma_m : tuple of float
        Median standard error of each wall's places: the sharper, the smaller.
    stripe_rows : tuple of (float, float)
        Lowest and highest row of each stripe; empty for a pickup that knows places only up to a constant.
    """

    level_m_s: float
    read: tuple[float, float]
    sigma_m: tuple[float, float]
    stripe_rows: tuple[tuple[float, float], ...]

    def words(self) -> str:
        """Return it in a few words."""
        parts = [f"{100 * self.level_m_s:.2f} cm/s"]
        for name, read, sigma_m in zip(_WALLS, self.read, self.sigma_m, strict=True):
            if np.isfinite(read):
                parts.append(f"{name} {read:.0%} ± {MICROMETRES_PER_METRE * sigma_m:.3f} µm")
        if self.stripe_rows:
            parts.append("rows " + " ".join(f"{low:.0f}…{high:.0f}" for low, high in self.stripe_rows))
        return ", ".join(parts)


@dataclass
class LiveMeter:
    """Measures groups as they come, and warns once when something begins to be wrong.

    Parameters
    ----------
    bench : Bench
    """

    bench: Bench
    _wrong: set[str] = field(default_factory=set)

    def look(self, trace: WallTrace) -> tuple[LiveFigures, list[str]]:
        """Return the figures of a stretch, and warnings that were not true of the one before."""
        figures = figures_of(trace, self.bench)
        wrong = dict(_wrong(figures, self.bench))
        new = [f"group {trace.number}: {words}" for name, words in wrong.items() if name not in self._wrong]
        self._wrong = set(wrong)
        return figures, new


def figures_of(trace: WallTrace, bench: Bench) -> LiveFigures:
    """Return a stretch at a glance.

    Parameters
    ----------
    trace : WallTrace
    bench : Bench
    """
    seen = np.isfinite(trace.offset_m) & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
    # a pickup that measures slopes knows places up to a constant: not where in the picture they are
    by_slope = bool(np.isfinite(trace.slope).any())
    reads = np.isfinite(trace.offset_m).any(axis=1) if by_slope else np.ones(2, np.bool_)
    return LiveFigures(
        level_m_s=_level_m_s(trace, seen, bench, by_slope=by_slope),
        read=_pair(np.where(reads, seen.mean(axis=1), np.nan) if seen.size else np.full(2, np.nan)),
        sigma_m=_pair(
            [float(np.median(trace.offset_sigma_m[i, seen[i]])) if seen[i].any() else np.nan for i in (0, 1)]
        ),
        stripe_rows=() if by_slope else tuple(_rows(trace, seen, stripe, bench) for stripe in bench.stripes()),
    )


def _pair(values: object) -> tuple[float, float]:
    first, second = np.asarray(values, np.float64).tolist()
    return first, second


def _level_m_s(trace: WallTrace, seen: BoolArray, bench: Bench, *, by_slope: bool) -> float:
    """Of the walls that were read: the slope along the groove times its speed."""
    if by_slope:
        slope = trace.slope[seen & np.isfinite(trace.slope)]
    else:
        steps = np.diff(trace.offset_m, axis=1)[seen[:, 1:] & seen[:, :-1]]
        slope = steps / trace.arc_step_m
    speed_m_s = float(bench.rotation.speed_at_m_s(trace.arc_start_m))
    return speed_m_s * float(np.sqrt(np.mean(slope**2))) if slope.size else float("nan")


def _rows(trace: WallTrace, seen: BoolArray, stripe: Stripe, bench: Bench) -> tuple[float, float]:
    stage_m = 0.0 if trace.head is None else trace.head.stage_m
    places = trace.offset_m[stripe.wall, seen[stripe.wall]] - stage_m
    if not places.size:
        return float("nan"), float("nan")
    rows = stripe.row + places / bench.sensor.pixel_pitch_m
    return float(rows.min()), float(rows.max())


def _wrong(figures: LiveFigures, bench: Bench) -> Iterator[tuple[str, str]]:
    """Name and words of everything that is wrong."""
    for name, read in zip(_WALLS, figures.read, strict=True):
        if read < LEAST_READ:
            yield f"{name} unread", f"only {read:.0%} of the {name} wall can be read: look at the focus"
    height = bench.sensor.height_px
    for stripe, (low, high) in zip(bench.stripes(), figures.stripe_rows, strict=False):
        name = f"the {'inner' if stripe.wall == INNER else 'outer'} wall's stripe at row {stripe.row:.0f}"
        if low < MARGIN_PX or high > height - 1 - MARGIN_PX:
            yield f"{name} edge", f"{name} leaves the picture (rows {low:.0f} … {high:.0f} of {height})"
        if bench.cover_glass is not None and _leaves_its_half(stripe, low, high, bench):
            yield f"{name} half", f"{name} crosses the edge of the glass, at row {bench.glass_edge_row:.0f}"


def _leaves_its_half(stripe: Stripe, low: float, high: float, bench: Bench) -> bool:
    glass = bench.cover_glass
    below = stripe.through_glass == (glass is not None and glass.side == "low")
    return high > bench.glass_edge_row - MARGIN_PX if below else low < bench.glass_edge_row + MARGIN_PX
