"""One small film, rendered once, and what becomes of it when it is played."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from matplotlib.figure import Figure

from gramoscope.apparatus.bench import Sequence
from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player import play as play_module
from gramoscope.player.catalogue import Catalogue
from gramoscope.player.monitor import Monitor
from gramoscope.player.recipe import load_recipe
from gramoscope.signal_path import ImageArray
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage, render_group
from gramoscope.simulation.scene import Scene, filming_bench
from gramoscope.simulation.truth import truth_audio

SHARED = Path(__file__).parents[2].parent / "shared"
GROUPS, FRAMES = 8, 4
MADE = datetime(2031, 2, 13, 14, 15, 16, 170, tzinfo=UTC)
"""Transfers made at the same moment are the same to the byte."""


@dataclass(frozen=True)
class Film:
    """A filmed groove: the scene, what is cut there, and the pictures of each group."""

    scene: Scene
    passage: Passage
    groups: list[ImageArray]

    def write(
        self, folder: Path, *, layout: str = "tiff", groups: list[ImageArray] | None = None, **sensor: Any
    ) -> Path:
        """Write it as a capture, as a camera of another kind would have."""
        bench = self.scene.bench
        with CaptureWriter(folder, replace(bench, sensor=replace(bench.sensor, **sensor)), layout=layout) as writer:
            for number, images in enumerate(groups or self.groups):
                writer.write_group(number, images)
        return folder

    def sound_m_s(self, rate_hz: float) -> FloatArray:
        """What a perfect player would hear."""
        return truth_audio(self.scene, self.passage, rate_hz=rate_hz)


@dataclass(frozen=True)
class Played:
    """What a transfer left in its folder."""

    folder: Path
    report: dict[str, Any]
    monitor: Monitor

    def __getitem__(self, name: str) -> FloatArray:
        samples, _ = soundfile.read(self.folder / name)
        return samples

    def measured(self) -> BoolArray:
        """Which samples of a passage short enough to be drawn sample by sample were measured."""
        assert self.monitor.overview.samples_per_point == 1
        return ~self.monitor.overview.waveform(self.report["rate_hz"])[3]

    def bits(self, name: str) -> bytes:
        return (self.folder / name).read_bytes()


def play_capture(capture: Path, out: Path, *, recipe: str = "seed-paper", **settings: Any) -> Played:
    """Play a capture; the report is read from the file, not from memory."""
    settings.setdefault("catalogue", Catalogue(made=MADE))
    monitors: list[Monitor] = []
    draw = play_module.groove_picture

    def overhear(capture: Capture, pickup: Pickup, monitor: Monitor, **how: Any) -> Figure:
        monitors.append(monitor)
        return draw(capture, pickup, monitor, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(play_module, "groove_picture", overhear)
        play_module.play(open_capture(capture), load_recipe(recipe), out, play_module.Settings(**settings))
    return Played(out, json.loads((out / "report.json").read_text(encoding="utf-8")), monitors[0])


@pytest.fixture(scope="session")
def played() -> Callable[..., Played]:
    return play_capture


@pytest.fixture(scope="session")
def film() -> Film:
    """Eight groups of four frames: four milliseconds, neither centred nor symmetric, loud at the first sample."""
    bench = filming_bench(height_px=448)
    sequence = Sequence(groups=GROUPS, frames_per_group=FRAMES)
    scene = Scene(replace(bench, sequence=sequence), groove_middle_m=1.3e-6, seed=5)
    time_s = np.arange(300) / 48_000
    sound = np.sin(2 * np.pi * 910 * time_s + 1.2) + 0.5 * np.sin(2 * np.pi * 2370 * time_s + 0.3)
    passage = cut_passage(sound, rate_hz=48_000.0, scene=scene)
    return Film(scene, passage, [render_group(scene, passage, number) for number in range(GROUPS)])


@pytest.fixture(scope="session")
def capture(film: Film, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The film as grey TIFFs."""
    return film.write(tmp_path_factory.mktemp("film") / "capture")


@pytest.fixture(scope="session")
def transfer(capture: Path, tmp_path_factory: pytest.TempPathFactory) -> Played:
    """The film, played with one worker."""
    return play_capture(capture, tmp_path_factory.mktemp("transfer"), workers=1)


@pytest.fixture
def copy_of(capture: Path, tmp_path: Path) -> Path:
    """A copy of the capture, to be spoilt."""
    copy = tmp_path / "spoilt"
    for file in (path for path in capture.rglob("*") if path.is_file()):
        target = copy / file.relative_to(capture)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.read_bytes())
    return copy


def practice(name: str) -> Path:
    """A practice capture, or skip."""
    folder = SHARED / "captures" / name
    if not folder.is_dir():
        pytest.skip(f"the practice capture {name} is not here")
    return folder


@pytest.fixture(scope="session")
def practice_clean(tmp_path_factory: pytest.TempPathFactory) -> Played:
    return play_capture(practice("practice-clean"), tmp_path_factory.mktemp("practice-clean"))


@pytest.fixture(scope="session")
def practice_damaged(tmp_path_factory: pytest.TempPathFactory) -> Played:
    return play_capture(practice("practice-damaged"), tmp_path_factory.mktemp("practice-damaged"))
