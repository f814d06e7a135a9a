"""The tonearm: stretches in, the motion of the groove along the whole passage out, in bounded memory.

It is given stretches where they really begin (`tonearm.splice`) and smooths all of them together by one of two methods:
`KalmanSmoother` (`tonearm.slopes`) smooths the slopes of the direction that is listened to, `PlaceSmoother`
(`tonearm.places`) the places of both walls and so both directions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Protocol

from gramoscope.signal_path import GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.places import PlaceSmoother
from gramoscope.tonearm.slopes import KalmanSmoother

__all__ = ["KalmanSmoother", "PlaceSmoother", "Smoother", "Tonearm"]


class Smoother(Protocol):
    """A way to turn stretches into the motion of the groove."""

    def follow(self, traces: Iterable[WallTrace], course: Course) -> Iterator[GrooveMotion]:
        """See `Tonearm.follow`."""
        ...


@dataclass(frozen=True)
class Tonearm(Course):
    """Follows the groove.

    Parameters
    ----------
    rotation, direction, wall_angle_rad, passage_length_m
        See `Course`.
    smoother : KalmanSmoother or PlaceSmoother
        How it smooths.
    """

    smoother: Smoother = field(default_factory=KalmanSmoother)

    def follow(self, traces: Iterable[WallTrace]) -> Iterator[GrooveMotion]:
        """Turn spliced stretches into the motion of the groove.

        Parameters
        ----------
        traces : iterable of WallTrace
            In the order of the passage, at the places where they really begin (`tonearm.splice`). A few blocks of them
            are held at a time, the groups that the prior is learned from at first.

        Yields
        ------
        GrooveMotion
            On one grid of `arc_step_m` from s = 0, without gap or overlap.
        """
        return self.smoother.follow(traces, self)
