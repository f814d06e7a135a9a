"""What must not change the reading: how a film is stored, how bright it is, where the groove lies, who else is reading."""

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.seed_paper import SeedPaperPickup
from gramoscope.signal_path import FrameGroup, WallTrace
from gramoscope.simulation.render import cut_passage, filmed_group, render_group
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene, filming_bench
from gramoscope.tonearm.splice import Splice

GROUP = 1


@pytest.fixture(scope="module")
def scene() -> Scene:
    bench = filming_bench(height_px=448)
    sequence = Sequence(groups=2, frames_per_group=3, frame_step_m=0.83e-6, group_step_m=2.1e-3)
    bench = replace(bench, sequence=sequence, sensor=replace(bench.sensor, width_px=900))
    return Scene(bench, rig=Rig(frame_step_share=0.05), seed=9)


@pytest.fixture(scope="module")
def group(scene: Scene) -> FrameGroup:
    time_s = np.arange(4800) / 48_000
    sound = np.sin(2 * np.pi * 1310 * time_s + 0.3) + 0.5 * np.sin(2 * np.pi * 2770 * time_s)
    passage = cut_passage(sound, rate_hz=48_000.0, scene=scene)
    images = render_group(scene, passage, GROUP)
    return _group(images, scene)


def _group(images: np.ndarray, scene: Scene, *, white_level: int = 255) -> FrameGroup:
    filmed = filmed_group(scene, GROUP)
    return FrameGroup(
        number=GROUP,
        images=images,
        arc_start_m=filmed.nominal_start_m,
        stage_m=np.zeros(3),
        pixel_pitch_m=scene.bench.sensor.pixel_pitch_m,
        white_level=white_level,
        valid=np.ones(3, bool),
    )


