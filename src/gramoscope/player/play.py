"""Play a capture: the signal path from end to end, on one screen.

Stretches are read by several threads and come back in order; everything after the pickup is one stream, so the result is
the same, bit for bit, for any number of workers, and memory does not grow with the passage.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gramoscope.apparatus.still import StillCapture
from gramoscope.disc.characteristics import characteristic
from gramoscope.disc.formats import direction_of_cut
from gramoscope.errors import CaptureError, require
from gramoscope.listening.broadcast_wave import FULL_SCALE_M_S
from gramoscope.listening.flac import HIGHEST_RATE_HZ as HIGHEST_FLAC_RATE_HZ
from gramoscope.pickup.device import Device
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.catalogue import Catalogue, metadata_of
from gramoscope.player.film import FilmReading
from gramoscope.player.hints import Hints
from gramoscope.player.kept_reading import Work
from gramoscope.player.monitor import OVERVIEW_POINTS, Monitor
from gramoscope.player.outputs import Outputs
from gramoscope.player.picture import groove_picture, worst_places
from gramoscope.player.quality_meter import QualityMeter
from gramoscope.player.quality_page import quality_page
from gramoscope.player.reading import AnyCapture, Passage, Reading
from gramoscope.player.recipe import Recipe
from gramoscope.player.report import transfer_report
from gramoscope.player.speed import Speed
from gramoscope.player.stills import SILENCE_S, StillReading
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
from gramoscope.preamp.equalisation import Equaliser
from gramoscope.preamp.in_a_row import in_a_row
from gramoscope.preamp.resample import Resampler
from gramoscope.preamp.walls import WallSplitter, in_direction
from gramoscope.signal_path import Audio, GrooveSound
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
    groove : int or None
        Of photographs, the only groove to be played, from 1; all of them when None.
    """

    rate_hz: float = 96_000.0
    characteristic_name: str = "riaa"
    workers: int = os.cpu_count() or 1
    full_scale_m_s: float = FULL_SCALE_M_S
    flac: bool = False
    catalogue: Catalogue = field(default_factory=Catalogue)
    speed: Speed = field(default_factory=Speed)
    device: Device = PROCESSOR
    groove: int | None = None

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
    capture: AnyCapture,
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
    capture : Capture or StillCapture
    recipe : Recipe
    folder : Path
        Where the tracks (`player.tracks`), `report.json`, `report.html` and `groove.png` go.
    settings : Settings
    progress : callable, optional
        Told how much is done, of how much, and of what ("Learning", "Playing").
    judge : callable, optional
        Given the report before anything is put in place; returns what to add to it, or raises (`player.again`).
    work : Work, optional
        Of a film: who reads, and what becomes of what was read before (`player.kept_reading`); the result does not depend on
        it.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    CaptureError
        If the groove was not seen anywhere.
    OutputError
        If something cannot be written. Whatever is raised, no half-written file stays, but what was read of a film is kept:
        the same call goes on from there.
    """
    started = time.perf_counter()
    bench, direction = capture.bench, direction_of_cut(capture.bench.disc.cut)
    equaliser = Equaliser(characteristic(settings.characteristic_name))
    resampler = Resampler(settings.speed.rotation_of(bench.rotation), settings.rate_hz, recipe.passband)

    with (
        _outputs(capture, recipe, folder, settings) as files,
        _begun(capture, recipe, folder, settings, files, work or Work(), progress) as reading,
    ):
        tonearm = Tonearm(resampler.rotation, direction, reading.wall_angle_rad, reading.length_m, recipe.smoother)
        monitor = _monitor(capture, tonearm, resampler)

        def played(passage: Passage) -> Iterator[GrooveSound]:
            follower = replace(tonearm, passage_length_m=passage.length_m)
            return resampler.resample(monitor.followed(follower.follow(passage.traces)))

        silence = round(SILENCE_S * settings.rate_hz)
        sound = in_a_row(map(played, reading.passages(monitor)), silence_samples=silence, told=reading.played)
        sound = files.kept(WALLS, sound, WallSplitter(direction, reading.walls).split)
        sound = files.kept(VERTICAL, sound, vertical)
        flat = files.kept(FLAT, _heard((in_direction(piece, direction) for piece in sound), monitor), alone)
        for _ in files.kept(EQUALISED, equaliser.equalise(_repaired(flat, recipe, files, settings)), alone):
            pass
        _require_sound(capture, monitor)
        elapsed_s = time.perf_counter() - started
        report = transfer_report(capture, recipe, reading, settings, monitor, files, folder, elapsed_s)
        report |= judge(report) if judge is not None else {}
        picture = groove_picture(capture, reading, monitor, rate_hz=settings.rate_hz, recipe_name=recipe.name)
        files.finish(report, picture, quality_page(report, worst_places(capture, reading, monitor)))
    return report


def _begun(
    capture: AnyCapture,
    recipe: Recipe,
    folder: Path,
    settings: Settings,
    files: Outputs,
    work: Work,
    progress: Progress | None,
) -> AbstractContextManager[Reading]:
    """Give a capture as it is after what must be known of the whole of it was found out."""
    if isinstance(capture, StillCapture):
        return nullcontext(StillReading.begun(capture, recipe, settings, files, progress))
    require(settings.groove is None, f"groove {settings.groove} of a film", "photographs", "leave --groove out")
    return FilmReading.begun(capture, recipe, folder, settings, work, progress)


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


def _outputs(capture: AnyCapture, recipe: Recipe, folder: Path, settings: Settings) -> Outputs:
    tracks = {
        track: metadata_of(track, capture.bench, recipe, settings, capture_name=capture.name)
        for track in tracks_of(recipe)
    }
    return Outputs(folder, tracks, rate_hz=settings.rate_hz, full_scale_m_s=settings.full_scale_m_s, flac=settings.flac)


def _monitor(capture: AnyCapture, tonearm: Tonearm, resampler: Resampler) -> Monitor:
    bench, rotation, rate_hz = capture.bench, resampler.rotation, resampler.rate_hz
    samples = float(rotation.time_of_arc_s(tonearm.passage_length_m)) * rate_hz
    quality = QualityMeter(tonearm, bench.disc.cut, rate_hz=rate_hz, passband=resampler.passband, samples=samples)
    monitor = Monitor(HoleGauge(bench.rotation), Hints(_steady_rpm(rotation), rate_hz), quality)
    monitor.overview.samples_per_point = max(1, int(np.ceil(samples / OVERVIEW_POINTS)))
    return monitor


def _steady_rpm(rotation: Rotation) -> float | None:
    return None if isinstance(rotation, DriftingRotation) else rotation.rpm


def _require_sound(capture: AnyCapture, monitor: Monitor) -> None:
    if monitor.samples == 0 or monitor.interpolated == monitor.samples:
        first = f"; the first problem: {monitor.problems[0]}" if monitor.problems else ""
        needed, remedy = NEEDED[capture.layout == "stills"]
        raise CaptureError(f"the groove was not found in any of {monitor.groups} groups{first}", needed, remedy)


NEEDED = (
    (
        "sharp stripes along the groove where capture.toml says they are",
        "look at the frames beside the rows that `gramoscope info` expects, and check [cover_glass], [disc] and rows; a "
        "film of less than eight groups can only be played with --recipe seed-paper",
    ),
    ("edges of a groove that can be followed from side to side", "look at the picture, and check groove_along"),
)
