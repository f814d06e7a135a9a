"""Who teaches the smoother of places: stretches in, each with what is to be believed of the groove where it lies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice, tee
from typing import get_args

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.tonearm.batch import Batch, batch_of
from gramoscope.tonearm.cleaning import agitations, contradicted
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.groove_model import GrooveModel, beliefs
from gramoscope.tonearm.groove_prior import GroovePrior
from gramoscope.tonearm.learn_groove import Lessons, PriorLimits, learn, lessons
from gramoscope.tonearm.level import bend_powers, claim_error, levels, one_direction
from gramoscope.tonearm.place_samples import PlaceSamples
from gramoscope.tonearm.stretches import Stretch

DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
BEYOND_SOUND_HZ = 28e3
"""Where errors are compared with what they claim: no sound reaches so far, yet errors are those that sound has to bear."""
READING_S = 10e-6
"""How long the samples last whose mean is one reading for the learning of a prior; at 10 kHz it takes off a thirtieth of the
power."""

Priors = tuple[GroovePrior, GroovePrior]


@dataclass(frozen=True)
class Teaching:
    """How priors are learned; see `tonearm.places.PlaceSmoother`."""

    groups: int
    corner_limits_hz: tuple[float, float]
    cutoff_limits_hz: tuple[float, float]
    width_limits_hz: tuple[float, float]
    usual_width_hz: float
    floor_m_s: float
    other_floor_m_s: float


@dataclass(frozen=True)
class Teacher:
    """Finds out what to believe of one groove, on one grid.

    Parameters
    ----------
    course : Course
    step_m : float
        Of the grid.
    teaching : Teaching
    gate : float
        Samples further than this many standard errors from what the others say teach nothing.
    """

    course: Course
    step_m: float
    teaching: Teaching
    gate: float

    def taught(self, stretches: Iterator[Stretch]) -> Iterator[tuple[PlaceSamples, GrooveModel]]:
        """Return the samples of each stretch with what is believed of the groove from the first of them on."""
        before: Priors | None = None
        levelled = self._levelled(stretches)
        while some := list(islice(levelled, self.teaching.groups)):
            claimed = batch_of(some, self.step_m)
            before, error = self._learn(claimed, before)
            believed, batch = beliefs(before, self.step_m), claimed.put_right(error)
            restless = agitations(batch, believed, self.course.gains)
            first_bins = batch.first_bin.tolist()
            for i, samples in enumerate(batch.samples()):
                yield samples, replace(believed.model(first_bins[i], batch.level[i]), agitation=restless[i])

    def _levelled(self, stretches: Iterator[Stretch]) -> Iterator[tuple[Stretch, FloatArray]]:
        """Return each stretch with its level in both directions."""
        one, other = tee(stretches)
        yield from zip(one, levels(map(self._powers, other)), strict=True)

    def _powers(self, stretch: Stretch) -> FloatArray:
        return bend_powers(
            stretch.middle_m,
            stretch.variance,
            self.course.gains,
            listened=self.course.direction,
            step_m=self.step_m,
            correlation_samples=stretch.correlation_samples,
        )

    def _learn(self, claimed: Batch, before: Priors | None) -> tuple[Priors, float]:
        """Return what to believe of both directions, and how many times as large as claimed the errors are."""
        speed_m_s = float(self.course.rotation.speed_at_m_s(float(claimed.arc_start_m[0])))
        limits = [self._limits(name, speed_m_s) for name in DIRECTIONS]
        half_period, reading = (
            max(1, round(time_s * speed_m_s / self.step_m)) for time_s in (0.5 / BEYOND_SOUND_HZ, READING_S)
        )
        believed = beliefs(before or (limits[0].middle, limits[1].middle), self.step_m)
        cleaned = replace(claimed, suspect=contradicted(claimed, believed, self.course.gains, gate=self.gate))
        # an error that neighbours share does not show in their differences: such a claim is believed
        alone = claimed.correlation_samples == 1
        error = claim_error(cleaned.trusted_m[alone], cleaned.variance[alone], half_period)
        lateral, vertical = (
            learn(
                self._lessons(cleaned.put_right(error), i, block=reading),
                limits[i],
                before=before[i] if before else None,
            )
            for i in range(len(DIRECTIONS))
        )
        return (lateral, vertical), error

    def _lessons(self, batch: Batch, direction: int, *, block: int) -> Lessons | None:
        """What the trusted samples of a batch teach of one direction."""
        name = DIRECTIONS[direction]
        seen = one_direction(
            batch.trusted_m,
            batch.variance,
            name,
            self.course.gains,
            listening=name == self.course.direction,
            size=batch.size,
        )
        return lessons(seen, batch.level[:, direction], batch.correlation_samples, self.step_m, block=block)

    def _limits(self, direction: Direction, speed_m_s: float) -> PriorLimits:
        mine = direction == self.course.direction
        floor = self.teaching.floor_m_s if mine else self.teaching.other_floor_m_s
        corner, cutoff, width = (
            (2 * np.pi * low / speed_m_s, 2 * np.pi * high / speed_m_s)
            for low, high in (
                self.teaching.corner_limits_hz,
                self.teaching.cutoff_limits_hz,
                self.teaching.width_limits_hz,
            )
        )
        return PriorLimits(
            floor / speed_m_s, corner, cutoff, width, 2 * np.pi * self.teaching.usual_width_hz / speed_m_s
        )
