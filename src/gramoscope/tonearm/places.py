"""Smoothing places: both walls of the whole passage together, in both directions.

The state of the groove at each bin of an even grid is that of `tonearm.groove_prior` for the lateral displacement a and for
the vertical one h. With its wall at the angle φ, a sample of the inner wall reads a − h cot φ and one of the outer wall
a + h cot φ, each up to a constant of its own, which a and h take up where they start. So two walls give both directions; one
alone carries on with the other direction held by its prior; where both are missing the groove drifts on as the prior lets
it, with an error that says so. Each sample goes to its nearest bin, over the fraction of a step between them by Taylor's
series.

*Outliers.* A first pass rejects what is further than the gate from its prediction; while it rejects, its error grows as fast
as grooves move, so it cannot lose the groove for good. Smoothed backwards, that tells of each sample how far it lies from
what all others say, and by this it is accepted or rejected once more, for the second pass that counts. So what was rejected
because the prediction was bad comes back.

*The prior* is learned anew from every `learn_groups` groups: records begin in silence and get loud.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import get_args

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.disc.formats import Direction
from gramoscope.errors import require
from gramoscope.quality import FlagArray
from gramoscope.signal_path import GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.grid_flags import OUTLIER, grid_flags
from gramoscope.tonearm.groove_prior import SLOPE, STATES, GroovePrior, taylor
from gramoscope.tonearm.learn_groove import PriorLimits, learn, one_direction, one_wall
from gramoscope.tonearm.linear_gaussian import Moves, Readings, Smoothed, backward, forward
from gramoscope.tonearm.stretches import Stretch, counted_from_the_start, handed_over, stretch_of

DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
ANYWHERE_M = 1e-3
"""How little is known of where a passage begins."""
TEACHERS = 8
"""So many stretches of those that a prior is learned from are looked at."""
BOTH_WALLS = 0.1
"""A stretch that shows both walls over less than this share teaches by its best wall alone."""
UNOBSERVABLE = 0.95
"""With this share of the prior's sigma left, nothing is known of a direction."""
LEAST_SHARE = 1e-3
"""Samples that keep less of their information are left out."""


