"""Which groups to look at: those of which least was read, and of these, or where all was read, the most doubtful."""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappush, heappushpop

import numpy as np

from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import WallTrace

KEPT = 8
"""More than are drawn: of some not a single frame may be left."""


@dataclass(frozen=True, order=True)
class Doubtful:
    """A group that is worth a look; the larger the worse.

    Attributes
    ----------
    unread : float
        Share of the places, of the walls that show at all, that were not read.
    sigma_m : float
        Root mean square of the standard errors of the places that were.
    number : int
        Of the group.
    arc_start_m : float
        Where it begins.
    """

    unread: float
    sigma_m: float
    number: int
    arc_start_m: float


@dataclass
class WorstGroups:
    """The few worst of all groups."""

    _heap: list[Doubtful] = field(default_factory=list)

    def add(self, trace: WallTrace) -> None:
        """Take in a stretch."""
        read = np.isfinite(trace.offset_m) & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
        walls = read.any(axis=1) if read.any() else np.ones(2, np.bool_)
        power = trace.offset_sigma_m[read] ** 2
        power = power[np.isfinite(power)]
        sigma_m = float(np.sqrt(power.mean())) if power.size else 0.0
        found = Doubtful(1 - float(read[walls].mean()), sigma_m, trace.number, trace.arc_start_m)
        if len(self._heap) < KEPT:
            heappush(self._heap, found)
        else:
            heappushpop(self._heap, found)

    def worst_first(self) -> list[Doubtful]:
        """Return them, the worst one first."""
        return sorted(self._heap, reverse=True)
