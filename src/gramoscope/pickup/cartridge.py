"""What every cartridge can do: learn a passage, read its stretches one by one, and show what it saw."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.signal_path import FrameGroup, ImageArray, WallTrace

In = TypeVar("In")
Out = TypeVar("Out")


class Spread(Protocol):
    """How work is spread over threads: like the built-in `map` with one iterable, answers in order."""

    def __call__(self, work: Callable[[In], Out], tasks: Iterable[In], /) -> Iterator[Out]:
        """Return what the work makes of each task."""
        ...


@dataclass(frozen=True, eq=False)
class Line:
    """A stripe as it was found, for pictures.

    Attributes
    ----------
    name : str
    row : float64 array, shape (column,)
    measured : bool array, shape (column,)
    """

    name: str
    row: FloatArray
    measured: BoolArray


@dataclass(frozen=True, eq=False)
class Sketch:
    """A frame, and the stripes that were found in it."""

    image: ImageArray
    lines: tuple[Line, ...]


class Pickup(Protocol):
    """A cartridge that knows the passage: reads one stretch at a time, from any thread."""

    def read(self, group: FrameGroup) -> WallTrace:
        """Return where the walls of one stretch run; never an exception for what the film does not show."""
        ...

    def sketch(self, group: FrameGroup) -> Sketch | None:
        """Return what was seen in a stretch; None when no frame is usable."""
        ...

    @property
    def walls(self) -> tuple[str, ...]:
        """Which walls it reads: "inner", "outer"."""
        ...

    @property
    def calibration(self) -> Mapping[str, Any]:
        """What the passage said about the apparatus, beside what the manifest says; empty for one that learns nothing."""
        ...


class Cartridge(Protocol):
    """A way of reading, fitted to an apparatus."""

    def learn(
        self,
        group: Callable[[int], FrameGroup],
        group_count: int,
        spread: Spread,
        progress: Callable[[int, int], None] | None = None,
    ) -> Pickup:
        """Return the cartridge as it is after learning a passage.

        Parameters
        ----------
        group : callable
            Gives the film of a stretch by its number.
        group_count : int
        spread : callable
        progress : callable, optional
            Told how much is done, and of how much.
        """
        ...
