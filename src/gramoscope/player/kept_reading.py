"""The reading of a passage: learned once, read piece by piece into a store, and found there again after whatever stopped it.

The store is the record of progress. What is in it and still true is not read again; what is not is said and read. The traces
come out in the order of the passage, whoever read them and when, so that everything that follows is one stream.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gramoscope.apparatus.capture import Capture
from gramoscope.camera.contents import Contents
from gramoscope.errors import CaptureError, GramoscopeError, require
from gramoscope.interruption import ctrl_c_waits
from gramoscope.pickup.cartridge import Pickup
from gramoscope.pickup.device import Device
from gramoscope.player.executors import Answer, Crew, Executor, LostWorkerError, Threads
from gramoscope.player.files_seen import FileSeen, changed, look_at, seen
from gramoscope.player.folder_lock import folder_lock
from gramoscope.player.following import Following
from gramoscope.player.learned import learned_of, pickup_of
from gramoscope.player.monitor import Monitor
from gramoscope.player.outputs import remove_left_over
from gramoscope.player.pieces import TRIES, Reader, StoppedError, Task
from gramoscope.player.reading_manifest import differences, key_of, manifest_of
from gramoscope.player.reading_store import (
    STORE,
    GroupReading,
    Piece,
    ReadingStore,
    create_store,
    discard_store,
    groups_a_piece,
    open_store,
)
from gramoscope.player.recipe import Recipe, table_of_recipe
from gramoscope.signal_path import FrameGroup, WallTrace

MOST_NAMED = 5


@dataclass(frozen=True)
class Work:
    """How a passage is worked through; the result does not depend on it.

    Parameters
    ----------
    executor : Executor, optional
        Who reads; threads, as many as the settings say, when left out.
    restart : bool
        Throw away what was read before.
    keep_reading : bool
        Leave the store where it is when the transfer is whole.
    verify : bool
        Add up the files of what was read before, even where size and time of writing are as they were.
    told : callable
        Told in words what was found and is done about it.
    watched : callable
        Given the monitor and the stretch after every group.
    following : Following, optional
        The capture is still being filmed: wait for its groups.
    """

    executor: Executor | None = None
    restart: bool = False
    keep_reading: bool = False
    verify: bool = False
    told: Callable[[str], None] = field(default=lambda words: None)
    watched: Callable[[Monitor, WallTrace], None] = field(default=lambda monitor, trace: None)
    following: Following | None = None

    def __post_init__(self) -> None:
        require(
            self.following is None or self.executor is None,
            "following a film with other workers than threads",
            "threads, which see the log grow",
            "leave --executor and --scheduler out",
        )


@dataclass(eq=False)
class KeptReading:
    """A passage that is being read; `kept_reading_of` begins one.

    Attributes
    ----------
    reader : Reader
    work : Work
    executor : Executor
    failed : list of str
        Groups that could not be read for reasons that are not in the film, in words.
    processors : set of str
        The kinds of processors that read.
    """

    reader: Reader
    work: Work
    executor: Executor
    failed: list[str] = field(default_factory=list)
    processors: set[str] = field(default_factory=set)

    @property
    def pickup(self) -> Pickup:
        """The cartridge that knows the passage."""
        return self.reader.pickup

    def groups(self) -> Iterator[GroupReading]:
        """Yield every group of the passage, in order."""
        for piece in self._pieces():
            self.failed += piece.failed
            self.processors |= {piece.processor} - {""}
            yield from piece.groups

    def _pieces(self) -> Iterator[Piece]:
        store = self.reader.store
        with self.executor.crew(self.reader) as crew:
            pending: deque[tuple[int, Answer | None]] = deque()
            for number in store.pieces:
                while pending and not self._is_filmed(number):
                    yield self._settled(crew, *pending.popleft())
                self._wait_for(number)
                pending.append((number, None if store.is_written(number) else crew.submit(self._task(number))))
                if len(pending) > crew.window:
                    yield self._settled(crew, *pending.popleft())
            while pending:
                yield self._settled(crew, *pending.popleft())

    def _is_filmed(self, number: int) -> bool:
        following = self.work.following
        return following is None or following.has(self.reader.store.groups_of(number).stop)

    def _wait_for(self, number: int) -> None:
        if self.work.following is not None:
            self.work.following.wait(self.reader.store.groups_of(number).stop)

    def _settled(self, crew: Crew, number: int, answer: Answer | None) -> Piece:
        """Wait for a piece; begin it again when it failed or was lost, or is no longer true."""
        if answer is None:
            piece = self._still_true(number)
            if piece is not None:
                return piece
            answer = crew.submit(self._task(number))
        for tries in range(1, TRIES + 1):
            why = _outcome(answer)
            piece = self.reader.store.read(number) if why is None else None
            if piece is not None:
                return piece
            if tries < TRIES:
                answer = crew.submit(self._task(number, patient=tries == TRIES - 1))
        self.reader.store.forget(number)
        return self.reader.unread(number, f"could not be read in {TRIES} tries: {why or 'what was written is damaged'}")

    def _task(self, number: int, *, patient: bool = False) -> Task:
        store = self.reader.store
        capture, root = str(self.reader.capture.folder.resolve()), str(store.root.resolve())
        return Task(capture, root, key_of(store.manifest), number, patient)

    def _still_true(self, number: int) -> Piece | None:
        """Return a piece that was read before, unless its files have changed since or it failed."""
        piece = self.reader.store.read(number)
        if piece is None or piece.failed:
            return None
        files = (file for one in piece.groups for file in one.files)
        other = [file.name for file in changed(self.reader.capture, files, verify=self.work.verify)]
        if other:
            self.work.told(f"changed since they were read, and read again: {_named(other)}")
        return None if other else piece

    def changed_meanwhile(self) -> Iterator[str]:
        """Yield the names of files that are no longer what was read; looks at all, and reads again those that moved."""
        store = self.reader.store
        for number in store.pieces:
            yield from (file.name for file in changed(self.reader.capture, store.files(number)))

    def remarks(self) -> list[str]:
        """Return what a listener should know of how the passage was read."""
        said = []
        other = list(self.changed_meanwhile())
        if other:
            said.append(f"changed after they were read: {_named(other)}; what is heard is what they were")
        if self.failed:
            said.append(f"not read, though the film may be fine: {_named(self.failed, '; ')}")
        if self.work.following is not None:
            said.append(
                f"played while it was filmed, and learned from its first {self.work.following.learned_groups} groups: play it "
                "again without --follow for a reading that the whole passage taught"
            )
        if len(self.processors) > 1:
            kinds = ", ".join(sorted(self.processors))
            said.append(f"read by processors of several kinds ({kinds}): others may get other bits, to rounding")
        return said


def _outcome(answer: Answer) -> str | None:
    """Wait for an answer; return what went wrong with the worker or the piece, raise what goes wrong with everything."""
    try:
        answer.result()
    except (GramoscopeError, MemoryError, StoppedError):
        raise
    except LostWorkerError as error:
        return str(error)
    except Exception as error:
        return repr(error)
    return None


def _named(things: list[str], between: str = ", ") -> str:
    more = len(things) - MOST_NAMED
    return between.join(things[:MOST_NAMED]) + (f"{between}and {more} more" if more > 0 else "")


Learn = Callable[[Capture], Pickup]


@contextmanager
def kept_reading_of(
    capture: Capture, recipe: Recipe, folder: Path, *, device: Device, workers: int, work: Work, learn: Learn
) -> Iterator[KeptReading]:
    """Begin or continue the reading of a capture in a folder; what was read stays there if the block fails.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    folder : Path
        Of the transfer.
    device : Device
    workers : int
        Threads, unless `work` says who reads.
    work : Work
    learn : callable
        Given the capture, returns the pickup; only called where nothing is known of the passage yet.
    """
    root = folder / STORE
    with folder_lock(folder):
        remove_left_over(folder)
        useless = False
        try:
            executor = work.executor or Threads(workers)
            store = _store(root, capture, recipe, device, work)
            if not all(map(store.is_written, store.pieces)):
                executor.get_ready()
            pickup, store = _learned(store, capture, recipe, device, work, learn)
            yield KeptReading(Reader(capture, pickup, store), work, executor)
            useless = not work.keep_reading
        except CaptureError:
            useless = True  # another capture was meant, or there is nothing to hear
            raise
        finally:
            with ctrl_c_waits():
                if useless or not any((root / "words" / "c").glob("*")):
                    discard_store(root)


def _store(root: Path, capture: Capture, recipe: Recipe, device: Device, work: Work) -> ReadingStore:
    """Return the store that was there, if it is of the same reading, or an empty one."""
    manifest = manifest_of(capture, recipe, device)
    if work.following is not None:
        # the log still grows, and every group's places are in it before the group is read
        manifest = {name: one for name, one in manifest.items() if not name.startswith("the file ")}
        manifest["learned from"] = f"the first {work.following.learned_groups} groups"
    found = None if work.restart else open_store(root)
    if found is not None:
        other = list(differences(found.manifest, manifest))
        if not other and found.piece_groups == groups_a_piece(capture.group_count):
            return found
        work.told(
            f"what was read before is stale and read again: {_named(other or ['the length of the passage'], '; ')}"
        )
    return _empty(root, capture, manifest, table_of_recipe(recipe))


def _empty(root: Path, capture: Capture, manifest: Mapping[str, str], recipe: Mapping[str, Any]) -> ReadingStore:
    with ctrl_c_waits():
        return create_store(root, capture.bench, group_count=capture.group_count, manifest=manifest, recipe=recipe)


def _learned(
    store: ReadingStore, capture: Capture, recipe: Recipe, device: Device, work: Work, learn: Learn
) -> tuple[Pickup, ReadingStore]:
    """Return what the passage taught, then or now; a store that another film taught is begun again."""
    known = store.learned()
    if known is not None:
        other = [file.name for file in changed(capture, known.files, verify=work.verify)]
        if not other:
            return pickup_of(recipe.cartridge_for(capture.bench, device), known), store
        work.told(f"changed since the passage was learned from them, and all is read again: {_named(other)}")
    if known is not None or any(store.is_written(piece) for piece in store.pieces):
        store = _empty(store.root, capture, store.manifest, store.recipe)
    files: dict[str, FileSeen] = {}
    pickup = learn(_noting(capture, files))
    taught = learned_of(pickup, tuple(files[name] for name in sorted(files)))
    with ctrl_c_waits():
        store.keep_learned(taught)
    # read back, so that the first time and every later one are the same to the bit
    return pickup_of(recipe.cartridge_for(capture.bench, device), store.learned() or taught), store


def _noting(capture: Capture, files: dict[str, FileSeen]) -> Capture:
    """Return a capture that notes the files of the groups that are asked for."""
    return _NotingCapture(capture.folder, capture.manifest, capture.source, capture.log, files)


@dataclass(frozen=True, eq=False)
class _NotingCapture(Capture):
    files: dict[str, FileSeen] = field(default_factory=dict)

    def group(self, number: int, contents: Contents | None = None) -> FrameGroup:
        before = look_at(self, number)
        if before.keys() <= self.files.keys():
            return super().group(number, contents)
        read = Contents(summed=True)
        group = super().group(number, read)
        if not before.keys() <= self.files.keys():
            found, _ = seen(self, number, before, read)
            self.files.update({file.name: file for file in found})
        return group
