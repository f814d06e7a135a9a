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

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, BoolArray, FloatArray
from gramoscope.quality import NOT_MEASURED, FlagArray, Quality
from gramoscope.signal_path import WallTrace

LEAST_SEEN = 0.2
"""A wall that shows less of a stretch is not believed there."""
REACH = 3
"""So many neighbours on each side take part in a median."""
_NOT_MEASURED, _INTERPOLATED, _SPARSE = (np.uint16(one) for one in (NOT_MEASURED, Quality.INTERPOLATED, Quality.SPARSE))
HAMPEL_GATE = 3.0
"""A sample further from the median than so many times its error and the neighbours' median deviation is an outlier."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Where both walls of one stretch run.

    Attributes
    ----------
    arc_m : float64 array, shape (sample,)
        Even.
    place_m, variance : float64 arrays, shape (2, sample)
        Lateral place of each wall and its variance; NaN where nothing was measured.
    middle_m : float64 array, shape (2, sample)
        Running median of the places.
    suspect : bool array, shape (2, sample)
        See `suspects`.
    share : float64 array, shape (2, sample)
        0 … 1, how much of its information each sample keeps.
    flags : uint16 array, shape (2, sample)
    step_m : float
        From one sample to the next.
    correlation_samples : float
        See `WallTrace`.
    """

    arc_m: FloatArray
    place_m: FloatArray
    variance: FloatArray
    middle_m: FloatArray
    suspect: BoolArray
    share: FloatArray
    flags: FlagArray
    step_m: float
    correlation_samples: float


def stretch_of(trace: WallTrace) -> Stretch:
    """Return the places of a trace; what was not measured is NaN, and flagged so.

    So is a wall of which hardly anything was seen in the whole stretch: what was seen is a guess.
    """
    place, variance, middle = np.empty((3, *trace.flags.shape))
    flags, suspect = trace.flags.copy(), np.empty(trace.flags.shape, np.bool_)
    _look_at(trace.offset_m, trace.offset_sigma_m, place, variance, flags, middle, suspect)
    return Stretch(
        arc_m=trace.arc_start_m + np.arange(trace.flags.shape[1], dtype=np.float64) * trace.arc_step_m,
        place_m=place,
        variance=variance,
        middle_m=middle,
        suspect=suspect,
        share=np.ones(trace.flags.shape),
        flags=flags,
        step_m=trace.arc_step_m,
        correlation_samples=trace.correlation_samples,
    )


@numba.njit(cache=True, nogil=True)
def _look_at(offset_m, sigma_m, place_m, variance, flags, middle_m, suspect):  # type: ignore[no-untyped-def]
    """Write what was measured, its running median, and what disagrees with its neighbours."""
    _measured(offset_m, sigma_m, place_m, variance, flags)
    middle_m[:] = running_median(place_m)
    suspect[:] = suspects(place_m, variance, middle_m)


@numba.njit(cache=True, nogil=True)
def _measured(offset_m, sigma_m, place_m, variance, flags):  # type: ignore[no-untyped-def]
    """Write what was measured of each wall, NaN elsewhere, and flag what was not."""
    walls, size = flags.shape
    for wall in range(walls):
        known = 0
        for i in range(size):
            sigma, offset = sigma_m[wall, i], offset_m[wall, i]
            seen = np.isfinite(offset) and 0 < sigma < np.inf and not flags[wall, i] & _NOT_MEASURED
            place_m[wall, i] = offset if seen else np.nan
            known += seen
        sparse = known < LEAST_SEEN * size
        for i in range(size):
            seen = not np.isnan(place_m[wall, i])
            if seen and sparse:
                flags[wall, i] |= _SPARSE
                place_m[wall, i] = np.nan
            if not seen or sparse:
                flags[wall, i] |= _INTERPOLATED
            variance[wall, i] = np.nan if not seen or sparse else sigma_m[wall, i] ** 2


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
    origin, unseen = np.full((2, 1), np.nan), [0, 1]
    for stretch in stretches:
        for wall in unseen.copy():
            seen = np.flatnonzero(np.isfinite(stretch.place_m[wall]))
            if seen.size:
                origin[wall, 0] = stretch.place_m[wall, seen[0]]
                unseen.remove(wall)
        yield replace(stretch, place_m=stretch.place_m - origin, middle_m=stretch.middle_m - origin)


