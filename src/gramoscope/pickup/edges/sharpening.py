"""The place of an edge in every column, from its coarse course, by the profile that it shows.

Round by round, the profile is learned along the course; every column says how far off the course its own pixels put the
edge (`column_places`: one step, linear in the pixels, so that errors are those of the pixels and not of a search); and the
smoothest course that these places allow is laid through them (`steady_course`). When the course has settled, a place is the
course plus what its own column says: a measurement of that column, not drawn towards its neighbours.

A column that has lost most of what it could tell to dust, or disagrees with its surroundings, is not measured: the smooth
course stands in for it, with the error of a bridge.

A loud and clean edge may be lost on the way: its coarse course hardly swings, and what lies beyond the rows that are looked at
draws it nowhere. So a course that was found is looked at once more in a wider band. If that moves it the edge is looked for
anew from what a wide band says of the coarse course, and the course whose places are much surer is the one that follows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.errors import require
from gramoscope.pickup.edges.column_places import ColumnPlaces, column_places
from gramoscope.pickup.edges.edge_band import EdgeBand, edge_band
from gramoscope.pickup.edges.edge_profile import EdgeProfile, learn_profile
from gramoscope.pickup.edges.halo import NO_HALO, Halo
from gramoscope.pickup.edges.pooling import Pooled, pool_columns, pooled
from gramoscope.pickup.edges.steady_course import FEWEST_PLACES, SteadyCourse, left_by_course, steady_course
from gramoscope.quality import FlagArray, Quality, no_flags
from gramoscope.signal_path import StillPicture

MAD_TO_SIGMA = 1.4826
COARSE_SIGMA_PX = 3.0
"""Error of the coarse course."""
GREATEST_STEP_PX = 2.5
"""In one round no column moves its place by more."""
GUIDE_SIGMA_PX = 2.5
"""Error of the coarse course where nothing else leads."""
MOVED = 0.05
"""A course that a wider band moves by less than this share of the narrow one, in 95 of 100 columns, is not doubted."""
SURER = 0.7
"""One that was found anew is taken if its places are surer than this share of the others' errors; right ones differ by 0.05."""
LEAST_SIGMA_PX = 1e-3
"""No place is claimed to be known better than this."""
LEAST_LEFT = 0.25
"""A course that leaves less than this share of the errors to be seen tells nothing of them."""
LEAST_SHARE = 0.02
"""An edge that is seen in less than this share of the columns is not seen."""


@dataclass(frozen=True)
class Reach:
    """Which rows beside the course of an edge are looked at.

    Attributes
    ----------
    half_px : int
        So many on each side.
    wide_px : int
        So many on each side hold no other edge; no wider band is looked at if they are no more than `half_px`.
    crowded : bool
        Whether a neighbouring edge shows in them.
    """

    half_px: int
    wide_px: int = 0
    crowded: bool = False


@dataclass(frozen=True, eq=False)
class SharpEdge:
    """An edge, column by column.

    Attributes
    ----------
    row_px, row_sigma_px : float64 arrays, shape (column,)
        Where it was not measured, the smooth course and its error; NaN where there is no edge to follow.
    flags : uint16 array, shape (column,)
    correlation_samples : float
        How many neighbouring columns share one error.
    """

    row_px: FloatArray
    row_sigma_px: FloatArray
    flags: FlagArray
    correlation_samples: float


@dataclass(frozen=True, eq=False)
class _Subject:
    """An edge to be looked at."""

    picture: StillPicture
    wall: int
    burnt: int
    halo: Halo
    line: bool
    reach: Reach
    inside: BoolArray
    guide: FloatArray

    def band(self, row: FloatArray, half_px: int) -> EdgeBand:
        """So many rows on each side of a course."""
        return edge_band(self.picture, row, wall=self.wall, half_px=half_px, burnt=self.burnt, halo=self.halo)


@dataclass(frozen=True, eq=False)
class _Round:
    """One round of looking."""

    band: EdgeBand
    profile: EdgeProfile
    places: ColumnPlaces
    course: SteadyCourse
    row: FloatArray
    variance: FloatArray
    measured: BoolArray
    settled: SteadyCourse


