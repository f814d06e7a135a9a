"""What is played: passages of groove, one for a film, one or many for photographs.

A reading knows a capture and has learned what it can of it; it gives its passages one at a time, each as a stream of
stretches at the places where they really begin. Everything after that is the same for all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from gramoscope.apparatus.capture import Capture
from gramoscope.apparatus.still import StillCapture
from gramoscope.pickup.cartridge import Sketch
from gramoscope.player.centring import Centring
from gramoscope.player.provenance import InputHashes
from gramoscope.signal_path import WallTrace

if TYPE_CHECKING:
    from gramoscope.player.monitor import Monitor

AnyCapture = Capture | StillCapture
"""What can be played."""


@dataclass(frozen=True, eq=False)
class Passage:
    """A continuous stretch of groove.

    Attributes
    ----------
    length_m : float
        Where it ends, nominally; it begins at s = 0.
    traces : iterator of WallTrace
        In the order of the passage.
    """

    length_m: float
    traces: Iterator[WallTrace]


class Reading(Protocol):
    """A capture that is being read."""

    @property
    def walls(self) -> tuple[str, ...]:
        """Which walls are read: "inner", "outer"."""
        ...

    @property
    def calibration(self) -> Mapping[str, Any]:
        """What the passage said about the apparatus; empty where nothing is learned."""
        ...

    @property
    def wall_angle_rad(self) -> float:
        """φ of both walls, by which their motion is taken for sideways and up and down."""
        ...

    @property
    def hashes(self) -> InputHashes:
        """Sums of what was read."""
        ...

    @property
    def centring(self) -> Centring:
        """What is done about an off-centre hole."""
        ...

    @property
    def length_m(self) -> float:
        """Of all passages together, nominal."""
        ...

    def passages(self, monitor: Monitor) -> Iterator[Passage]:
        """Yield the passages in playing order; the monitor looks on."""
        ...

    def played(self, number: int, start_sample: int, stop_sample: int) -> None:
        """Take note of where a passage lies in the sound."""
        ...

    def sketch(self, number: int) -> Sketch | None:
        """Return a group or picture, and what was seen in it; None when nothing is usable."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """Return what the report says of this kind of reading alone; called when all has been played."""
        ...

    def remarks(self) -> Iterator[str]:
        """Say what a listener should know before judging."""
        ...
