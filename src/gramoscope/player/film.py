"""Reading a film: one passage, its stretches read by several threads, in order, and joined by their overlaps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gramoscope.apparatus.capture import Capture
from gramoscope.pickup.cartridge import Pickup, Sketch
from gramoscope.pickup.device import Device
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.centring import Centring, surveyed
from gramoscope.player.kept_reading import KeptReading, Work, kept_reading_of
from gramoscope.player.provenance import InputHashes
from gramoscope.player.reading import Passage
from gramoscope.player.recipe import Recipe
from gramoscope.player.workers import spreading
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
    kept: KeptReading
    centring: Centring
    hashes: InputHashes
    progress: Told | None = None

    @classmethod
    @contextmanager
    def begun(
        cls, capture: Capture, recipe: Recipe, folder: Path, settings: Settings, work: Work, progress: Told | None
    ) -> Iterator[FilmReading]:
        """Give a film as it is after learning its passage, while the block runs; see `kept_reading`."""
        workers, device = settings.workers, settings.device

        def learn(noted: Capture) -> Pickup:
            groups = None
            if work.following is not None:
                groups = work.following.learned_groups
                work.following.wait(groups)
            return learned(noted, recipe, workers, device=device, progress=progress, groups=groups)

        how: dict[str, Any] = {"device": device, "workers": workers, "work": work, "learn": learn}
        with kept_reading_of(capture, recipe, folder, **how) as kept:
            centring = surveyed(capture, kept.pickup, workers, asked=settings.speed.remove_wow)
            yield cls(capture, recipe, kept, centring, InputHashes(), progress)

    @property
    def pickup(self) -> Pickup:
        """The cartridge that knows the passage."""
        return self.kept.pickup

    @property
    def walls(self) -> tuple[str, ...]:
        """Those that the cartridge reads."""
        return self.pickup.walls

    @property
    def calibration(self) -> Mapping[str, Any]:
        """What the cartridge learned."""
        return self.pickup.calibration

    @property
    def wall_angle_rad(self) -> float:
        """As the manifest says."""
        return self.capture.bench.disc.wall_angle_rad

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
        """Say how it was read, where that matters."""
        yield from self.kept.remarks()

    def _picked_up(self, monitor: Monitor) -> Iterator[WallTrace]:
        """Read the stretches, several at a time."""
        for group in self.kept.groups():
            self.hashes.add({file.name: file.sha256 for file in group.files})
            monitor.picked_up(group.trace, group.frames_lost)
            self.kept.work.watched(monitor, group.trace)
            if self.progress is not None:
                self.progress(monitor.groups, self.capture.group_count, "Playing")
            yield group.trace

    def _spliced(self, traces: Iterator[WallTrace], monitor: Monitor) -> Iterator[WallTrace]:
        for trace, match in self.recipe.splice.join(traces):
            monitor.spliced(match, trace)
            yield trace


def learned(
    capture: Capture,
    recipe: Recipe,
    workers: int,
    *,
    device: Device = PROCESSOR,
    progress: Told | None = None,
    groups: int | None = None,
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
    groups : int, optional
        Learn from the first so many only.
    """
    with spreading(workers) as spread:
        cartridge = recipe.cartridge_for(capture.bench, device)

        def told(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total, "Learning")

        return cartridge.learn(capture.group, groups or capture.group_count, spread, told)
