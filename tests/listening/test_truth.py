"""What a film was made of becomes a sound in seconds and metres a second."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from gramoscope.errors import ArgumentError, SoundError
from gramoscope.listening.compare import compare
from gramoscope.listening.truth import load_for_comparison, truth_sound

RATE_HZ = 48_000.0
SPEED_UM_S = 812_345.0
PRACTICE = Path(__file__).parents[2].parent / "shared" / "captures" / "practice-clean" / "truth.npz"


def _tone(time_s: np.ndarray, *, pitch_hz: float = 700.0) -> np.ndarray:
    return 0.05 * np.sin(2 * np.pi * pitch_hz * time_s + 0.4)


def _write_truth(path: Path, **changes: object) -> Path:
    arc_um = np.arange(60_000) * 0.4
    time_s = arc_um / SPEED_UM_S
    truth: dict[str, object] = {
        "arc_um": arc_um,
        "lateral_um_s": 1e6 * _tone(time_s),
        "vertical_um_s": 1e6 * 2 * _tone(time_s, pitch_hz=300.0),
        "speed_um_s": SPEED_UM_S,
    }
    np.savez(path, **{key: value for key, value in {**truth, **changes}.items() if value is not None})
    return path


def _times(count: int) -> np.ndarray:
    return np.arange(count) / RATE_HZ


def test_velocity_at_a_place_becomes_velocity_at_a_time(tmp_path: Path) -> None:
    sound = truth_sound(_write_truth(tmp_path / "truth.npz"), rate_hz=RATE_HZ)
    assert len(sound) == pytest.approx(60_000 * 0.4 / SPEED_UM_S * RATE_HZ, abs=1.5)
    inside = slice(60, -60)
    assert sound[inside] == pytest.approx(_tone(_times(len(sound)))[inside], abs=2e-5)


def test_a_groove_that_slows_down_lasts_longer(tmp_path: Path) -> None:
    arc_um = np.arange(60_000) * 0.4
    decay_m = 0.3e6
    # V = V0 exp(−s/L) passes s at t = L/V0 (exp(s/L) − 1)
    time_s = decay_m / SPEED_UM_S * np.expm1(arc_um / decay_m)
    path = _write_truth(
        tmp_path / "truth.npz", lateral_um_s=1e6 * _tone(time_s), speed_um_s=SPEED_UM_S * np.exp(-arc_um / decay_m)
    )
    sound = truth_sound(path, rate_hz=RATE_HZ)
    assert sound[60:-60] == pytest.approx(_tone(_times(len(sound)))[60:-60], abs=2e-5)


def test_sample_zero_is_place_zero_even_when_the_truth_begins_earlier(tmp_path: Path) -> None:
    arc_um = np.arange(-9_123, 50_000) * 0.4
    velocity = {key: 1e6 * _tone(arc_um / SPEED_UM_S) for key in ("lateral_um_s", "vertical_um_s")}
    sound = truth_sound(_write_truth(tmp_path / "truth.npz", arc_um=arc_um, **velocity), rate_hz=RATE_HZ)
    assert sound[60:-60] == pytest.approx(_tone(_times(len(sound)))[60:-60], abs=2e-5)


def test_the_cut_decides_which_velocity_is_the_sound(tmp_path: Path) -> None:
    path = _write_truth(tmp_path / "truth.npz")
    lateral, vertical = (truth_sound(path, rate_hz=RATE_HZ, cut=cut) for cut in ("lateral", "vertical"))
    stereo = truth_sound(path, rate_hz=RATE_HZ, cut="stereo")
    assert stereo[:, 0] == pytest.approx((lateral - vertical) / np.sqrt(2), abs=1e-9)
    assert stereo[:, 1] == pytest.approx((lateral + vertical) / np.sqrt(2), abs=1e-9)
    assert truth_sound(path, rate_hz=RATE_HZ, cut="stronger").tolist() == vertical.tolist()
    with pytest.raises(ArgumentError):
        truth_sound(path, rate_hz=RATE_HZ, cut="")  # type: ignore[arg-type]


def test_a_truth_and_a_sound_file_are_loaded_alike(tmp_path: Path) -> None:
    truth, truth_rate_hz = load_for_comparison(_write_truth(tmp_path / "truth.npz"), rate_hz=RATE_HZ, cut="lateral")
    soundfile.write(tmp_path / "flat.wav", -2 * truth, 48_000, subtype="FLOAT")
    sound, rate_hz = load_for_comparison(tmp_path / "flat.wav")
    assert (truth.ndim, truth_rate_hz, sound.shape, rate_hz) == (2, RATE_HZ, truth.shape, 48_000)
    found = compare(truth, truth_rate_hz, sound, rate_hz)
    assert (found.polarity, found.gain_db) == (-1, pytest.approx(6.0206, abs=1e-3))


def test_a_file_that_is_no_truth_is_a_sound_error_that_says_what_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "truth.npz"
    wrong: list[tuple[dict[str, object], str]] = [
        ({"speed_um_s": None}, "lacks speed_um_s"),
        ({"speed_um_s": 0.0}, "no passage"),
        ({"arc_um": np.zeros(60_000)}, "no passage"),
        ({"arc_um": np.arange(5.0)}, "no passage"),
        ({"lateral_um_s": np.full(60_000, np.nan)}, "no passage"),
    ]
    for changes, words in wrong:
        _write_truth(path, **changes)
        with pytest.raises(SoundError, match=words):
            load_for_comparison(path)
    path.write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(SoundError, match="cannot be read"):
        load_for_comparison(path)
    with pytest.raises(SoundError, match="cannot be read"):
        load_for_comparison(tmp_path / "missing.npz")


def test_the_practice_capture_has_the_sound_it_says() -> None:
    if not PRACTICE.exists():
        pytest.skip("the practice captures are not here")
    with np.load(PRACTICE) as stored:
        seconds = float(stored["arc_um"][-1] / stored["speed_um_s"])
        loudest = float(np.max(np.abs(stored["lateral_um_s"]))) / 1e6
    sound = truth_sound(PRACTICE, rate_hz=192_000.0)
    assert len(sound) / 192_000 == pytest.approx(seconds, abs=1e-5)
    assert np.max(np.abs(sound)) == pytest.approx(loudest, rel=0.02)


def test_a_truth_that_begins_loud_does_not_ring_at_its_ends(tmp_path: Path) -> None:
    arc = np.arange(8000) * 0.4
    speed = 0.9e6
    lateral = 2e5 + 3e4 * np.sin(2 * np.pi * 900 * arc / speed)
    np.savez(tmp_path / "t.npz", arc_um=arc, lateral_um_s=lateral, vertical_um_s=0 * lateral, speed_um_s=speed)
    heard = truth_sound(tmp_path / "t.npz", rate_hz=96_000.0, cut="lateral")
    expected = 0.2 + 0.03 * np.sin(2 * np.pi * 900 * np.arange(len(heard)) / 96e3)
    np.testing.assert_allclose(heard, expected, atol=2e-3)
    np.testing.assert_allclose(heard[12:-12], expected[12:-12], atol=3e-4)
