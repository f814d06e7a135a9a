"""Reading a film: one passage, its stretches read by several threads, in order, and joined by their overlaps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gramoscope.apparatus.capture import Capture
from gramoscope.pickup.cartridge import Pickup, Sketch
from gramoscope.pickup.device import Device
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.centring import Centring, surveyed
from gramoscope.player.provenance import InputHashes, hash_group
from gramoscope.player.reading import Passage
from gramoscope.player.recipe import Recipe
from gramoscope.player.workers import in_order, spreading
from gramoscope.signal_path import WallTrace

if TYPE_CHECKING:
    from gramoscope.player.monitor import Monitor
    from gramoscope.player.play import Settings

Told = Callable[[int, int, str], None]


@dataclass(frozen=True, eq=False)
class FilmReading:
    """A film whose passage was learned; see `player.reading.Reading`."""

    capture: Capture
    recipe: Recipe
    pickup: Pickup
    centring: Centring
    hashes: InputHashes
    workers: int
    progress: Told | None = None

    @classmethod
    def begun(cls, capture: Capture, recipe: Recipe, settings: Settings, progress: Told | None) -> FilmReading:
        """Return a film as it is after learning its passage."""
        pickup = learned(capture, recipe, settings.workers, device=settings.device, progress=progress)
        centring = surveyed(capture, pickup, settings.workers, asked=settings.speed.remove_wow)
        return cls(capture, recipe, pickup, centring, InputHashes(), settings.workers, progress)

    @property
    def walls(self) -> tuple[str, ...]:
        """Those that the cartridge reads."""
        return self.pickup.walls

    @property
    def calibration(self) -> Mapping[str, Any]:
        """What the cartridge learned."""
        return self.pickup.calibration

    @property
    def length_m(self) -> float:
        """As the manifest says."""
        return self.capture.bench.passage_length_m

    def passages(self, monitor: Monitor) -> Iterator[Passage]:
        """Yield the one passage."""
        yield Passage(self.length_m, self._spliced(self.centring.centred(self._picked_up(monitor)), monitor))

    def played(self, number: int, start_sample: int, stop_sample: int) -> None:
        """Nothing: the sound is the passage."""

    def sketch(self, number: int) -> Sketch | None:
        """Return a frame of a group with the stripes that were found in it."""
        return self.pickup.sketch(self.capture.group(number))

    def as_dict(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def remarks(self) -> Iterator[str]:
        """Nothing."""
        yield from ()

    def _picked_up(self, monitor: Monitor) -> Iterator[WallTrace]:
        """Read the stretches, several at a time."""
        capture = self.capture

        def read(number: int) -> tuple[WallTrace, dict[str, str], int]:
            group = capture.group(number)
            return self.pickup.read(group), hash_group(capture, number), int(np.count_nonzero(~group.valid))

        for trace, sums, frames_lost in in_order(read, range(capture.group_count), workers=self.workers):
            self.hashes.add(sums)
            monitor.picked_up(trace, frames_lost)
            if self.progress is not None:
                self.progress(monitor.groups, capture.group_count, "Playing")
            yield trace

    def _spliced(self, traces: Iterator[WallTrace], monitor: Monitor) -> Iterator[WallTrace]:
        for trace, match in self.recipe.splice.join(traces):
            monitor.spliced(match, trace)
            yield trace


def learned(
    capture: Capture, recipe: Recipe, workers: int, *, device: Device = PROCESSOR, progress: Told | None = None
) -> Pickup:
    """Return the recipe's cartridge, fitted to a capture, as it is after learning the passage.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    workers : int
    device : Device
        On which it will read.
    progress : callable, optional
        Told how much is done, of how much, and of what.
    """
    with spreading(workers) as spread:
        cartridge = recipe.cartridge_for(capture.bench, device)

        def told(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total, "Learning")

        return cartridge.learn(capture.group, capture.group_count, spread, told)