def _assert_same(one: WallTrace, other: WallTrace) -> None:
    for name in ("offset_m", "offset_sigma_m", "slope", "slope_sigma", "flags", "frame_step_m"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for end in ("head", "tail"):
        assert (getattr(one, end) is None) == (getattr(other, end) is None)


def _assert_near(one: WallTrace, other: WallTrace, *, sigmas: float) -> None:
    """The same where both measured, to a small part of the error bar, and measured at the same places."""
    np.testing.assert_array_equal(one.flags, other.flags)
    good = one.flags[INNER] == 0
    assert good.mean() > 0.8
    difference = (other.slope - one.slope)[INNER, good] / one.slope_sigma[INNER, good]
    assert np.abs(difference).max() < sigmas


@pytest.mark.parametrize("columns", ["forward", "backward"])
@pytest.mark.parametrize("rows", ["inward", "outward"])
def test_a_film_stored_mirrored_is_read_to_the_same_bits(
    tmp_path: Path, scene: Scene, group: FrameGroup, columns: str, rows: str
) -> None:
    sensor = replace(scene.bench.sensor, columns=columns, rows=rows)
    bench = replace(scene.bench, sensor=sensor)
    with CaptureWriter(tmp_path / "mirrored", bench) as writer:
        for number in range(2):
            writer.write_group(number, group.images, arc_start_m=group.arc_start_m)
    stored = tifffile.imread(tmp_path / "mirrored" / "frames" / "g000001.tif")
    down, along = (-1 if rows == "outward" else 1), (-1 if columns == "backward" else 1)
    np.testing.assert_array_equal(stored, group.images[:, ::down, ::along])
    capture = open_capture(tmp_path / "mirrored")
    _assert_same(SeedPaperPickup(capture.bench).read(capture.group(1)), SeedPaperPickup(bench).read(group))


def test_a_groove_seen_from_the_other_side_moves_the_other_way(scene: Scene, group: FrameGroup) -> None:
    bench = scene.bench
    glass = bench.cover_glass
    assert glass is not None
    edge_row = bench.sensor.height_px - 1 - bench.glass_edge_row
    flipped_bench = replace(bench, cover_glass=replace(glass, side="high", edge_row=edge_row))
    flipped = _group(np.ascontiguousarray(group.images[:, ::-1]), scene)
    one, other = SeedPaperPickup(bench).read(group), SeedPaperPickup(flipped_bench).read(flipped)
    np.testing.assert_array_equal(one.flags[INNER], other.flags[OUTER])
    np.testing.assert_allclose(other.slope[OUTER], -one.slope[INNER], atol=0.2 * np.median(one.slope_sigma[INNER]))
    np.testing.assert_allclose(other.offset_m[OUTER], -one.offset_m[INNER], atol=0.3e-6)


@pytest.mark.parametrize(("gain", "offset"), [(170, 0), (100, 900), (170, 4000)])
def test_brightness_and_a_constant_glow_leave_the_slopes_alone(
    scene: Scene, group: FrameGroup, gain: int, offset: int
) -> None:
    bench = replace(scene.bench, sensor=replace(scene.bench.sensor, bits=16))
    pickup = SeedPaperPickup(bench)
    wide = group.images.astype(np.uint16)
    plain = pickup.read(_group(100 * wide, scene, white_level=65_535))
    bright = pickup.read(_group((gain * wide + offset).astype(np.uint16), scene, white_level=65_535))
    _assert_near(plain, bright, sigmas=0.05)


def test_eight_bits_stored_in_sixteen_are_the_same_film(scene: Scene, group: FrameGroup) -> None:
    bench = replace(scene.bench, sensor=replace(scene.bench.sensor, bits=16))
    wide = SeedPaperPickup(bench).read(_group(group.images.astype(np.uint16) * 257, scene, white_level=65_535))
    _assert_near(SeedPaperPickup(scene.bench).read(group), wide, sigmas=0.05)


@pytest.mark.parametrize("rows", [-9, 6])
def test_a_groove_elsewhere_in_the_picture_is_elsewhere_and_has_the_same_slope(
    scene: Scene, group: FrameGroup, rows: int
) -> None:
    pickup = SeedPaperPickup(scene.bench)
    here, there = pickup.read(group), pickup.read(_group(np.roll(group.images, rows, axis=1), scene))
    good = (here.flags[INNER] == 0) & (there.flags[INNER] == 0)
    assert good.mean() > 0.8
    moved_px = (there.offset_m - here.offset_m)[INNER, good] / group.pixel_pitch_m
    np.testing.assert_allclose(moved_px, rows, atol=1.0)
    # cells of the accumulator lie elsewhere, and so do the borders of the regions: single points come or go
    assert np.std((there.slope - here.slope)[INNER, good] / here.slope_sigma[INNER, good]) < 0.3


def test_the_reading_does_not_touch_the_film(scene: Scene, group: FrameGroup) -> None:
    frozen = replace(group, **{name: getattr(group, name).copy() for name in _ARRAYS})
    for name in _ARRAYS:
        getattr(frozen, name).flags.writeable = False
    trace = SeedPaperPickup(scene.bench).read(frozen)
    for name in _ARRAYS:
        np.testing.assert_array_equal(getattr(frozen, name), getattr(group, name))
    _assert_same(trace, SeedPaperPickup(scene.bench).read(group))


_ARRAYS = ("images", "arc_start_m", "stage_m", "valid")


def test_two_threads_that_read_at_once_find_the_same_bits(scene: Scene, group: FrameGroup) -> None:
    pickup = SeedPaperPickup(scene.bench)
    alone = pickup.read(group)
    found: list[WallTrace] = []

    def read_twice() -> None:
        found.extend(pickup.read(group) for _ in range(2))

    threads = [threading.Thread(target=read_twice) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for trace in found:
        _assert_same(trace, alone)


def test_a_stretch_further_along_is_the_same_stretch(scene: Scene, group: FrameGroup) -> None:
    pickup = SeedPaperPickup(scene.bench)
    here, there = pickup.read(group), pickup.read(replace(group, number=7, arc_start_m=group.arc_start_m + 0.0125))
    assert there.arc_start_m == pytest.approx(here.arc_start_m + 0.0125)
    np.testing.assert_array_equal(there.slope, here.slope)
    np.testing.assert_array_equal(there.offset_m, here.offset_m)


def test_splicing_does_not_touch_the_stretches(scene: Scene, group: FrameGroup) -> None:
    bench: Bench = replace(scene.bench, sequence=replace(scene.bench.sequence, group_step_m=300e-6))
    trace = SeedPaperPickup(bench).read(group)
    assert trace.head is not None
    assert trace.tail is not None
    later = replace(trace, arc_start_m=trace.arc_start_m + 300e-6)
    for array in (trace.slope, trace.flags, trace.head.strip, trace.tail.strip):
        array.flags.writeable = False
    joined = [one for one, _ in Splice().join(iter([trace, later]))]
    assert trace.arc_start_m == later.arc_start_m - 300e-6
    assert joined[0].arc_start_m == trace.arc_start_m
    assert joined[1].slope is later.slope
