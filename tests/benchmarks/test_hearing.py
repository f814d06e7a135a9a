"""What the table hears is what `play` writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy.hearing import hear
from benchmarks.accuracy.scenes import Case, scene_of
from gramoscope.apparatus.capture import open_capture
from gramoscope.listening.wav import full_scale_of, read_sound
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe
from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.film_sound import film_sound


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film") / "capture"
    samples, rate_hz = demo_sound(seconds=0.0025)
    film_sound(samples, float(rate_hz), scene_of(Case("little", "", "noise", frames=2)), folder)
    return folder


def test_a_capture_sounds_in_memory_as_in_the_file(film: Path, tmp_path: Path) -> None:
    # the recipe that needs no more than a few groups
    recipe = load_recipe("seed-paper")
    play(open_capture(film), recipe, tmp_path / "out", Settings(characteristic_name="flat"))
    written, _ = read_sound(tmp_path / "out" / "flat.wav")
    written = written.reshape(-1) * (full_scale_of(tmp_path / "out" / "flat.wav") or 1.0)
    heard = hear(film, recipe).sound
    assert np.ptp(written) > 0.001
    assert heard.samples == pytest.approx(written, abs=1e-6 * np.abs(written).max())