@dataclass(frozen=True)
class Sharpening:
    """How places are found.

    Parameters
    ----------
    rounds : int
        Rounds of learning and looking.
    dust_gate : float
        A pixel so many standard deviations off the profile is dust.
    column_gate : float
        A place so many standard errors off the smooth course is an outlier.
    most_lost : float
        A column that has lost more of its information than this share is not measured.
    most_pooled : float
        Largest standard deviation, in columns, of the window over which places are pooled where the edge allows it
        (`pooling`); 0 keeps every column to itself.
    least_amplitude : float
        Where less of the profile is seen than this there is no edge.
    """

    rounds: int = 6
    dust_gate: float = 4.0
    column_gate: float = 4.0
    most_lost: float = 0.5
    most_pooled: float = 2.0
    least_amplitude: float = 0.3

    def __post_init__(self) -> None:
        require(self.rounds >= 2, f"{self.rounds} rounds of looking", "at least two")
        for name in ("dust_gate", "column_gate"):
            require(getattr(self, name) > 2, f"{name} is {getattr(self, name)}", "above 2 standard errors")
        require(0 < self.most_lost < 1, f"most_lost is {self.most_lost}", "between 0 and 1")
        require(self.most_pooled >= 0, f"most_pooled is {self.most_pooled} columns", "0 or more")
        require(0 <= self.least_amplitude < 1, f"least_amplitude is {self.least_amplitude}", "from 0, below 1")

    def sharpen(
        self,
        picture: StillPicture,
        coarse: FloatArray,
        *,
        wall: int,
        reach: Reach,
        burnt: int,
        halo: Halo = NO_HALO,
        line: bool = False,
    ) -> SharpEdge | None:
        """Return the place of an edge in every column.

        Parameters
        ----------
        picture : StillPicture
        coarse : float64 array, shape (column,)
            Its course, to a few pixels.
        wall : int
            `INNER` or `OUTER`.
        reach : Reach
        burnt : int
            From this pixel value on a pixel is burnt.
        halo : Halo
            How far what is burnt brightens its surroundings.
        line : bool
            Whether it is a lone line, with the same on both sides; then its place is that of the line.

        Returns
        -------
        SharpEdge or None
            None where hardly a column shows the edge.
        """
        inside = (coarse > 0) & (coarse < picture.image.shape[0] - 1)
        if np.count_nonzero(inside) < max(FEWEST_PLACES, LEAST_SHARE * coarse.size):
            return None
        coarsely = steady_course(coarse, np.full(coarse.size, COARSE_SIGMA_PX**-2))
        subject = _Subject(picture, wall, burnt, halo, line, reach, inside, coarsely.row)
        seen = self._followed(subject, coarsely)
        if seen is not None and reach.wide_px > reach.half_px:
            seen = self._surest(subject, coarsely, seen)
        return None if seen is None else self._edge(seen, inside)

    def _followed(self, subject: _Subject, course: SteadyCourse) -> _Round | None:
        """The last of all rounds, from a course on; None when hardly anything is measured."""
        seen, kept = None, None
        for number in range(self.rounds):
            band = subject.band(course.row, subject.reach.half_px)
            last, gated = number == self.rounds - 1, number >= self.rounds // 2
            seen = self._look(subject, band, course, kept, last=last, gated=gated)
            if seen is None:
                return None
            kept, course = seen.places.kept, seen.settled
        return seen

    def _surest(self, subject: _Subject, coarse: SteadyCourse, seen: _Round) -> _Round:
        """What was seen, or what is seen from another start if that is much surer."""
        half_px, wide_px = subject.reach.half_px, subject.reach.wide_px

        def widely(course: SteadyCourse) -> SteadyCourse | None:
            band, most_px = subject.band(course.row, wide_px), GREATEST_STEP_PX * wide_px / half_px
            found = self._look(subject, band, course, None, most_step_px=most_px)
            return None if found is None else found.settled

        there = widely(seen.settled)
        moved = 0.0 if there is None else np.quantile(np.abs(there.row - seen.settled.row)[subject.inside], 0.95)
        start = widely(coarse) if moved > MOVED * half_px else None
        anew = None if start is None else self._followed(subject, start)
        if anew is None or np.median(anew.variance) > SURER**2 * np.median(seen.variance):
            return seen
        return anew

    def _look(
        self,
        subject: _Subject,
        band: EdgeBand,
        course: SteadyCourse,
        kept: BoolArray | None,
        *,
        last: bool = False,
        gated: bool = False,
        most_step_px: float = GREATEST_STEP_PX,
    ) -> _Round | None:
        """One round: profile, places, course; None when hardly anything is measured."""
        profile = learn_profile(band, band.usable if kept is None else kept & band.usable, line=subject.line)
        places = column_places(
            band, profile, band.usable, dust_gate=self.dust_gate, settled=last, crowded=subject.reach.crowded
        )
        step = np.clip(places.step, -most_step_px, most_step_px)
        # a column that leaves its edge anywhere in the band says nothing
        seen = subject.inside & (places.lost < self.most_lost) & (places.variance < (0.25 * band.level.shape[1]) ** 2)
        seen &= profile.amplitude > self.least_amplitude
        if np.count_nonzero(seen) < max(FEWEST_PLACES, LEAST_SHARE * seen.size):
            return None
        variance = np.maximum(np.where(seen, places.variance, 1.0), LEAST_SIGMA_PX**2)
        shared = 1 + 2 * places.likeness[1:].sum()
        if last:
            # judged on a course that has followed part of the errors
            usual = float(np.median(variance[seen])) * shared
            variance = variance / max(left_by_course(places.likeness, 1 / usual, course.stiffness), LEAST_LEFT)
        if gated:
            scale = _scale(step[seen] / np.sqrt(variance[seen]))
            seen &= np.abs(places.step) < self.column_gate * np.sqrt(scale**2 * variance + course.variance)
        row = course.row + band.towards_land * (step + profile.middle_px)
        weight = seen / (variance * shared)
        if last:
            # as stiff as before: noise that is judged more strictly now is no reason to follow less
            settled = steady_course(row, weight, stiffness=course.stiffness)
        else:
            # where nothing is measured the coarse course leads, so that it can be found again
            leading = subject.inside & ~seen & ~band.burnt.any(axis=1)
            settled = steady_course(
                np.where(leading, subject.guide, row), np.where(leading, GUIDE_SIGMA_PX**-2, weight)
            )
        return _Round(band, profile, places, course, row, variance, seen, settled)

    def _edge(self, last: _Round, inside: BoolArray) -> SharpEdge:
        measured, bridge = last.measured, last.settled
        found = self._pooled(last)
        row = bridge.row + np.where(measured, found.value, 0.0)
        sigma = np.sqrt(np.where(measured, found.variance, bridge.variance))
        nowhere = ~inside | (sigma > last.band.level.shape[1])
        row[nowhere], sigma[nowhere] = np.nan, np.nan
        return SharpEdge(row, sigma, self._flags(last, inside), found.correlation_samples)

    def _pooled(self, last: _Round) -> Pooled:
        """Deviations from the last course, pooled as far as it allows."""
        shared = 1 + 2 * last.places.likeness[1:].sum()
        weight = 1 / float(np.median(last.variance[last.measured]) * shared)
        columns = pool_columns(weight, last.settled.stiffness, most=self.most_pooled)
        off = last.row - last.settled.row
        scale = _scale(off[last.measured] / np.sqrt(last.variance[last.measured]))
        return pooled(off, scale**2 * last.variance, last.measured, last.places.likeness, columns=columns)

    def _flags(self, last: _Round, inside: BoolArray) -> FlagArray:
        """Why a column was not measured."""
        lost = last.places.lost >= self.most_lost
        burnt = lost & (last.band.burnt.mean(axis=1) > 0.2)
        nothing = ~inside | (last.profile.amplitude <= self.least_amplitude)
        flags = no_flags(last.row.size)
        flags[nothing] |= np.uint16(Quality.NO_STRIPE)
        flags[burnt & ~nothing] |= np.uint16(Quality.SATURATED)
        flags[~burnt & ~nothing] |= np.uint16(Quality.OUTLIER)
        flags[~last.measured] |= np.uint16(Quality.INTERPOLATED)
        flags[last.measured] = 0
        return flags


def _scale(pull: FloatArray) -> float:
    """By how much places scatter about their course more than their errors say: the edge itself may be ragged."""
    return max(1.0, MAD_TO_SIGMA * float(np.median(np.abs(pull))))
