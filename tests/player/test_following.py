"""A film is played while it is made: the same sound, warnings in time, and an end when the film ends."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.apparatus.filming import MARKER, say_whole, wait_for_groups, whole_groups
from gramoscope.apparatus.frame_log import GrowingLog, read_log
from gramoscope.errors import ArgumentError, FilmingError
from gramoscope.player import following as following_module
from gramoscope.player.executors import Processes
from gramoscope.player.following import follow
from gramoscope.player.kept_reading import Work
from gramoscope.player.live_meter import LiveMeter
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import no_flags
from gramoscope.signal_path import WallTrace
from gramoscope.simulation.scene import filming_bench


def _film_in_two_parts(film: Any, folder: Path, heard: threading.Event) -> None:
    """Film the second half when the first has been heard."""
    with CaptureWriter(folder, film.scene.bench, live=True) as writer:
        for number, images in enumerate(film.groups):
            if number == 4:
                heard.wait(60)
            writer.write_group(number, images)


def test_a_film_that_is_followed_sounds_as_one_that_is_done(
    film: Any, tmp_path: Path, played: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following_module, "LEARNED_GROUPS", 2)
    folder, heard, filmed = tmp_path / "live", threading.Event(), list[int | None]()
    filming = threading.Thread(target=_film_in_two_parts, args=(film, folder, heard))
    filming.start()
    following = follow(folder)

    def looked(monitor: Any, trace: WallTrace) -> None:
        filmed.append(whole_groups(folder))
        if monitor.groups == 4:
            heard.set()

    work = Work(following=following, watched=looked)
    report = play(following.capture, load_recipe("seed-paper"), tmp_path / "out", Settings(workers=2), work=work)
    filming.join()
    assert filmed[3] == 4, "the first half was heard before the second was filmed"
    assert not (folder / MARKER).exists()
    plain = played(folder, tmp_path / "plain")
    assert report["seconds"] == plain.report["seconds"]
    assert _samples(tmp_path / "out") == _samples(plain.folder)
    assert report["capture_problems"] == []
    assert report["problems"] == plain.report["problems"]
    assert any("played while it was filmed" in remark for remark in report["remarks"])


def _samples(out: Path) -> bytes:
    import soundfile

    return bytes(soundfile.read(out / "flat.wav", dtype="int32")[0].tobytes())


def test_a_capture_that_is_being_filmed_says_so(film: Any, tmp_path: Path) -> None:
    with CaptureWriter(tmp_path / "live", film.scene.bench, live=True) as writer:
        assert whole_groups(tmp_path / "live") == 0
        for number in (0, 2):
            writer.write_group(number, film.groups[number])
        assert whole_groups(tmp_path / "live") == 3
        (problem,) = open_capture(tmp_path / "live").problems
        assert "still being filmed" in problem
        with pytest.raises(ArgumentError, match="after a later one"):
            writer.write_group(1, film.groups[1])
    assert open_capture(tmp_path / "live").problems == ()


def test_a_live_film_that_fails_leaves_nothing(film: Any, tmp_path: Path) -> None:
    def fail() -> None:
        with CaptureWriter(tmp_path / "live", film.scene.bench, live=True) as writer:
            writer.write_group(0, film.groups[0])
            raise RuntimeError("the lamp")

    with pytest.raises(RuntimeError, match="the lamp"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_live_video_and_a_live_film_over_another_are_refused(film: Any, tmp_path: Path) -> None:
    for wrong in ({"layout": "video"}, {"overwrite": True}):
        with pytest.raises(ArgumentError, match="live"):
            CaptureWriter(tmp_path / "live", film.scene.bench, live=True, **wrong)


def test_a_film_that_does_not_go_on_is_told(tmp_path: Path) -> None:
    say_whole(tmp_path, 3)
    assert wait_for_groups(tmp_path, 3)
    with pytest.raises(FilmingError, match="after 3 groups"):
        wait_for_groups(tmp_path, 4, patience_s=0.2)


def test_following_with_other_processes_is_refused(capture: Path) -> None:
    with pytest.raises(ArgumentError, match="other workers"):
        Work(executor=Processes(2), following=follow(capture))


def test_a_log_that_grows_is_in_the_end_what_it_is(tmp_path: Path) -> None:
    sequence, path = Sequence(groups=3, frames_per_group=2), tmp_path / "frames.csv"
    growing = GrowingLog(path, sequence=sequence)
    growing.grow()
    text = "group,frame,arc_um,time_s,stage_um\n" + "".join(
        f"{group},{frame},{470.3 * group + frame},,{group}.5\n" for group in range(3) for frame in range(2)
    )
    for end in (10, 40, 41, 60, 61, len(text)):
        path.write_text(text[:end], encoding="utf-8")
        growing.grow()
        whole = text[:end].count("\n") - 1
        assert np.count_nonzero(np.isfinite(growing.log.arc_m)) == max(whole, 0)
    done = read_log(path, sequence=sequence)
    np.testing.assert_array_equal(growing.log.arc_m, done.arc_m)
    np.testing.assert_array_equal(growing.log.stage_m, done.stage_m)


def _stretch(bench: Bench, places_m: Any, number: int = 0) -> WallTrace:
    nothing = np.full(places_m.shape, np.nan)
    sigma = np.full(places_m.shape, 2e-8)
    return WallTrace(number, 0.0, 3e-6, places_m, sigma, nothing, nothing, 1.0, no_flags(*places_m.shape))


@pytest.fixture
def bench() -> Bench:
    return filming_bench(height_px=512)


def test_the_meter_knows_level_and_rows(bench: Bench) -> None:
    arc_m = 3e-6 * np.arange(150)
    # a whole number of periods: v = ω A / √2
    places = np.tile(2e-6 * np.sin(2 * np.pi * arc_m / 90e-6), (2, 1))
    figures, warnings = LiveMeter(bench).look(_stretch(bench, places))
    speed_m_s = float(bench.rotation.speed_at_m_s(0.0))
    assert figures.level_m_s == pytest.approx(2 * np.pi * 2e-6 / 90e-6 * speed_m_s / np.sqrt(2), rel=0.01)
    assert warnings == []
    assert figures.read == (1.0, 1.0)
    for stripe, (low, high) in zip(bench.stripes(), figures.stripe_rows, strict=True):
        assert high - stripe.row == pytest.approx(2e-6 / bench.sensor.pixel_pitch_m, rel=0.02)
        assert stripe.row - low == pytest.approx(2e-6 / bench.sensor.pixel_pitch_m, rel=0.02)


@pytest.mark.parametrize(("away_m", "words"), [(-90e-6, "leaves the picture"), (26e-6, "edge of the glass")])
def test_the_meter_warns_once_when_the_groove_goes_astray(bench: Bench, away_m: float, words: str) -> None:
    meter, still = LiveMeter(bench), np.zeros((2, 150))
    assert meter.look(_stretch(bench, still))[1] == []
    warnings = meter.look(_stretch(bench, still + away_m, 1))[1]
    assert any(words in warning and warning.startswith("group 1: ") for warning in warnings)
    assert meter.look(_stretch(bench, still + away_m, 2))[1] == []
    assert meter.look(_stretch(bench, still, 3))[1] == []
    assert any(words in warning for warning in meter.look(_stretch(bench, still + away_m, 4))[1])


def test_the_meter_warns_when_a_wall_cannot_be_read(bench: Bench) -> None:
    places = np.zeros((2, 150))
    places[0, :100] = np.nan
    (warning,) = LiveMeter(bench).look(_stretch(bench, places))[1]
    assert "only 33% of the inner wall" in warning
    assert replace(LiveMeter(bench).look(_stretch(bench, places))[0]).words().count("%") == 2
