"""Play a capture: the signal path from end to end, on one screen.

Stretches are read by several threads and come back in order; everything after the pickup is one stream, so the result is
the same, bit for bit, for any number of workers, and memory does not grow with the passage.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gramoscope.apparatus.capture import Capture
from gramoscope.disc.characteristics import characteristic
from gramoscope.disc.formats import direction_of_cut
from gramoscope.errors import CaptureError, require
from gramoscope.listening.broadcast_wave import FULL_SCALE_M_S
from gramoscope.listening.flac import HIGHEST_RATE_HZ as HIGHEST_FLAC_RATE_HZ
from gramoscope.pickup.cartridge import Pickup
from gramoscope.pickup.device import Device
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.catalogue import Catalogue, metadata_of
from gramoscope.player.centring import surveyed
from gramoscope.player.hints import Hints
from gramoscope.player.monitor import OVERVIEW_POINTS, Monitor
from gramoscope.player.outputs import Outputs
from gramoscope.player.picture import groove_picture, worst_places
from gramoscope.player.provenance import InputHashes
from gramoscope.player.quality_meter import QualityMeter
from gramoscope.player.quality_page import quality_page
from gramoscope.player.reading import Reading, Work, reading_of
from gramoscope.player.recipe import Recipe
from gramoscope.player.report import transfer_report
from gramoscope.player.speed import Speed
from gramoscope.player.tracks import (
    DIFFERENCE,
    EQUALISED,
    FLAT,
    REPAIRED,
    VERTICAL,
    WALLS,
    RepairedPiece,
    alone,
    left_of_repair,
    taken_by_repair,
    tracks_of,
    vertical,
)
from gramoscope.player.workers import spreading
from gramoscope.preamp.equalisation import Equaliser
from gramoscope.preamp.resample import Resampler
from gramoscope.preamp.walls import WallSplitter, in_direction
from gramoscope.signal_path import Audio, WallTrace
from gramoscope.tonearm.follow import Tonearm
from gramoscope.turntable.hole_gauge import HoleGauge
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import DriftingRotation


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
    full_scale_m_s : float
        The velocity that is ±1 in every sound file.
    flac : bool
        Write every sound as FLAC too.
    catalogue : Catalogue
        The archive's words.
    speed : Speed
        How fast the record shall turn.
    device : Device
        On which groups are read; results agree to rounding.
    """

    rate_hz: float = 96_000.0
    characteristic_name: str = "riaa"
    workers: int = os.cpu_count() or 1
    full_scale_m_s: float = FULL_SCALE_M_S
    flac: bool = False
    catalogue: Catalogue = field(default_factory=Catalogue)
    speed: Speed = field(default_factory=Speed)
    device: Device = PROCESSOR

    def __post_init__(self) -> None:
        possible = 1000 <= self.rate_hz <= 1_000_000 and self.rate_hz == round(self.rate_hz)
        require(
            possible, f"a rate of {self.rate_hz:g} Hz", "a whole number from 1000 to 1000000", "96000 for an archive"
        )
        require(self.workers >= 1, f"{self.workers} workers", "at least one")
        require(
            0 < self.full_scale_m_s <= 100,
            f"a full scale of {100 * self.full_scale_m_s:g} cm/s",
            "above 0, at most 10000",
        )
        require(
            not self.flac or self.rate_hz <= HIGHEST_FLAC_RATE_HZ,
            f"FLAC at {self.rate_hz:g} Hz",
            f"{HIGHEST_FLAC_RATE_HZ} Hz at the most",
            "leave FLAC out",
        )


def play(
    capture: Capture,
    recipe: Recipe,
    folder: Path,
    settings: Settings,
    *,
    progress: Progress | None = None,
    judge: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None,
    work: Work | None = None,
) -> dict[str, Any]:
    """Turn a capture into sound files, a report and a picture.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    folder : Path
        Where the tracks (`player.tracks`), `report.json`, `report.html` and `groove.png` go.
    settings : Settings
    progress : callable, optional
        Told how much is done, of how much, and of what ("Learning", "Playing").
    judge : callable, optional
        Given the report before anything is put in place; returns what to add to it, or raises (`player.again`).
    work : Work, optional
        Who reads, and what becomes of what was read before (`player.reading`); the result does not depend on it.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    CaptureError
        If the groove was not seen anywhere.
    OutputError
        If something cannot be written. Whatever is raised, no half-written file stays, but what was read is kept: the same
        call goes on from there.
    """
    started = time.perf_counter()
    bench, direction = capture.bench, direction_of_cut(capture.bench.disc.cut)
    rotation = settings.speed.rotation_of(bench.rotation)
    equaliser = Equaliser(characteristic(settings.characteristic_name))
    tonearm = Tonearm(rotation, direction, bench.disc.wall_angle_rad, bench.passage_length_m, recipe.smoother)
    resampler = Resampler(rotation, settings.rate_hz, recipe.passband)
    hashes, monitor = InputHashes(), _monitor(capture, tonearm, resampler)

    with (
        _outputs(capture, recipe, folder, settings) as files,
        _reading(capture, recipe, folder, settings, work or Work(), progress) as reading,
    ):
        pickup = reading.pickup
        centring = surveyed(capture, pickup, settings.workers, asked=settings.speed.remove_wow)
        traces = _picked_up(reading, hashes, monitor, progress)
        motion = monitor.followed(tonearm.follow(_spliced(centring.centred(traces), recipe, monitor)))
        sound = files.kept(WALLS, resampler.resample(motion), WallSplitter(direction, pickup.walls).split)
        sound = files.kept(VERTICAL, sound, vertical)
        flat = files.kept(FLAT, _heard((in_direction(piece, direction) for piece in sound), monitor), alone)
        for _ in files.kept(EQUALISED, equaliser.equalise(_repaired(flat, recipe, files, settings)), alone):
            pass
        _require_sound(monitor)
        elapsed_s = time.perf_counter() - started
        report = transfer_report(capture, recipe, pickup, settings, hashes, monitor, centring, files, folder, elapsed_s)
        report["remarks"] += reading.remarks()
        report |= judge(report) if judge is not None else {}
        picture = groove_picture(capture, pickup, monitor, rate_hz=settings.rate_hz, recipe_name=recipe.name)
        files.finish(report, picture, quality_page(report, worst_places(capture, pickup, monitor)))
    return report


