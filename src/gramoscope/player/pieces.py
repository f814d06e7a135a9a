"""Pieces of the passage: tasks that say which groups to read, never what is in them, and may be done twice.

Whoever reads a piece, a thread here or a machine elsewhere, opens the capture and the store by their paths, reads the groups
and writes one chunk; the answer is no more than that it is done.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from llvmlite import binding

from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.camera.contents import Contents
from gramoscope.errors import GramoscopeError, WorkerError
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.devices import device_of_report
from gramoscope.player.files_seen import look_at, seen
from gramoscope.player.learned import pickup_of
from gramoscope.player.reading_manifest import differences, key_of, manifest_of
from gramoscope.player.reading_store import GroupReading, Piece, ReadingStore, open_store
from gramoscope.player.recipe import recipe_of_table

TRIES = 3
"""A piece that fails so often is flagged, and the rest goes on."""
LOOKS = 3
"""A group whose files change while they are read is read so often before it is taken as it is."""


class StoppedError(Exception):
    """Nobody waits for the piece any more."""


@dataclass(frozen=True)
class Task:
    """A piece to read.

    Parameters
    ----------
    capture, store : str
        Paths, the same on every machine.
    key : str
        Sum of what the reading depends on: a worker that would read otherwise refuses.
    piece : int
    patient : bool
        Whether a group that cannot be read is flagged, instead of failing the whole piece: for the last try.
    """

    capture: str
    store: str
    key: str
    piece: int
    patient: bool = False


@dataclass(frozen=True, eq=False)
class Reader:
    """Reads pieces of a capture into a store; for one process, whatever the number of its threads.

    Parameters
    ----------
    capture : Capture
    pickup : Pickup
    store : ReadingStore
    """

    capture: Capture
    pickup: Pickup
    store: ReadingStore
    stopped: threading.Event = field(default_factory=threading.Event)

    def __call__(self, task: Task) -> None:
        """Read a piece and write it."""
        failed: list[str] = []
        groups = tuple(
            self._read(number, failed if task.patient else None) for number in self.store.groups_of(task.piece)
        )
        self.store.write(task.piece, Piece(groups, tuple(failed), processor()))

    def _read(self, number: int, failed: list[str] | None) -> GroupReading:
        if self.stopped.is_set():
            raise StoppedError
        try:
            return read_group(self.capture, self.pickup, number)
        except (GramoscopeError, MemoryError):
            raise
        except Exception as error:
            if failed is None:
                raise
            why = f"could not be read in {TRIES} tries: {error!r}"
            failed.append(f"group {number} {why}")
            return GroupReading(self.pickup.read(self.capture.unread_group(number, why)), self._frames())

    def unread(self, piece: int, why: str) -> Piece:
        """Return a piece of which nothing was read, every group flagged."""
        groups = tuple(
            GroupReading(self.pickup.read(self.capture.unread_group(number, why)), self._frames())
            for number in self.store.groups_of(piece)
        )
        return Piece(groups, tuple(f"group {one.trace.number} {why}" for one in groups))

    def _frames(self) -> int:
        return self.capture.bench.sequence.frames_per_group


def read_group(capture: Capture, pickup: Pickup, number: int) -> GroupReading:
    """Read a group, and say what its files were; once more if they changed meanwhile."""
    for _ in range(LOOKS):
        before, contents = look_at(capture, number), Contents(summed=True)
        trace = pickup.read(group := capture.group(number, contents))
        files, stayed = seen(capture, number, before, contents)
        if stayed:
            break
    return GroupReading(trace, int(np.count_nonzero(~group.valid)), files)


def processor() -> str:
    """Return what kind of processor works here."""
    return str(binding.get_host_cpu_name())


def read_elsewhere(task: Task) -> None:
    """Read a piece in a process of its own, which opens everything once."""
    reader_of(task.capture, task.store, task.key)(task)


@lru_cache(maxsize=1)
def reader_of(capture: str, store: str, key: str) -> Reader:
    """Return the reader of a store, opened by path.

    Raises
    ------
    WorkerError
        If the store cannot be seen from here, or this machine would read otherwise.
    """
    found = open_store(Path(store))
    if found is None:
        raise WorkerError(f"{store} cannot be read on this machine", "storage that all workers share", _SHARE)
    opened = open_capture(capture)
    recipe, device = recipe_of_table(found.recipe), device_of_report(found.manifest["device"])
    here = manifest_of(opened, recipe, device)
    if key_of(here) != key:
        raise WorkerError(
            f"a worker would read otherwise: {'; '.join(differences(found.manifest, here))}",
            "the same version of everything, and the same capture, on every machine",
            "install the same environment on all workers",
        )
    learned = found.learned()
    if learned is None:
        raise WorkerError(f"{store} does not say what the passage taught", "a store that is whole", _SHARE)
    return Reader(opened, pickup_of(recipe.cartridge_for(opened.bench, device), learned), found)


_SHARE = "give --out and the capture on storage that all machines see under the same path"
