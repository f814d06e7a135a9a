"""A tone, a bench that films it quickly, and a capture made by the command itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from gramoscope.cli.main import main

BENCH = """
format = "gramoscope-capture/1"
[disc]
cut = "lateral"
rpm = 78.0
radius_mm = 115.0
wall_angle_deg = 45.0
[camera]
width_px = 1280
height_px = 448
bits = 8
colour = "mono"
pixel_pitch_um = 0.390625
columns = "forward"
rows = "inward"
[microscope]
magnification = 40.0
numerical_aperture = 0.65
tube_length_mm = 160.0
focus_below_land_um = 20.0
[cover_glass]
thickness_mm = 0.11
refractive_index = 1.515
side = "low"
edge_row = 316.0
[sequence]
frames_per_group = 4
frame_step_um = 0.8
group_step_um = 469.53
"""


QUICKLY = ("--recipe", "seed-paper")
"""Reads a film of a few groups, and fast."""


@dataclass(frozen=True)
class Answer:
    """How a command ended and what it said."""

    code: int
    out: str
    err: str


@pytest.fixture
def gramoscope(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Run a command line in this process, on a wide terminal."""
    monkeypatch.setenv("COLUMNS", "300")
    monkeypatch.setenv("NO_COLOR", "1")

    def run(*arguments: Any) -> Answer:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return Answer(code, out, err)

    return run


@pytest.fixture(scope="session")
def quickly() -> tuple[str, ...]:
    """Options for playing films of a few groups, which teach the default recipe nothing."""
    return QUICKLY


@pytest.fixture(scope="session")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("commands")


@pytest.fixture(scope="session")
def bench(here: Path) -> Path:
    (here / "bench.toml").write_text(BENCH, encoding="utf-8")
    return here / "bench.toml"


@pytest.fixture(scope="session")
def tone(here: Path) -> Path:
    """Half a second of two tones, not in step with anything."""
    time_s = np.arange(22_050) / 44_100
    sound = 0.3 * np.sin(2 * np.pi * 870 * time_s + 1.2) + 0.2 * np.sin(2 * np.pi * 2310 * time_s + 0.2)
    soundfile.write(here / "tone.wav", sound, 44_100, subtype="PCM_24")
    return here / "tone.wav"


@pytest.fixture(scope="session")
def capture(here: Path, bench: Path, tone: Path) -> Path:
    """Three milliseconds of the tone."""
    folder = here / "capture"
    command = ["film", tone, folder, "--bench", bench, "--start", 0.0313, "--seconds", 0.003, "--quiet"]
    assert main([str(part) for part in command]) == 0
    return folder


@pytest.fixture(scope="session")
def longer_capture(here: Path, tone: Path, bench: Path) -> Path:
    """Twenty groups: a second or two of playing."""
    command = ["film", tone, here / "longer", "--bench", bench, "--seconds", 0.01, "--quiet"]
    assert main([str(part) for part in command]) == 0
    return here / "longer"


@pytest.fixture
def copy_of(capture: Path, tmp_path: Path) -> Path:
    """A copy of the capture, to be spoilt."""
    copy = tmp_path / "spoilt"
    for file in (path for path in capture.rglob("*") if path.is_file()):
        target = copy / file.relative_to(capture)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.read_bytes())
    return copy