def learned(
    capture: Capture,
    recipe: Recipe,
    workers: int,
    *,
    device: Device = PROCESSOR,
    progress: Progress | None = None,
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


def _reading(
    capture: Capture, recipe: Recipe, folder: Path, settings: Settings, work: Work, progress: Progress | None
) -> AbstractContextManager[Reading]:
    workers, device = settings.workers, settings.device

    def learn(noted: Capture) -> Pickup:
        first = None
        if work.following is not None:
            first = work.following.learned_groups
            work.following.wait(first)
        return learned(noted, recipe, workers, device=device, progress=progress, groups=first)

    return reading_of(capture, recipe, folder, device=device, workers=workers, work=work, learn=learn)


def _picked_up(
    reading: Reading, hashes: InputHashes, monitor: Monitor, progress: Progress | None
) -> Iterator[WallTrace]:
    """Read the stretches, several at a time."""
    for group in reading.groups():
        hashes.add({file.name: file.sha256 for file in group.files})
        monitor.picked_up(group.trace, group.frames_lost)
        reading.work.watched(monitor, group.trace)
        if progress is not None:
            progress(monitor.groups, reading.reader.store.group_count, "Playing")
        yield group.trace


def _spliced(traces: Iterator[WallTrace], recipe: Recipe, monitor: Monitor) -> Iterator[WallTrace]:
    for trace, match in recipe.splice.join(traces):
        monitor.spliced(match, trace)
        yield trace


def _heard(pieces: Iterator[Audio], monitor: Monitor) -> Iterator[Audio]:
    for piece in pieces:
        monitor.heard(piece)
        yield piece


def _repaired(pieces: Iterator[Audio], recipe: Recipe, files: Outputs, settings: Settings) -> Iterator[Audio]:
    """Repair what is asked for; what is left and what was taken off are kept."""
    if files.cues is None:
        yield from pieces
        return
    pairs = recipe.repair.repair(pieces, files.cues.note)
    done = (RepairedPiece.of(raw, after, full_scale_m_s=settings.full_scale_m_s) for raw, after in pairs)
    for piece in files.kept(DIFFERENCE, files.kept(REPAIRED, done, left_of_repair), taken_by_repair):
        yield piece.sound


def _outputs(capture: Capture, recipe: Recipe, folder: Path, settings: Settings) -> Outputs:
    name = capture.folder.resolve().name
    tracks = {
        track: metadata_of(track, capture.bench, recipe, settings, capture_name=name) for track in tracks_of(recipe)
    }
    return Outputs(folder, tracks, rate_hz=settings.rate_hz, full_scale_m_s=settings.full_scale_m_s, flac=settings.flac)


def _monitor(capture: Capture, tonearm: Tonearm, resampler: Resampler) -> Monitor:
    bench, rotation, rate_hz = capture.bench, resampler.rotation, resampler.rate_hz
    samples = float(rotation.time_of_arc_s(bench.passage_length_m)) * rate_hz
    quality = QualityMeter(tonearm, bench.disc.cut, rate_hz=rate_hz, passband=resampler.passband, samples=samples)
    monitor = Monitor(HoleGauge(bench.rotation), Hints(_steady_rpm(rotation), rate_hz), quality)
    monitor.overview.samples_per_point = max(1, int(np.ceil(samples / OVERVIEW_POINTS)))
    return monitor


def _steady_rpm(rotation: Rotation) -> float | None:
    return None if isinstance(rotation, DriftingRotation) else rotation.rpm


def _require_sound(monitor: Monitor) -> None:
    if monitor.samples == 0 or monitor.interpolated == monitor.samples:
        raise CaptureError(
            f"the groove was not found in any of {monitor.groups} groups"
            + (f"; the first problem: {monitor.problems[0]}" if monitor.problems else ""),
            "sharp stripes along the groove where capture.toml says they are",
            "look at the frames beside the rows that `gramoscope info` expects, and check [cover_glass], [disc] and rows; a "
            "film of less than eight groups can only be played with --recipe seed-paper",
        )
