"""Smoothing places: both walls of the whole passage together, in both directions.

The state of the groove at each bin of an even grid is that of `tonearm.groove_prior` for the lateral displacement a and for
the vertical one h. With its wall at the angle φ, a sample of the inner wall reads a − h cot φ and one of the outer wall
a + h cot φ, each up to a constant of its own, which a and h take up where they start. So two walls give both directions; one
alone carries on with the other direction held by its prior; where both are missing the groove drifts on as the prior lets
it, with an error that says so. Each sample goes to its nearest bin, over the fraction of a step between them by Taylor's
series. Outliers get no weight (`tonearm.groove_model`). The prior follows the loudness stretch by stretch (`tonearm.level`),
and its spectrum is learned anew from every so many groups (`tonearm.teacher`): records begin in silence and get loud.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from gramoscope.conventions import INNER, OUTER, BoolArray, FloatArray
from gramoscope.errors import require
from gramoscope.quality import FlagArray
from gramoscope.signal_path import ErrorSpectrum, GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.error_spectrum import places_error
from gramoscope.tonearm.grid_flags import OUTLIER, grid_flags
from gramoscope.tonearm.groove_model import SLOPES, GrooveModel, PassState, beginning, moves, robustly, which
from gramoscope.tonearm.place_samples import PlaceSamples, joined
from gramoscope.tonearm.stretches import counted_from_the_start, handed_over, stretch_of
from gramoscope.tonearm.teacher import DIRECTIONS, Teacher, Teaching

UNOBSERVABLE = 0.95
"""With this share of the prior's sigma left, nothing is known of a direction, unless both walls are seen."""
NEAR = 32
"""Bins; a tenth of a millimetre."""


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
    corner_limits_hz, cutoff_limits_hz, width_limits_hz : (float, float)
        Least and largest corner λV/2π, cut-off μV/2π and width νV/2π that the music may have.
    usual_width_hz : float
        Width νV/2π that is expected before anything was heard; only what is heard clearly moves it by much.
    floor_m_s : float
        Least change of velocity over `BEND_M` (standard deviation) that the prior expects of the direction that is
        listened to.
    other_floor_m_s : float
        The same of the other direction.
    """

    learn_groups: int = 64
    block_groups: int = 64
    lookahead: float = 20.0
    gate: float = 5.0
    corner_limits_hz: tuple[float, float] = (300.0, 20_000.0)
    cutoff_limits_hz: tuple[float, float] = (2_000.0, 60_000.0)
    width_limits_hz: tuple[float, float] = (6_000.0, 30_000.0)
    usual_width_hz: float = 8_000.0
    floor_m_s: float = 3e-4
    other_floor_m_s: float = 2e-4

    def __post_init__(self) -> None:
        require(self.learn_groups >= 1 and self.block_groups >= 1, "groups in a block are counted from 1", "1 or more")
        require(self.lookahead > 0, f"a lookahead of {self.lookahead}", "above 0")
        require(self.gate > 1, f"a gate of {self.gate} standard errors", "above 1")
        for floor in (self.floor_m_s, self.other_floor_m_s):
            require(0 < floor < 0.5, f"a floor of {floor} m/s", "above 0, below 0.5")
        for low, high in (self.corner_limits_hz, self.cutoff_limits_hz, self.width_limits_hz):
            require(0 < low < high, f"limits of {low} … {high} Hz", "two rising frequencies")
        low, high = self.width_limits_hz
        require(low <= self.usual_width_hz <= high, f"a usual width of {self.usual_width_hz} Hz", "within its limits")

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
        stretches = handed_over(counted_from_the_start(stretch_of(trace) for trace in chain([first], stream)))
        teacher = Teacher(course, first.arc_step_m, self.teaching, self.gate)
        yield from _PlaceFollower(self, course, first.arc_step_m).blocks(teacher.taught(stretches))

    @property
    def teaching(self) -> Teaching:
        """What of these settings the prior is learned by."""
        return Teaching(
            groups=self.learn_groups,
            corner_limits_hz=self.corner_limits_hz,
            cutoff_limits_hz=self.cutoff_limits_hz,
            width_limits_hz=self.width_limits_hz,
            usual_width_hz=self.usual_width_hz,
            floor_m_s=self.floor_m_s,
            other_floor_m_s=self.other_floor_m_s,
        )


@dataclass(frozen=True)
class _PlaceFollower:
    """A smoother over one groove, on one grid."""

    smoother: PlaceSmoother
    course: Course
    step_m: float

    def blocks(self, stretches: Iterator[tuple[PlaceSamples, GrooveModel]]) -> Iterator[GrooveMotion]:
        """Answer bin after bin, some way behind the newest stretch."""
        pieces, models, done, last = list[PlaceSamples](), list[GrooveModel](), 0, 0
        state: PassState | None = None
        current = next(stretches, None)
        while current is not None:
            taken = 0
            while current is not None and taken < self.smoother.block_groups:
                pieces.append(current[0])
                models.append(current[1])
                last = max(last, int(pieces[-1].bin[-1]))
                current, taken = next(stretches, None), taken + 1
            state = state or beginning(models[0], min(0, int(pieces[0].bin[0])))
            if current is None:
                end = stop = max(last, int(np.floor(self.course.passage_length_m / self.step_m))) + 1
            else:
                end = current[1].from_bin
                stop = end - self._lookahead(models)
            if stop > done:
                motion, state, samples = self._answer(joined(pieces), models, state, (done, stop, end))
                yield motion
                pieces, done = [samples], stop
                models = models[int(which(models, np.array([stop]))[0]) :]

    def _lookahead(self, models: list[GrooveModel]) -> int:
        slowest = min(model.slowest_per_m for model in models)
        return int(np.ceil(self.smoother.lookahead / slowest / self.step_m))

    def _answer(
        self, samples: PlaceSamples, models: list[GrooveModel], state: PassState, bins: tuple[int, int, int]
    ) -> tuple[GrooveMotion, PassState, PlaceSamples]:
        """Answer bins[0] … bins[1] − 1 by all samples before bins[2]; return what is needed to go on."""
        first, stop, end = bins
        measured = samples.measured(state.bin, end)
        fresh = samples.part(measured)
        followed = robustly(
            moves(models, state.bin, end),
            fresh.readings(first_bin=state.bin, step_m=self.step_m, gains=self.course.gains),
            ~fresh.suspect,
            state,
            gate=self.smoother.gate,
            resume_bin=min(stop, end - 1),
            wanted=SLOPES,
        )
        flags = samples.flags.copy()
        flags[measured[~followed.accepted]] |= OUTLIER
        answered = slice(first - state.bin, stop - state.bin)
        used = fresh.part(followed.accepted)
        motion = self._motion(
            np.arange(first, stop, dtype=np.float64) * self.step_m,
            followed.smoothed.mean[answered] / self.step_m,
            followed.smoothed.sigma[answered] / self.step_m,
            np.stack([model.sigma for model in models])[which(models, np.arange(first, stop))],
            _both_walls(used, first, stop),
            samples.flagged(flags),
            places_error(used, models, (first, stop), step_m=self.step_m, course=self.course),
        )
        # outliers stay outliers when the next block looks at them again
        settled = samples.flagged(np.where(samples.bin < stop, flags, samples.flags)).part(samples.bin >= stop - 2)
        return motion, followed.state, settled

    def _motion(
        self,
        grid: FloatArray,
        slope: FloatArray,
        sigma: FloatArray,
        prior_sigma: FloatArray,
        both_walls: BoolArray,
        samples: PlaceSamples,
        spectrum: ErrorSpectrum,
    ) -> GrooveMotion:
        flags: FlagArray = grid_flags(grid, samples.arc_m, samples.flags, reach_m=self.step_m)
        speed = self.course.rotation.speed_at_m_s(grid)[:, None]
        unknown = (sigma > UNOBSERVABLE * prior_sigma) & ~both_walls[:, None]
        unknown[:, DIRECTIONS.index(self.course.direction)] = False
        velocity, error = (np.where(unknown, np.nan, values * speed) for values in (slope, sigma))
        return GrooveMotion(
            float(grid[0]), self.step_m, velocity[:, 0], error[:, 0], velocity[:, 1], error[:, 1], flags, spectrum
        )


def _both_walls(samples: PlaceSamples, first: int, stop: int) -> BoolArray:
    """Whether both walls were seen within `NEAR` bins of each."""
    seen = np.zeros((2, stop - first + 2 * NEAR), np.bool_)
    place = samples.bin - (first - NEAR)
    here = (place >= 0) & (place < seen.shape[1])
    seen[samples.wall[here], place[here]] = True
    count = np.append(0, np.cumsum(seen[INNER] & seen[OUTER]))
    return np.asarray(count[2 * NEAR + 1 :] > count[: -2 * NEAR - 1])
