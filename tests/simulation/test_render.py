"""The pictures show the scene: stripes where the optics put them, moving as the groove moves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gramoscope.conventions import rad
from gramoscope.disc.cutting import Cutting
from gramoscope.disc.damage import HEAVY_DAMAGE
from gramoscope.disc.texture import POLISHED, POWDER, SHELLAC, Texture
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage, filmed_group, noise_free_strip, render_group
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene
from gramoscope.turntable.wow import Wow


class _Still(Cutting):
    """A groove that stands aside and above by constant amounts."""

    def __init__(self, lateral_m: float = 0.0, vertical_m: float = 0.0) -> None:
        object.__setattr__(self, "place", (lateral_m, vertical_m))

    def velocity_at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros_like(time_s), np.zeros_like(time_s)

    def displacement_at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full_like(time_s, self.place[0]), np.full_like(time_s, self.place[1])


def _still(scene: Scene, lateral_m: float = 0.0, vertical_m: float = 0.0) -> Passage:
    return Passage(_Still(lateral_m, vertical_m), scene.bench.rotation, Wow())


def _sharp_rows(scene: Scene, passage: Passage, *, groups: tuple[int, ...] = (0, 1, 2, 3, 4)) -> np.ndarray:
    """Rows of the three sharp stripes, from where the fine contrast has its centre of gravity near each peak."""
    images = np.concatenate([render_group(scene, passage, number) for number in groups], axis=2).astype(float)
    fine = np.diff(images.mean(axis=0), axis=1).var(axis=1)
    found, left = [], fine.copy()
    for _ in range(3):
        peak = int(np.argmax(left))
        window = np.arange(max(peak - 5, 0), peak + 6)
        found.append((window * fine[window] ** 2).sum() / (fine[window] ** 2).sum())
        left[max(peak - 35, 0) : peak + 36] = 0
    return np.sort(found)


def test_stripes_lie_where_the_bench_says(quiet: Scene) -> None:
    np.testing.assert_allclose(_sharp_rows(quiet, _still(quiet)), quiet.bench.stripe_rows(), atol=1.5)


def test_a_lateral_displacement_moves_all_stripes_together(quiet: Scene) -> None:
    moved_px = 12.0
    aside = _still(quiet, lateral_m=moved_px * quiet.bench.sensor.pixel_pitch_m)
    shift = _sharp_rows(quiet, aside) - _sharp_rows(quiet, _still(quiet))
    np.testing.assert_allclose(shift, moved_px, atol=1.0)


def test_a_lift_moves_stripes_of_opposite_walls_apart(quiet: Scene) -> None:
    # walls that rise by h reach a depth h/tan φ farther from the middle … on 45° walls, h nearer to it
    lift_px = 10.0
    lifted = _still(quiet, vertical_m=lift_px * quiet.bench.sensor.pixel_pitch_m)
    shift = _sharp_rows(quiet, lifted) - _sharp_rows(quiet, _still(quiet))
    np.testing.assert_allclose(shift, [lift_px, -lift_px, -lift_px], atol=1.0)


def test_a_steeper_wall_stands_nearer_to_its_edge(quiet: Scene) -> None:
    steep = replace(quiet, rig=Rig(inner_angle_error_rad=rad(3.0)))
    shift = _sharp_rows(steep, _still(steep)) - _sharp_rows(quiet, _still(quiet))
    pitch_m, depths_m = quiet.bench.sensor.pixel_pitch_m, (57.39e-6, 20e-6)
    inner = [depth * (1 - 1 / np.tan(rad(48.0))) / pitch_m for depth in depths_m]
    np.testing.assert_allclose(shift, [0, *inner], atol=1.0)


def test_focus_that_drifts_up_moves_the_stripes_towards_the_edges(quiet: Scene) -> None:
    drifting = replace(quiet, rig=Rig(focus_drift_m=8e-6, focus_drift_groups=2))
    rows = [_sharp_rows(scene, _still(scene), groups=(2,)) for scene in (quiet, drifting)]
    up_px = 8e-6 / quiet.bench.sensor.pixel_pitch_m
    np.testing.assert_allclose(rows[1] - rows[0], [-up_px, up_px, up_px], atol=3)


def test_the_frames_of_a_group_are_one_picture_that_slides(quiet: Scene, sound: np.ndarray) -> None:
    step_px = 2
    sequence = replace(quiet.bench.sequence, frame_step_m=step_px * quiet.bench.sensor.pixel_pitch_m)
    lamps = replace(quiet.illumination, vignetting=0.0)
    scene = replace(quiet, bench=replace(quiet.bench, sequence=sequence), illumination=lamps)
    images = render_group(scene, cut_passage(sound, rate_hz=48_000, scene=scene), 2).astype(int)
    assert np.abs(images[1][:, :-step_px] - images[0][:, step_px:]).max() <= 1


def _flat_picture(scene: Scene, aside_px: float) -> np.ndarray:
    """Grey levels of the noise-free picture of a groove that lies some pixels further across."""
    moved = replace(scene, groove_middle_m=scene.groove_middle_m + aside_px * scene.bench.sensor.pixel_pitch_m)
    strip, first = noise_free_strip(moved, _still(moved), filmed_group(scene, 1))
    return strip[:, -first % 4 :].astype(float) * scene.illumination.exposure * 255


def _shifted(picture: np.ndarray, rows: float) -> np.ndarray:
    """Move a picture across its rows by Fourier's shift theorem, mirrored beyond its ends."""
    padded = np.pad(picture, ((64, 64), (0, 0)), mode="reflect")
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(len(padded)) * rows)
    return np.fft.irfft(np.fft.rfft(padded, axis=0) * turn[:, None], len(padded), axis=0)[64:-64]