@numba.njit(cache=True, nogil=True)
def _middle(values, known):  # type: ignore[no-untyped-def]
    """Sort the first so many values and return their median, the lower one of two; NaN if there are none."""
    for i in range(1, known):
        value, j = values[i], i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value
    return values[(known - 1) // 2] if known else np.nan


@numba.njit(cache=True, nogil=True)
def _level(place_m, i, slope, out):  # type: ignore[no-untyped-def]
    """Write the known ones about one sample, a slope taken off, and return how many there are."""
    known = 0
    for k in range(max(i - REACH, 0), min(i + REACH + 1, place_m.size)):
        if np.isfinite(place_m[k]):
            out[known] = place_m[k] - slope * (k - i)
            known += 1
    return known


@numba.njit(cache=True, nogil=True)
def running_median(place_m):  # type: ignore[no-untyped-def]
    """Return the median of each sample and its `REACH` neighbours on each side, NaN left out; shape (2, sample)."""
    out, near = np.empty_like(place_m), np.empty(2 * REACH + 1)
    for wall in range(place_m.shape[0]):
        for i in range(place_m.shape[1]):
            out[wall, i] = _middle(near, _level(place_m[wall], i, 0.0, near))
    return out


@numba.njit(cache=True, nogil=True)
def _neighbours(place_m, middle_m):  # type: ignore[no-untyped-def]
    """Median of each sample and its neighbours and their median deviation, the slope of the course taken off."""
    middle, spread, near = np.empty_like(place_m), np.empty_like(place_m), np.empty(2 * REACH + 1)
    size = place_m.shape[1]
    for wall in range(place_m.shape[0]):
        for i in range(size):
            slope = 0.0
            if REACH <= i < size - REACH:
                slope = (middle_m[wall, i + REACH] - middle_m[wall, i - REACH]) / (2 * REACH)
            # 0 where the course is not known
            known = _level(place_m[wall], i, slope if np.isfinite(slope) else 0.0, near)
            middle[wall, i] = _middle(near, known)
            for k in range(known):
                near[k] = abs(near[k] - middle[wall, i])
            spread[wall, i] = _middle(near, known)
    return middle, spread


@numba.njit(cache=True, nogil=True)
def suspects(place_m, variance, middle_m):  # type: ignore[no-untyped-def]
    """Return which samples disagree with their neighbours; NaN never does.

    Hampel's filter about the running median, with the course's own slope taken off. Where both walls leave their course by
    as much, to the same side or to opposite ones, it is the groove that clicks. For a first look, and for learning: what
    it takes for a sharp bend of one wall it is allowed to lose.
    """
    middle, spread = _neighbours(place_m, middle_m)
    wild = np.empty(place_m.shape, np.bool_)
    _disagree(place_m - middle, spread, variance, wild)
    return wild


@numba.njit(cache=True, nogil=True)
def _disagree(away, spread, variance, wild):  # type: ignore[no-untyped-def]
    """Tell which samples are wild, and not together with the other wall's."""
    for i in range(away.shape[1]):
        inner, outer = away[INNER, i], away[OUTER, i]
        apart = min(abs(inner - outer), abs(inner + outer))
        together = apart < HAMPEL_GATE * np.sqrt(variance[INNER, i] + variance[OUTER, i])
        for wall in range(len(away)):
            known = np.sqrt(variance[wall, i]) + spread[wall, i]
            wild[wall, i] = abs(away[wall, i]) > HAMPEL_GATE * known and not together


def _hand_over(before: Stretch, after: Stretch) -> tuple[Stretch, Stretch]:
    start, end = float(after.arc_m[0]), float(before.arc_m[-1])
    if end <= start:
        return before, after
    shares = before.share.copy(), after.share.copy()
    _fade(before.arc_m, before.step_m, before.place_m, after.arc_m, after.step_m, after.place_m, *shares)
    return replace(before, share=shares[0]), replace(after, share=shares[1])


@numba.njit(cache=True, nogil=True)
def _fade(arc_m, step_m, place_m, next_arc_m, next_step_m, next_place_m, share, next_share):  # type: ignore[no-untyped-def]
    """Lower the shares of two stretches where the other one saw the same wall."""
    start, end = next_arc_m[0], arc_m[-1]
    _lower(share, (end - arc_m) / (end - start), arc_m, step_m, next_arc_m[0], next_place_m)
    _lower(next_share, (next_arc_m - start) / (end - start), next_arc_m, next_step_m, arc_m[0], place_m)


@numba.njit(cache=True, nogil=True)
def _lower(share, fade, arc_m, step_m, other_start_m, other_place_m):  # type: ignore[no-untyped-def]
    """Lower the share of each sample by a fade, where the other stretch saw the same wall."""
    for i in range(arc_m.size):
        nearest = int(np.rint((arc_m[i] - other_start_m) / step_m))
        if 0 <= nearest < other_place_m.shape[1]:
            for wall in range(len(share)):
                if np.isfinite(other_place_m[wall, nearest]):
                    share[wall, i] *= min(max(fade[i], 0.0), 1.0)
