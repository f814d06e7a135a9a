"""Smoothing slopes: the Kalman smoother that goes with the paper's reading.

The walls of all stretches are turned into the direction of the cut, and their slopes smoothed together by a Kalman smoother
(`tonearm.kalman`) that runs a few groups behind the pickup. What the smoother assumes of the music (how loud, how quickly it
changes) it learns from the first groups and then keeps.

The smoother sees the samples of overlapping stretches side by side, so an overlap counts twice where it was seen twice, and
a gap is bridged by what surrounds it, with an error that grows to that of not knowing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.errors import require
from gramoscope.quality import NOT_MEASURED, FlagArray
from gramoscope.signal_path import ErrorSpectrum, GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.directions import Observations, observe
from gramoscope.tonearm.error_spectrum import FREQUENCIES_HZ, slopes_error
from gramoscope.tonearm.grid_flags import OUTLIER, grid_flags
from gramoscope.tonearm.kalman import Prior, State, learn_prior, rest, smooth


@dataclass(frozen=True)
class KalmanSmoother:
    """How the tonearm smooths.

    Parameters
    ----------
    learn_groups : int
        The prior is learned from so many groups at the start.
    block_groups : int
        The smoother runs backwards each time so many groups have come.
    lookahead : float
        How far behind the newest sample it answers, in units of the prior's length 1/λ: what comes later changes the
        answer by less than e^(−lookahead).
    gate : float
        A sample further than this many standard errors from its prediction is an outlier and gets no weight.
    corner_limits_hz : (float, float)
        Least and largest rate at which the music is believed to change, λV/2π.
    floor_m_s : float
        Least velocity (standard deviation) that the prior expects.
    """

    learn_groups: int = 64
    block_groups: int = 16
    lookahead: float = 20.0
    gate: float = 5.0
    corner_limits_hz: tuple[float, float] = (1000.0, 12000.0)
    floor_m_s: float = 2e-3

    def __post_init__(self) -> None:
        require(self.learn_groups >= 1 and self.block_groups >= 1, "groups in a block are counted from 1", "1 or more")
        require(self.lookahead > 0, f"a lookahead of {self.lookahead}", "above 0")
        require(self.gate > 1, f"a gate of {self.gate} standard errors", "above 1")
        low, high = self.corner_limits_hz
        require(0 < self.floor_m_s <= 1, f"a floor of {self.floor_m_s} m/s", "above 0, at most 1")
        require(0 < low < high, f"corner limits of {low} … {high} Hz", "two rising frequencies")

    def follow(self, traces: Iterable[WallTrace], course: Course) -> Iterator[GrooveMotion]:
        """Smooth the slopes of spliced stretches.

        Parameters
        ----------
        traces : iterable of WallTrace
            See `Tonearm.follow`. Two blocks of them are held at a time, the groups that the prior is learned from at first.
        course : Course

        Yields
        ------
        GrooveMotion
            The direction that is not listened to is NaN.
        """
        stream = iter(traces)
        first = list(islice(stream, self.learn_groups))
        if not first:
            return
        follower = _SlopeFollower(self, course)
        yield from follower.blocks(chain(first, stream), follower.learn(first), first[0].arc_step_m)


@dataclass(frozen=True, eq=False)
class _Buffer:
    """Samples that were heard and not yet answered."""

    arc_m: FloatArray
    slope: FloatArray
    variance: FloatArray
    single: FloatArray
    flags: FlagArray

    @staticmethod
    def empty() -> _Buffer:
        return _Buffer(np.empty(0), np.empty(0), np.empty(0), np.empty(0), np.empty(0, np.uint16))

    def with_stretch(self, seen: Observations, correlation_samples: float) -> _Buffer:
        return _Buffer(
            np.concatenate([self.arc_m, seen.arc_m]),
            np.concatenate([self.slope, seen.slope]),
            np.concatenate([self.variance, seen.variance * correlation_samples]),
            np.concatenate([self.single, seen.variance]),
            np.concatenate([self.flags, seen.flags]),
        )

    def part(self, keep: BoolArray | IntArray) -> _Buffer:
        return _Buffer(self.arc_m[keep], self.slope[keep], self.variance[keep], self.single[keep], self.flags[keep])


@dataclass(frozen=True)
class _SlopeFollower:
    """A smoother over one groove."""

    smoother: KalmanSmoother
    course: Course

    def blocks(self, traces: Iterator[WallTrace], prior: Prior, step_m: float) -> Iterator[GrooveMotion]:
        buffer, state, done, last = _Buffer.empty(), rest(prior, -1.0), 0, 0.0
        trace = next(traces, None)
        while trace is not None:
            taken = 0
            while trace is not None and taken < self.smoother.block_groups:
                seen = self._observe(trace)
                buffer = buffer.with_stretch(seen, trace.correlation_samples)
                last = max(last, float(seen.arc_m[-1]))
                trace, taken = next(traces, None), taken + 1
            heard = last if trace is None else trace.arc_start_m
            end = (
                max(last, self.course.passage_length_m)
                if trace is None
                else heard - self.smoother.lookahead / prior.rate_per_m
            )
            stop = int(np.floor(end / step_m)) + 1
            if stop > done:
                motion, state, outlier = self._answer(buffer, prior, state, done, stop, heard, step_m)
                yield motion
                buffer = _mark(buffer, outlier, heard)
                buffer, done = buffer.part(buffer.arc_m > (stop - 1) * step_m - step_m), stop

    def _answer(
        self, buffer: _Buffer, prior: Prior, state: State, start: int, stop: int, heard: float, step_m: float
    ) -> tuple[GrooveMotion, State, BoolArray]:
        """Smooth everything heard beyond the last answer, and answer grid points start … stop − 1."""
        grid: FloatArray = np.arange(start, stop, dtype=np.float64) * step_m
        fresh = np.flatnonzero((buffer.arc_m > state.arc_m) & (buffer.arc_m <= heard))
        arc = np.concatenate([buffer.arc_m[fresh], grid])
        order = np.argsort(arc, kind="stable")
        unseen = np.full(grid.size, np.nan)
        result = smooth(
            arc[order],
            np.concatenate([buffer.slope[fresh], unseen])[order],
            np.concatenate([buffer.variance[fresh], unseen])[order],
            gate_variance=np.concatenate([buffer.single[fresh], unseen])[order],
            prior=prior,
            start=State(min(state.arc_m, float(arc[order][0])), state.mean, state.covariance),
            gate=self.smoother.gate,
            keep=int(np.flatnonzero(order == arc.size - 1)[0]),
        )
        place = np.argsort(order, kind="stable")
        outlier = np.zeros(buffer.arc_m.size, np.bool_)
        outlier[fresh] = result.outlier[place[: fresh.size]]
        flags = grid_flags(grid, buffer.arc_m, np.where(outlier, buffer.flags | OUTLIER, buffer.flags), reach_m=step_m)
        mine = place[fresh.size :]
        spectrum = self._error_spectrum(buffer.part(fresh[~outlier[fresh]]), prior, grid, step_m)
        motion = self._motion(grid, step_m, result.mean[mine], result.sigma[mine], flags, spectrum)
        return motion, result.filtered, outlier

    def _motion(
        self,
        grid: FloatArray,
        step_m: float,
        slope: FloatArray,
        sigma: FloatArray,
        flags: FlagArray,
        spectrum: ErrorSpectrum,
    ) -> GrooveMotion:
        speed = self.course.rotation.speed_at_m_s(grid)
        velocity, error, nothing = slope * speed, sigma * speed, np.full(grid.size, np.nan)
        if self.course.direction == "lateral":
            return GrooveMotion(float(grid[0]), step_m, velocity, error, nothing, nothing, flags, spectrum)
        return GrooveMotion(float(grid[0]), step_m, nothing, nothing, velocity, error, flags, spectrum)

    def _error_spectrum(self, used: _Buffer, prior: Prior, grid: FloatArray, step_m: float) -> ErrorSpectrum:
        """What the errors of one answer are like, by the information of all its readings."""
        here = np.isfinite(used.slope) & (used.arc_m >= grid[0]) & (used.arc_m <= grid[-1])
        information = float(np.sum(1 / used.variance[here])) / (grid.size * step_m)
        speed = float(self.course.rotation.speed_at_m_s(float(np.mean(grid))))
        density, samples = slopes_error(information, prior, speed_m_s=speed, samples=grid.size)
        unknown = np.full(density.size, np.nan)
        both = [density, unknown] if self.course.direction == "lateral" else [unknown, density]
        return ErrorSpectrum(FREQUENCIES_HZ, np.stack(both), samples)

    def _observe(self, trace: WallTrace) -> Observations:
        angle = float(np.mean(self.course.wall_angles_rad))
        return observe(trace, self.course.direction, wall_angle_rad=angle)

    def learn(self, traces: list[WallTrace]) -> Prior:
        """Learn from samples so far apart that their errors are their own; the median over all ways to choose them."""
        seen = [(self._observe(t), t.correlation_samples) for t in traces]
        step = int(np.ceil(max(correlation for _, correlation in seen)))
        priors = [self._learn_from([one.thinned(step, first) for one, _ in seen]) for first in range(step)]
        return Prior(
            float(np.median([prior.sigma for prior in priors])),
            float(np.median([prior.rate_per_m for prior in priors])),
        )

    def _learn_from(self, stretches: list[Observations]) -> Prior:
        buffer = _Buffer.empty()
        for seen in stretches:
            buffer = buffer.with_stretch(seen, 1.0)
        buffer = buffer.part(np.argsort(buffer.arc_m, kind="stable"))
        speed = float(self.course.rotation.speed_at_m_s(0.0))
        low, high = (2 * np.pi * corner / speed for corner in self.smoother.corner_limits_hz)
        measured = (buffer.flags & np.uint16(NOT_MEASURED)) == 0
        return learn_prior(
            buffer.arc_m,
            np.where(measured, buffer.slope, np.nan),
            buffer.variance,
            rate_limits_per_m=(low, high),
            sigma_floor=self.smoother.floor_m_s / speed,
        )


def _mark(buffer: _Buffer, outlier: BoolArray, heard: float) -> _Buffer:
    """Outliers stay outliers when the next block looks at them again."""
    flags = np.where(outlier & (buffer.arc_m <= heard), buffer.flags | OUTLIER, buffer.flags)
    slope = np.where(outlier, np.nan, buffer.slope)
    return _Buffer(buffer.arc_m, slope, buffer.variance, buffer.single, flags.astype(np.uint16))