def _fine(picture: np.ndarray) -> np.ndarray:
    """What changes from grain to grain along the groove."""
    return gaussian_filter1d(picture, 0.8, axis=1) - gaussian_filter1d(picture, 20, axis=1)


@pytest.mark.parametrize("fraction", [0.25, 0.5])
@pytest.mark.parametrize(("texture", "sharpest"), [(POWDER, 0.55), (SHELLAC, 0.35), (POLISHED, 0.08)])
def test_a_groove_part_of_a_row_further_on_is_the_picture_moved_by_as_much(
    quiet: Scene, texture: Texture, sharpest: float, fraction: float
) -> None:
    # at full contrast, powder leaves half as much again
    scene = replace(quiet, texture=replace(texture, contrast=min(texture.contrast, 0.356)))
    here, there = (_flat_picture(scene, aside) for aside in (0.0, fraction))
    error = _fine(_shifted(here, fraction) - there).std(axis=1)
    away = np.min(np.abs(np.arange(len(here))[:, None] - scene.bench.stripe_rows()), axis=1)
    shown = np.arange(len(here)) % (len(here) - 20) > 20
    assert _fine(here - there).std(axis=1).max() > 10 * error.max()  # what doing nothing would leave
    assert error[shown & (away > 5)].max() < 0.15
    # what is sharp has grains that are too fine for the rows of the camera: that part of the error is true
    assert error[shown].max() < sharpest


def test_overlapping_groups_show_the_same_record(quiet: Scene, sound: np.ndarray) -> None:
    pitch_m = quiet.bench.sensor.pixel_pitch_m
    sequence = replace(quiet.bench.sequence, group_step_m=150 * pitch_m)
    scene = replace(
        quiet,
        bench=replace(quiet.bench, sequence=sequence),
        damage=HEAVY_DAMAGE,
        illumination=replace(quiet.illumination, vignetting=0.0),
    )
    passage = cut_passage(sound, rate_hz=48_000, scene=scene)
    before, after = (render_group(scene, passage, number)[0].astype(int) for number in (3, 4))
    difference = before[:, 150:] - after[:, :58]
    # only the noise of the camera differs: blocks of sources lie on the record's own raster
    assert np.abs(difference).max() <= 1
    assert difference.std() < 0.1
    assert before[:, 150:].std() > 5


def test_a_fraction_of_a_pixel_is_a_fraction_of_a_pixel(quiet: Scene, sound: np.ndarray) -> None:
    bench = replace(quiet.bench, sensor=replace(quiet.bench.sensor, bits=14))
    scene = replace(quiet, bench=bench, illumination=replace(quiet.illumination, vignetting=0.0, exposure=0.15))
    passage = cut_passage(sound, rate_hz=48_000, scene=scene)
    filmed = filmed_group(scene, 1)
    strip, first = noise_free_strip(scene, passage, filmed)
    start_px = filmed.arc_start_m[1] / bench.sensor.pixel_pitch_m - first
    columns = np.arange(70, 130)
    frame = render_group(scene, passage, 1)[1][:, columns] / (2**14 - 1) / 0.15
    assert 0.1 < start_px % 1 < 0.9
    # moved by Fourier's shift theorem under a window that is zero at both ends of the strip
    length = strip.shape[1]
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(length) * (start_px % 1))
    moved = np.fft.irfft(np.fft.rfft(strip * np.hanning(length), axis=1) * turn, length, axis=1)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (columns + start_px) / (length - 1))
    error = frame - moved[:, columns + int(start_px)] / window
    staying = frame - strip[:, columns + int(start_px)]
    assert error.std() < 0.05 * staying.std()


def test_a_group_is_the_same_in_whatever_order_it_is_rendered(small: Scene, sound: np.ndarray) -> None:
    passage = cut_passage(sound, rate_hz=48_000, scene=small)
    late = render_group(small, passage, 3)
    render_group(small, passage, 0)
    np.testing.assert_array_equal(render_group(small, passage, 3), late)
    other = render_group(replace(small, seed=7), passage, 3)
    assert np.corrcoef(other[0][200:300].ravel(), late[0][200:300].ravel())[0, 1] < 0.6


@pytest.mark.parametrize(("texture", "low", "high"), [(POWDER, 22, 45), (SHELLAC, 7, 15), (POLISHED, 1.5, 4)])
def test_textures_have_the_contrast_of_their_kind_in_focus(
    quiet: Scene, texture: object, low: float, high: float
) -> None:
    scene = replace(quiet, texture=texture)
    images = np.concatenate([render_group(scene, _still(scene), number)[0] for number in range(5)], axis=1)
    assert 85 < images.mean() < 105
    assert low < images.astype(float)[:300].std(axis=1).max() < high


def test_a_camera_of_twelve_bits_uses_them(small: Scene, sound: np.ndarray) -> None:
    deep = replace(small, bench=replace(small.bench, sensor=replace(small.bench.sensor, bits=12)))
    passage = cut_passage(sound, rate_hz=48_000, scene=small)
    images, eight = render_group(deep, passage, 0), render_group(small, passage, 0)
    assert images.dtype == np.uint16
    assert images.mean() / 4095 == pytest.approx(eight.mean() / 255, rel=0.01)
