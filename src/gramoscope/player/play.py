"""Play a capture: the signal path from end to end, on one screen.

Stretches are read by several threads and come back in order; everything after the pickup is one stream, so the result is
the same, bit for bit, for any number of workers, and memory does not grow with the passage.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gramoscope.apparatus.capture import Capture
from gramoscope.disc.characteristics import characteristic
from gramoscope.disc.formats import direction_of_cut
from gramoscope.errors import CaptureError, require
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.monitor import OVERVIEW_POINTS, Monitor
from gramoscope.player.outputs import Outputs
from gramoscope.player.picture import groove_picture
from gramoscope.player.provenance import InputHashes, hash_group
from gramoscope.player.recipe import Recipe
from gramoscope.player.report import transfer_report
from gramoscope.player.workers import in_order, spreading
from gramoscope.preamp.equalisation import Equaliser
from gramoscope.preamp.resample import Resampler
from gramoscope.signal_path import Audio, WallTrace
from gramoscope.tonearm.follow import Tonearm


class Progress(Protocol):
    """Told how far things are."""

    def __call__(self, done: int, total: int, what: str, /) -> None:
        """So much is done of how much of what."""
        ...


@dataclass(frozen=True)
class Settings:
    """What the listener chose, beside the recipe.

    Parameters
    ----------
    rate_hz : float
        A whole number of samples a second, 1000 … 1 000 000.
    characteristic_name : str
        Recording characteristic to undo in `equalised.wav`.
    workers : int
    """

    rate_hz: float = 96_000.0
    characteristic_name: str = "riaa"
    workers: int = os.cpu_count() or 1

    def __post_init__(self) -> None:
        possible = 1000 <= self.rate_hz <= 1_000_000 and self.rate_hz == round(self.rate_hz)
        require(
            possible, f"a rate of {self.rate_hz:g} Hz", "a whole number from 1000 to 1000000", "96000 for an archive"
        )
        require(self.workers >= 1, f"{self.workers} workers", "at least one")


def play(
    capture: Capture, recipe: Recipe, folder: Path, settings: Settings, *, progress: Progress | None = None
) -> dict[str, Any]:
    """Turn a capture into sound files, a report and a picture.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    folder : Path
        Where `flat.wav`, `equalised.wav`, `report.json` and `groove.png` go, and the files of a repair if the recipe asks
        for one (`gramoscope.player.repair_files`); `equalised.wav` is then made of the repaired sound.
    settings : Settings
    progress : callable, optional
        Told how much is done, of how much, and of what ("Learning", "Playing").

    Returns
    -------
    dict
        The report.

    Raises
    ------
    CaptureError
        If the groove was not seen anywhere.
    OutputError
        If something cannot be written. Whatever is raised, no half-written file stays.
    """
    started = time.perf_counter()
    bench, direction = capture.bench, direction_of_cut(capture.bench.disc.cut)
    equaliser = Equaliser(characteristic(settings.characteristic_name))
    tonearm = Tonearm(bench.rotation, direction, bench.disc.wall_angle_rad, bench.passage_length_m, recipe.smoother)
    resampler = Resampler(bench.rotation, direction, settings.rate_hz, recipe.passband)
    hashes, monitor = InputHashes(), _monitor(capture, settings.rate_hz)

    with Outputs(folder, rate_hz=settings.rate_hz, repaired=recipe.repair.asked) as files:
        pickup = learned(capture, recipe, settings.workers, progress=progress)
        traces = _picked_up(capture, pickup, settings.workers, hashes, monitor, progress)
        spliced = _spliced(traces, recipe, monitor)
        motion = tonearm.follow(spliced)
        flat = _written(resampler.resample(motion), files, monitor)
        for piece in equaliser.equalise(_repaired(flat, recipe, files)):
            files.equalised.write(piece.samples)
        _require_sound(monitor)
        report = transfer_report(
            capture, recipe, pickup, settings, hashes, monitor, files, time.perf_counter() - started
        )
        picture = groove_picture(capture, pickup, monitor, rate_hz=settings.rate_hz, recipe_name=recipe.name)
        files.finish(report, picture)
    return report


def learned(capture: Capture, recipe: Recipe, workers: int, *, progress: Progress | None = None) -> Pickup:
    """Return the recipe's cartridge, fitted to a capture, as it is after learning the passage.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    workers : int
    progress : callable, optional
        Told how much is done, of how much, and of what.
    """
    with spreading(workers) as spread:
        cartridge = recipe.cartridge_for(capture.bench)

        def told(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total, "Learning")

        return cartridge.learn(capture.group, capture.group_count, spread, told)


def _picked_up(
    capture: Capture, pickup: Pickup, workers: int, hashes: InputHashes, monitor: Monitor, progress: Progress | None
) -> Iterator[WallTrace]:
    """Read the stretches, several at a time."""

    def read(number: int) -> tuple[WallTrace, dict[str, str], int]:
        group = capture.group(number)
        return pickup.read(group), hash_group(capture, number), int(np.count_nonzero(~group.valid))

    for trace, sums, frames_lost in in_order(read, range(capture.group_count), workers=workers):
        hashes.add(sums)
        monitor.picked_up(trace, frames_lost)
        if progress is not None:
            progress(monitor.groups, capture.group_count, "Playing")
        yield trace


def _spliced(traces: Iterator[WallTrace], recipe: Recipe, monitor: Monitor) -> Iterator[WallTrace]:
    for trace, match in recipe.splice.join(traces):
        monitor.spliced(match)
        yield trace


def _written(pieces: Iterator[Audio], files: Outputs, monitor: Monitor) -> Iterator[Audio]:
    for piece in pieces:
        files.flat.write(piece.samples)
        monitor.heard(piece)
        yield piece


def _repaired(pieces: Iterator[Audio], recipe: Recipe, files: Outputs) -> Iterator[Audio]:
    if files.repair is None:
        yield from pieces
        return
    for raw, repaired in recipe.repair.repair(pieces, files.repair.note):
        files.repair.write(raw, repaired)
        yield repaired


def _monitor(capture: Capture, rate_hz: float) -> Monitor:
    samples = float(capture.bench.rotation.time_of_arc_s(capture.bench.passage_length_m)) * rate_hz
    monitor = Monitor()
    monitor.overview.samples_per_point = max(1, int(np.ceil(samples / OVERVIEW_POINTS)))
    return monitor


def _require_sound(monitor: Monitor) -> None:
    if monitor.samples == 0 or monitor.interpolated == monitor.samples:
        raise CaptureError(
            f"the groove was not found in any of {monitor.groups} groups"
            + (f"; the first problem: {monitor.problems[0]}" if monitor.problems else ""),
            "sharp stripes along the groove where capture.toml says they are",
            "look at the frames beside the rows that `gramoscope info` expects, and check [cover_glass], [disc] and rows; a "
            "film of less than eight groups can only be played with --recipe seed-paper",
        )
