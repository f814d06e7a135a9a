"""The simulator cuts with the curves that the player undoes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gramoscope.disc.characteristics import characteristic
from gramoscope.simulation.film_sound import film_sound
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.scene import Scene

RATE_HZ = 48_000.0
TONES_HZ = (1000.0, 9000.0)


def _amplitudes(passage: Passage, *, stop_s: float) -> np.ndarray:
    """Of the two tones in the middle of the groove, by least squares."""
    time_s = np.linspace(0.4 * stop_s, 0.7 * stop_s, 2000)
    velocity, _ = passage.velocity_m_s(passage.rotation.arc_of_time_m(time_s))
    waves = [wave(2 * np.pi * tone * time_s) for tone in TONES_HZ for wave in (np.cos, np.sin)]
    parts, *_ = np.linalg.lstsq(np.stack(waves, axis=1), velocity, rcond=None)
    return np.hypot(parts[::2], parts[1::2])


@pytest.mark.parametrize("name", ["columbia-lp", "300R-12.7", "aes", None])
def test_the_groove_follows_the_analytic_recording_curve(
    small: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str | None
) -> None:
    sensor = small.bench.sensor
    dark = np.zeros((3, sensor.height_px, sensor.width_px), np.uint8 if sensor.bits == 8 else np.uint16)
    monkeypatch.setattr("gramoscope.simulation.film.render_group", lambda *_: dark)
    time_s = np.arange(960) / RATE_HZ
    sound = sum(np.sin(2 * np.pi * tone * time_s + 0.4) for tone in TONES_HZ)
    disc = replace(small.bench.disc, characteristic=name)
    scene = replace(small, bench=replace(small.bench, disc=disc))
    passage = film_sound(sound, RATE_HZ, scene, tmp_path / "capture")
    low, high = _amplitudes(passage, stop_s=time_s[-1])
    low_expected, high_expected = np.abs(characteristic(name or "flat").recording_response(TONES_HZ))
    assert 20 * np.log10(high / low) == pytest.approx(20 * np.log10(high_expected / low_expected), abs=0.02)
