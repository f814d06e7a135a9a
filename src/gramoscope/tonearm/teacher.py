"""Who teaches the smoother of places: stretches in, each with what is to be believed of the groove where it lies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, tee
from typing import get_args

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Direction
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.groove_model import Beliefs, GrooveModel, agitation, beginning, beliefs, moves, robustly
from gramoscope.tonearm.groove_prior import GroovePrior
from gramoscope.tonearm.learn_groove import Lesson, PriorLimits, learn, lessons
from gramoscope.tonearm.level import (
    OneDirection,
    Walls,
    bend_power,
    calmed,
    claim_error,
    levels,
    one_direction,
    trusted,
)
from gramoscope.tonearm.place_samples import PlaceSamples, samples_of
from gramoscope.tonearm.stretches import Stretch

DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
BEYOND_SOUND_HZ = 28e3
"""Where errors are compared with what they claim: no sound reaches so far, yet errors are those that sound has to bear."""
READING_S = 10e-6
"""How long the samples last whose mean is one reading for the learning of a prior; at 10 kHz it takes off a thirtieth of the
power."""

Priors = tuple[GroovePrior, GroovePrior]
Levelled = tuple[Stretch, FloatArray]


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
        while batch := list(islice(levelled, self.teaching.groups)):
            before, error = self._learn(batch, before)
            believed = beliefs(before, self.step_m)
            for claimed, level in batch:
                samples = samples_of(_put_right(claimed, error), self.step_m)
                model = believed.model(int(samples.bin[0]), level)
                yield samples, replace(model, agitation=self._agitation(model, samples))

    def _agitation(self, model: GrooveModel, samples: PlaceSamples) -> FloatArray:
        first = model.from_bin
        fresh = samples.part(samples.measured(first, int(samples.bin[-1]) + 1))
        readings = fresh.readings(first_bin=first, step_m=self.step_m, gains=self.course.gains)
        return agitation(model, readings, ~fresh.suspect)

    def _levelled(self, stretches: Iterator[Stretch]) -> Iterator[Levelled]:
        """Return each stretch with its level in both directions."""
        one, other = tee(stretches)
        yield from zip(one, levels(map(self._powers, other)), strict=True)

    def _seen(self, walls: Walls, direction: Direction) -> OneDirection:
        return one_direction(walls, direction, self.course.gains, listening=direction == self.course.direction)

    def _powers(self, stretch: Stretch) -> FloatArray:
        seen = (self._seen(calmed(stretch), name) for name in DIRECTIONS)
        return np.array([bend_power(one, self.step_m) for one in seen])

    def _learn(self, batch: Sequence[Levelled], before: Priors | None) -> tuple[Priors, float]:
        """Return what to believe of both directions, and how many times as large as claimed the errors are."""
        speed_m_s = float(self.course.rotation.speed_at_m_s(float(batch[0][0].arc_m[0])))
        limits = [self._limits(name, speed_m_s) for name in DIRECTIONS]
        half_period, reading = (
            max(1, round(time_s * speed_m_s / self.step_m)) for time_s in (0.5 / BEYOND_SOUND_HZ, READING_S)
        )
        believed = beliefs(before or (limits[0].middle, limits[1].middle), self.step_m)
        cleaned = [(self._cleaned(believed, stretch, level), level) for stretch, level in batch]
        # an error that neighbours share does not show in their differences: such a claim is believed
        error = claim_error((trusted(s) for s, _ in cleaned if s.correlation_samples == 1), half_period)
        teachers = [(_put_right(stretch, error), level) for stretch, level in cleaned]
        lateral, vertical = (
            learn(
                lessons(
                    (
                        Lesson(self._seen(trusted(s), name), float(level[i]), s.correlation_samples)
                        for s, level in teachers
                    ),
                    self.step_m,
                    block=reading,
                ),
                limits[i],
                before=before[i] if before else None,
            )
            for i, name in enumerate(DIRECTIONS)
        )
        return (lateral, vertical), error

    def _cleaned(self, believed: Beliefs, stretch: Stretch, level: FloatArray) -> Stretch:
        """The stretch with all those samples suspect that the others contradict, by what was believed so far."""
        samples = samples_of(stretch, self.step_m)
        first, stop = int(samples.bin[0]), int(samples.bin[-1]) + 1
        model = believed.model(first, level)
        measured = samples.measured(first, stop)
        fresh = samples.part(measured)
        followed = robustly(
            moves([model], first, stop),
            fresh.readings(first_bin=first, step_m=self.step_m, gains=self.course.gains),
            ~fresh.suspect,
            beginning(model, first),
            gate=self.gate,
            resume_bin=first,
        )
        suspect = samples.suspect.copy()
        suspect[measured] = ~followed.accepted
        return replace(stretch, suspect=suspect.reshape(2, -1, order="F"))

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


def _put_right(stretch: Stretch, error: float) -> Stretch:
    """The stretch with errors that are so many times as large as it claims."""
    return replace(stretch, variance=error**2 * stretch.variance)