@dataclass(frozen=True)
class PlaceSmoother:
    """How the tonearm smooths places.

    Parameters
    ----------
    learn_groups : int
        The prior is learned anew from every so many groups.
    block_groups : int
        The smoother runs backwards each time so many groups have come.
    lookahead : float
        How far behind the newest sample it answers, in units of 1/λ, the length along which the prior forgets.
    gate : float
        A sample further than this many standard errors from what the others say is an outlier and gets no weight.
    corner_limits_hz, cutoff_limits_hz : (float, float)
        Least and largest corner λV/2π and cut-off μV/2π that the music may have.
    floor_m_s : float
        Least velocity (standard deviation) that the prior expects of the direction that is listened to.
    other_floor_m_s : float
        The same of the other direction.
    """

    learn_groups: int = 64
    block_groups: int = 16
    lookahead: float = 20.0
    gate: float = 5.0
    corner_limits_hz: tuple[float, float] = (300.0, 20_000.0)
    cutoff_limits_hz: tuple[float, float] = (3_000.0, 60_000.0)
    floor_m_s: float = 2e-3
    other_floor_m_s: float = 2e-4

    def __post_init__(self) -> None:
        require(self.learn_groups >= 1 and self.block_groups >= 1, "groups in a block are counted from 1", "1 or more")
        require(self.lookahead > 0, f"a lookahead of {self.lookahead}", "above 0")
        require(self.gate > 1, f"a gate of {self.gate} standard errors", "above 1")
        for floor in (self.floor_m_s, self.other_floor_m_s):
            require(0 < floor < 0.5, f"a floor of {floor} m/s", "above 0, below 0.5")
        for low, high in (self.corner_limits_hz, self.cutoff_limits_hz):
            require(0 < low < high, f"limits of {low} … {high} Hz", "two rising frequencies")

    def follow(self, traces: Iterable[WallTrace], course: Course) -> Iterator[GrooveMotion]:
        """Smooth the places of spliced stretches.

        Parameters
        ----------
        traces : iterable of WallTrace
            See `Tonearm.follow`; `offset_m` and `offset_sigma_m` are read, and NaN or flagged samples left out.
            `learn_groups` of them are held at a time and what the lookahead needs, without their textures.
        course : Course

        Yields
        ------
        GrooveMotion
            Both directions. The one that is not listened to is NaN where nothing can be known of it.
        """
        stream = iter(traces)
        first = next(stream, None)
        if first is None:
            return
        follower = _PlaceFollower(self, course, first.arc_step_m)
        stretches = counted_from_the_start(stretch_of(trace) for trace in chain([first], stream))
        yield from follower.blocks(follower.taught(handed_over(stretches)))


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples of either wall that were heard and not yet answered, one after the other."""

    arc_m: FloatArray
    wall: IntArray
    place_m: FloatArray
    variance: FloatArray
    gate_variance: FloatArray
    flags: FlagArray

    @staticmethod
    def empty() -> _Samples:
        numbers = np.empty(0)
        return _Samples(numbers, np.empty(0, np.int64), numbers, numbers, numbers, np.empty(0, np.uint16))

    def with_stretch(self, stretch: Stretch) -> _Samples:
        keep = np.maximum(stretch.share, LEAST_SHARE)
        seen = np.where(stretch.share > LEAST_SHARE, stretch.place_m, np.nan)
        walls = np.repeat(np.arange(2)[:, None], stretch.arc_m.size, axis=1)
        new = _Samples(
            np.broadcast_to(stretch.arc_m, seen.shape).ravel(order="F"),
            walls.ravel(order="F"),
            seen.ravel(order="F"),
            (stretch.variance * stretch.correlation_samples / keep).ravel(order="F"),
            stretch.variance.ravel(order="F"),
            stretch.flags.ravel(order="F"),
        )
        return self.joined(new)

    def joined(self, new: _Samples) -> _Samples:
        return _Samples(
            np.concatenate([self.arc_m, new.arc_m]),
            np.concatenate([self.wall, new.wall]),
            np.concatenate([self.place_m, new.place_m]),
            np.concatenate([self.variance, new.variance]),
            np.concatenate([self.gate_variance, new.gate_variance]),
            np.concatenate([self.flags, new.flags]),
        )

    def part(self, keep: BoolArray | IntArray) -> _Samples:
        return _Samples(
            self.arc_m[keep],
            self.wall[keep],
            self.place_m[keep],
            self.variance[keep],
            self.gate_variance[keep],
            self.flags[keep],
        )


@dataclass(frozen=True, eq=False)
class _Model:
    """What is believed of both directions from a bin on."""

    from_bin: int
    priors: tuple[GroovePrior, ...]
    a: FloatArray
    q: FloatArray


@dataclass(frozen=True, eq=False)
class _State:
    """Where both passes go on: mean and covariance at a bin, before its samples."""

    bin: int
    mean: tuple[FloatArray, FloatArray]
    covariance: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class _PlaceFollower:
    """A smoother over one groove, on one grid."""

    smoother: PlaceSmoother
    course: Course
    step_m: float

    @property
    def gains(self) -> FloatArray:
        """How far each wall moves outwards in the picture when the groove rises by one."""
        return np.array([-1.0, 1.0]) / np.tan(self.course.wall_angles_rad)

    def taught(self, stretches: Iterator[Stretch]) -> Iterator[tuple[Stretch, _Model]]:
        """Return each stretch with the model of the batch it belongs to."""
        before: tuple[GroovePrior | None, ...] = (None, None)
        while batch := list(islice(stretches, self.smoother.learn_groups)):
            before = priors = tuple(self._learn(batch, d, prior) for d, prior in zip(DIRECTIONS, before, strict=True))
            steps = [prior.steps(self.step_m) for prior in priors]
            model = _Model(
                self._bin(batch[0].arc_m[0]), priors, np.stack([a for a, _ in steps]), np.stack([q for _, q in steps])
            )
            yield from ((stretch, model) for stretch in batch)

    def _learn(self, batch: list[Stretch], direction: Direction, before: GroovePrior | None) -> GroovePrior:
        count = min(TEACHERS, len(batch))
        teachers = [batch[i] for i in np.linspace(0, len(batch) - 1, count).round().astype(int)]
        courses = []
        for stretch in teachers:
            seen = one_direction(stretch, direction, self.gains)
            if direction == self.course.direction and seen.known < BOTH_WALLS * stretch.arc_m.size:
                seen = one_wall(stretch, direction, self.gains)
            courses.append(seen)
        return learn(courses, self.step_m, self._limits(direction, teachers[0].arc_m[0]), start=before)

    def _limits(self, direction: Direction, arc_m: float) -> PriorLimits:
        speed = float(self.course.rotation.speed_at_m_s(arc_m))
        smoother = self.smoother
        floor = smoother.floor_m_s if direction == self.course.direction else smoother.other_floor_m_s
        corner, cutoff = (
            (2 * np.pi * low / speed, 2 * np.pi * high / speed)
            for low, high in (smoother.corner_limits_hz, smoother.cutoff_limits_hz)
        )
        return PriorLimits((floor / speed, 1.0), corner, cutoff)

    def _bin(self, arc_m: float) -> int:
        return int(np.rint(arc_m / self.step_m))

    def blocks(self, stretches: Iterator[tuple[Stretch, _Model]]) -> Iterator[GrooveMotion]:
        """Answer bin after bin, some way behind the newest stretch."""
        samples, models, done, last, state = _Samples.empty(), list[_Model](), 0, 0, None
        current = next(stretches, None)
        while current is not None:
            taken = 0
            while current is not None and taken < self.smoother.block_groups:
                stretch, model = current
                samples, last = samples.with_stretch(stretch), max(last, self._bin(stretch.arc_m[-1]))
                models = models if models and models[-1] is model else [*models, model]
                current, taken = next(stretches, None), taken + 1
            if state is None:
                state = self._start(models[0], min(0, self._bin(samples.arc_m[0])))
            if current is None:
                heard = max(last, int(np.floor(self.course.passage_length_m / self.step_m)))
                stop = heard + 1
            else:
                heard = self._bin(current[0].arc_m[0]) - 1
                stop = heard + 1 - self._lookahead(models)
            if stop > done:
                motion, state, samples = self._answer(samples, models, state, (done, stop, heard + 1))
                yield motion
                models = [m for m, after in zip(models, [*models[1:], None], strict=True) if not _over(after, stop)]
                done = stop

    def _lookahead(self, models: list[_Model]) -> int:
        slowest = min(prior.corner_per_m for model in models for prior in model.priors)
        return int(np.ceil(self.smoother.lookahead / slowest / self.step_m))

    def _start(self, model: _Model, first: int) -> _State:
        covariance = np.zeros((2 * STATES, 2 * STATES))
        for i, prior in enumerate(model.priors):
            part = slice(i * STATES, (i + 1) * STATES)
            covariance[part, part] = prior.rest(self.step_m, place_sigma_m=ANYWHERE_M)
        mean = np.zeros(2 * STATES)
        return _State(first, (mean, mean), (covariance, covariance))

    def _answer(
        self, samples: _Samples, models: list[_Model], state: _State, bins: tuple[int, int, int]
    ) -> tuple[GrooveMotion, _State, _Samples]:
        """Answer bins[0] … bins[1] − 1 by all samples before bins[2]; return what is needed to go on."""
        start, stop, end = bins
        place = np.rint(samples.arc_m / self.step_m).astype(np.int64)
        fresh = np.flatnonzero(np.isfinite(samples.place_m) & (place >= state.bin) & (place < end))
        fresh = fresh[np.argsort(place[fresh], kind="stable")]
        readings = self._readings(samples.part(fresh), place[fresh], state.bin)
        moves = _moves(models, np.arange(state.bin, end))
        smoothed, state, rejected = self._two_passes(moves, readings, state, stop)
        outlier = np.zeros(place.size, np.bool_)
        outlier[fresh] = rejected
        flags = np.where(outlier, samples.flags | OUTLIER, samples.flags).astype(np.uint16)
        grid = np.arange(start, stop, dtype=np.float64) * self.step_m
        answered = slice(smoothed.mean.shape[0] - (end - start), smoothed.mean.shape[0] - (end - stop))
        motion = self._motion(
            grid,
            smoothed.mean[answered] / self.step_m,
            smoothed.sigma[answered] / self.step_m,
            grid_flags(grid, samples.arc_m, flags, reach_m=self.step_m),
            _prior_sigma(models, np.arange(start, stop)),
        )
        settled = replace(samples, flags=np.where(place < stop, flags, samples.flags).astype(np.uint16))
        return motion, state, settled.part(place >= stop - 2)

    def _readings(self, samples: _Samples, place: IntArray, first: int) -> Readings:
        row = taylor(samples.arc_m / self.step_m - place)
        vertical = row * self.gains[samples.wall][:, None]
        h = np.concatenate([row, vertical], axis=1)
        return Readings(place - first, h, samples.place_m, samples.variance, samples.gate_variance)

    def _two_passes(
        self, moves: Moves, readings: Readings, state: _State, stop: int
    ) -> tuple[Smoothed, _State, BoolArray]:
        gate, wanted = self.smoother.gate, np.zeros((2, 2 * STATES))
        wanted[0, SLOPE] = wanted[1, STATES + SLOPE] = 1.0
        first = forward(moves, readings, mean=state.mean[0], covariance=state.covariance[0], gate=gate)
        accepted = backward(moves, readings, first, wanted=wanted[:0]).distance <= gate
        second = forward(moves, readings, mean=state.mean[1], covariance=state.covariance[1], allowed=accepted)
        smoothed = backward(moves, readings, second, wanted=wanted)
        at = min(stop - state.bin, moves.model.size - 1)
        after = _State(state.bin + at, (first.mean[at], second.mean[at]), (first.covariance[at], second.covariance[at]))
        return smoothed, after, ~accepted

    def _motion(
        self, grid: FloatArray, slope: FloatArray, sigma: FloatArray, flags: FlagArray, prior_sigma: FloatArray
    ) -> GrooveMotion:
        speed = self.course.rotation.speed_at_m_s(grid)[:, None]
        unknown = sigma > UNOBSERVABLE * prior_sigma
        unknown[:, DIRECTIONS.index(self.course.direction)] = False
        velocity, error = (np.where(unknown, np.nan, values * speed) for values in (slope, sigma))
        return GrooveMotion(
            float(grid[0]), self.step_m, velocity[:, 0], error[:, 0], velocity[:, 1], error[:, 1], flags
        )


def _over(after: _Model | None, stop: int) -> bool:
    """Whether a model that this one follows is needed no more."""
    return after is not None and after.from_bin <= stop


def _which(models: list[_Model], bins: IntArray) -> IntArray:
    starts = [model.from_bin for model in models]
    return np.maximum(np.searchsorted(starts, bins, side="right") - 1, 0)


def _moves(models: list[_Model], bins: IntArray) -> Moves:
    return Moves(np.stack([m.a for m in models]), np.stack([m.q for m in models]), _which(models, bins))


def _prior_sigma(models: list[_Model], bins: IntArray) -> FloatArray:
    sigma = np.array([[prior.sigma for prior in model.priors] for model in models])
    return np.asarray(sigma[_which(models, bins)])
