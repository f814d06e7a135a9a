"""Filming as a whole: reproducible, in order, with the truth beside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gramoscope.errors import ArgumentError, OutputError
from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.film import film
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import filmed_group
from gramoscope.simulation.rig import ROUGH_RIG, Rig
from gramoscope.simulation.scene import Scene, filming_bench, named_scene
from gramoscope.simulation.truth import save_truth, truth_audio, truth_of


class _Shelf:
    """Keeps what it is given."""

    def __init__(self) -> None:
        self.groups: dict[int, np.ndarray] = {}
        self.log: dict[int, dict[str, np.ndarray]] = {}

    def write_group(self, number: int, images: np.ndarray, **log: np.ndarray) -> None:
        self.groups[number] = images
        self.log[number] = log


def _film(scene: Scene, sound: np.ndarray, **options: object) -> _Shelf:
    shelf = _Shelf()
    film(sound, 48_000.0, scene, shelf, **options)
    return shelf


def test_one_worker_and_three_make_the_same_film(small: Scene, sound: np.ndarray) -> None:
    rough = replace(small, rig=replace(ROUGH_RIG, lost_share=0.0))
    one, three = _film(rough, sound, workers=1), _film(rough, sound, workers=3)
    assert list(one.groups) == list(three.groups) == [0, 1, 2, 3, 4]
    for number, images in one.groups.items():
        np.testing.assert_array_equal(images, three.groups[number])


def test_no_more_than_one_group_a_worker_waits_in_memory(
    small: Scene, sound: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[int] = []
    waiting: list[int] = []

    def instantly(scene: Scene, passage: Passage, number: int) -> np.ndarray:
        begun.append(number)
        return np.zeros((3, 4, 5), np.uint8)

    monkeypatch.setattr("gramoscope.simulation.film.render_group", instantly)
    long = replace(small, bench=replace(small.bench, sequence=replace(small.bench.sequence, groups=60)))
    film(sound, 48_000.0, long, _Shelf(), workers=2, progress=lambda done, total: waiting.append(len(begun) - done))
    assert max(waiting) <= 2


def test_progress_is_told_and_the_log_is_nominal(small: Scene, sound: np.ndarray) -> None:
    told: list[tuple[int, int]] = []
    rough = replace(small, rig=Rig(group_position_m=3e-6, stage_wander_m=2e-6))
    shelf = _film(rough, sound, progress=lambda done, total: told.append((done, total)))
    assert told == [(k, 5) for k in range(1, 6)]
    np.testing.assert_allclose(shelf.log[3]["arc_start_m"], 210e-6 + np.arange(3) * 0.8e-6)
    np.testing.assert_allclose(shelf.log[3]["stage_m"], filmed_group(rough, 3).stage_m)
    assert shelf.log[3]["time_s"][1] == pytest.approx(10 * 4e-3)


def test_lost_groups_are_left_out_or_black(small: Scene, sound: np.ndarray) -> None:
    careless = replace(small, rig=Rig(lost_share=1.0))
    assert _film(careless, sound).groups == {}
    assert not any(images.any() for images in _film(careless, sound, lost="black").groups.values())


def test_a_failed_flash_spoils_a_single_frame(small: Scene, sound: np.ndarray) -> None:
    images = _film(replace(small, rig=Rig(black_share=1.0)), sound).groups[2]
    assert sorted(frame.mean() > 20 for frame in images) == [False, True, True]
    images = _film(replace(small, rig=Rig(saturated_share=1.0)), sound).groups[2]
    assert sorted(frame.mean() > 250 for frame in images) == [False, False, True]


def test_the_truth_is_that_of_the_passage(small: Scene, sound: np.ndarray) -> None:
    scene = replace(small, rig=Rig(frame_step_share=0.08, group_position_m=3e-6))
    passage = film(sound, 48_000.0, scene, _Shelf())
    truth = truth_of(scene, passage)
    arc_m = truth["arc_um"] * 1e-6
    assert arc_m[0] == 0
    assert arc_m[-1] == pytest.approx(scene.bench.passage_length_m, abs=4e-7)
    slope = np.gradient(truth["lateral_um"].astype(float), truth["arc_um"])
    np.testing.assert_allclose(slope[1:-1] * truth["speed_um_s"], truth["lateral_um_s"][1:-1], atol=60)
    assert not truth["vertical_um_s"].any()
    assert truth["frame_starts_um"].shape == (5, 3)
    np.testing.assert_array_equal(truth["frame_starts_um"][:, 0], truth["starts_um"])
    steps = np.diff(truth["frame_starts_um"], axis=1)
    assert 0 < np.abs(steps - 0.8).max() < 0.4
    assert truth["starts_um"][0] == 0
    assert 0 < np.abs(truth["starts_um"] - 70.0 * np.arange(5)).max() < 15


def test_the_true_sound_is_the_sound_that_was_cut(sound: np.ndarray) -> None:
    long_enough = named_scene(filming_bench()).lasting(0.04)
    passage = film(sound, 48_000.0, replace(long_enough, bench=filming_bench(height_px=16)), _Shelf())
    heard = truth_audio(long_enough, passage, rate_hz=48_000.0)
    assert len(heard) >= len(sound)
    inner = slice(200, 1700)
    assert np.corrcoef(heard[inner], sound[inner])[0, 1] > 0.9999
    assert heard[: len(sound)].std() == pytest.approx(0.03, rel=0.01)


def test_truth_is_saved_whole_or_not_at_all(small: Scene, sound: np.ndarray, tmp_path: Path) -> None:
    passage = film(sound, 48_000.0, small, _Shelf())
    path = save_truth(tmp_path, small, passage)
    with np.load(path) as saved:
        expected = truth_of(small, passage)
        assert set(saved) == set(expected)
        np.testing.assert_array_equal(saved["lateral_um_s"], expected["lateral_um_s"])
    assert [entry.name for entry in tmp_path.iterdir()] == ["truth.npz"]
    with pytest.raises(OutputError):
        save_truth(tmp_path / "nowhere", small, passage)


def test_a_scene_lasts_as_long_as_its_sound() -> None:
    scene = Scene().lasting(1.0)
    bench = scene.bench
    assert bench.passage_length_m >= bench.rotation.arc_of_time_m(1.0)
    assert bench.passage_length_m - bench.sequence.group_step_m < bench.rotation.arc_of_time_m(1.0)


def test_unknown_names_and_impossible_scenes_are_refused(small: Scene, sound: np.ndarray) -> None:
    with pytest.raises(ArgumentError, match="powder, shellac, polished"):
        named_scene(filming_bench(), texture="velvet")
    with pytest.raises(ArgumentError):
        replace(small, seed=-1)
    with pytest.raises(ArgumentError):
        Rig(lost_share=1.2)
    with pytest.raises(ArgumentError):
        film(sound, 48_000.0, small, _Shelf(), workers=0)


def test_the_demonstration_is_always_the_same_sound_between_150_hz_and_6_khz() -> None:
    sound, rate_hz = demo_sound(seconds=0.4)
    np.testing.assert_array_equal(sound, demo_sound(seconds=0.4)[0])
    assert len(sound) == 0.4 * rate_hz
    assert np.abs(sound).max() == 1
    power = np.abs(np.fft.rfft(sound * np.hanning(len(sound)))) ** 2
    frequency_hz = np.fft.rfftfreq(len(sound), 1 / rate_hz)
    audible = (frequency_hz > 150) & (frequency_hz < 6100)
    assert power[audible].sum() / power.sum() > 0.999
    with pytest.raises(ArgumentError):
        demo_sound(seconds=0)
