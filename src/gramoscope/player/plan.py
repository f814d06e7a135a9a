"""What it takes to play a capture: disk, time and memory, by its manifest and by how fast this machine reads its groups."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from gramoscope.apparatus.capture import Capture
from gramoscope.apparatus.inspection import frame_bytes
from gramoscope.player.film import learned
from gramoscope.player.pieces import read_group
from gramoscope.player.reading_store import LARGEST_PIECE, QUANTITIES, STRIP_ROWS, GroupReading, Rows
from gramoscope.player.recipe import Recipe

MEASURED_GROUPS = 8
SOUND_BYTES_A_SECOND = 5 * 3 * 96_000
"""flat, walls (two channels), vertical, equalised: 24 bit at 96 kHz."""


@dataclass(frozen=True)
class Plan:
    """What a transfer takes.

    Attributes
    ----------
    groups : int
    seconds : float
        Of sound.
    frames_bytes, store_bytes, sound_bytes : float
        Frames to read; the reading, kept until the transfer is whole; sound files at 96 kHz.
    learning_s : float
        Once a passage, with so many workers.
    group_s : float
        To read a group, one worker, frames in the system's memory or not as they were found.
    workers : int
    working_bytes : float
        A piece of the passage for each worker, twice: as it grows and as it is written. The program itself comes on top.
    """

    groups: int
    seconds: float
    frames_bytes: float
    store_bytes: float
    sound_bytes: float
    learning_s: float
    group_s: float
    workers: int
    working_bytes: float

    def playing_s(self, workers: int) -> float:
        """Return how long so many workers read, where nothing but their processors holds them up."""
        return self.groups * self.group_s / workers

    def bytes_a_second(self, workers: int) -> float:
        """Return how fast the storage must be for so many workers."""
        return self.frames_bytes / self.playing_s(workers)


def plan_of(capture: Capture, recipe: Recipe, workers: int) -> Plan:
    """Return what it takes to play a capture on this machine; learns the passage and reads a few groups to find out.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    workers : int
    """
    begun = time.perf_counter()
    pickup = learned(capture, recipe, workers)
    learning_s = time.perf_counter() - begun
    numbers = np.unique(np.linspace(0, capture.group_count - 1, MEASURED_GROUPS).astype(int)).tolist()
    times, sizes = [], []
    for number in numbers:
        since = time.perf_counter()
        reading = read_group(capture, pickup, number)
        times.append(time.perf_counter() - since)
        sizes.append(_bytes_of(reading))
    bench, groups = capture.bench, capture.group_count
    seconds = float(bench.rotation.time_of_arc_s(bench.passage_length_m))
    group_bytes = float(np.mean(sizes))
    return Plan(
        groups=groups,
        seconds=seconds,
        frames_bytes=float(groups * bench.sequence.frames_per_group * frame_bytes(bench)),
        store_bytes=groups * group_bytes,
        sound_bytes=seconds * SOUND_BYTES_A_SECOND,
        learning_s=learning_s,
        group_s=float(np.median(times)),
        workers=workers,
        working_bytes=2 * workers * LARGEST_PIECE * group_bytes,
    )


def _bytes_of(reading: GroupReading) -> int:
    trace = reading.trace
    strips = sum(
        -(-Rows.of(end).used.size // STRIP_ROWS) * STRIP_ROWS * end.strip[0].nbytes
        for end in (trace.head, trace.tail)
        if end is not None
    )
    return int(strips) + len(QUANTITIES) * trace.offset_m.nbytes + trace.flags.nbytes
