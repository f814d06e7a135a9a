"""One stretch of both walls, and how each hands over to the next where they overlap.

Neighbouring stretches overlap by a twentieth of a millimetre, and what both see there is the same texture: their readings
share most of their errors. Taken for two they would count twice. So over the overlap the first fades out and the second
fades in: each reading keeps a share of its information, both shares adding up to one. Errors that are all shared then weigh
what they should, and errors that are not are claimed too large by at most √2, in the middle of the overlap. A step between
the two becomes a ramp, which is a much smaller error of velocity; and the ends of a stretch, where its reading is worst,
count least. Where one of the two saw nothing the other keeps its whole weight.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.quality import NOT_MEASURED, FlagArray
from gramoscope.signal_path import WallTrace


@dataclass(frozen=True, eq=False)
class Stretch:
    """Where both walls of one stretch run.

    Attributes
    ----------
    arc_m : float64 array, shape (sample,)
        Even.
    place_m, variance : float64 arrays, shape (2, sample)
        Lateral place of each wall and its variance; NaN where nothing was measured.
    share : float64 array, shape (2, sample)
        0 … 1, how much of its information each sample keeps.
    flags : uint16 array, shape (2, sample)
    correlation_samples : float
        See `WallTrace`.
    """

    arc_m: FloatArray
    place_m: FloatArray
    variance: FloatArray
    share: FloatArray
    flags: FlagArray
    correlation_samples: float


def stretch_of(trace: WallTrace) -> Stretch:
    """Return the places of a trace; what was not measured is NaN, and flagged so."""
    flagged = (trace.flags & np.uint16(NOT_MEASURED)) != 0
    seen = np.isfinite(trace.offset_m) & (trace.offset_sigma_m > 0) & np.isfinite(trace.offset_sigma_m) & ~flagged
    return Stretch(
        arc_m=trace.arc_start_m + np.arange(trace.flags.shape[1], dtype=np.float64) * trace.arc_step_m,
        place_m=np.where(seen, trace.offset_m, np.nan),
        variance=np.where(seen, trace.offset_sigma_m**2, np.nan),
        share=np.ones(trace.flags.shape),
        flags=np.where(seen, trace.flags, trace.flags | np.uint16(NOT_MEASURED)).astype(np.uint16),
        correlation_samples=trace.correlation_samples,
    )


def handed_over(stretches: Iterable[Stretch]) -> Iterator[Stretch]:
    """Return the same stretches with their shares in the overlaps with their neighbours; one is held back."""
    held: Stretch | None = None
    for stretch in stretches:
        if held is None:
            held = stretch
            continue
        before, held = _hand_over(held, stretch)
        yield before
    if held is not None:
        yield held


def counted_from_the_start(stretches: Iterable[Stretch]) -> Iterator[Stretch]:
    """Return the same stretches with each wall's places counted from where it was first seen."""
    origin = np.full((2, 1), np.nan)
    for stretch in stretches:
        for wall in np.flatnonzero(np.isnan(origin[:, 0]) & np.isfinite(stretch.place_m).any(axis=1)):
            seen = stretch.place_m[wall]
            origin[wall, 0] = seen[np.flatnonzero(np.isfinite(seen))[0]]
        yield replace(stretch, place_m=stretch.place_m - origin)


def _hand_over(before: Stretch, after: Stretch) -> tuple[Stretch, Stretch]:
    start, end = float(after.arc_m[0]), float(before.arc_m[-1])
    if end <= start:
        return before, after
    fade_out, fade_in = ((end - before.arc_m) / (end - start), (after.arc_m - start) / (end - start))
    return _faded(before, fade_out, after), _faded(after, fade_in, before)


def _faded(stretch: Stretch, fade: FloatArray, other: Stretch) -> Stretch:
    """The stretch with its share lowered wherever the other saw the same wall."""
    step = stretch.arc_m[1] - stretch.arc_m[0] if stretch.arc_m.size > 1 else 1.0
    nearest = np.rint((stretch.arc_m - other.arc_m[0]) / step).astype(np.int64)
    there = (nearest >= 0) & (nearest < other.arc_m.size)
    seen = np.isfinite(other.place_m[:, np.clip(nearest, 0, other.arc_m.size - 1)]) & there
    return replace(stretch, share=np.where(seen, stretch.share * np.clip(fade, 0.0, 1.0), stretch.share))
