"""From scene to frames: one group of the film.

Within a group the record only slides along the groove, so its noise-free picture is rendered once, as a strip a little
longer than a frame, and every frame is a window of it. A frame lies at any fraction of a pixel: between columns the strip
is interpolated by a Kaiser-windowed sinc of eight taps. Then come the camera's field, the light of the moment and the noise.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.cutting import cut_sound
from gramoscope.disc.texture import Field
from gramoscope.signal_path import ImageArray
from gramoscope.simulation.blur_grids import COARSE, LARGEST_PX
from gramoscope.simulation.optics import field_of, picture_of
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.rig import FilmedGroup
from gramoscope.simulation.scene import Scene
from gramoscope.simulation.surface import surface_strip

TAPS = 8
NOISE_STREAM = 0x9015E


def cut_passage(sound: FloatArray, *, rate_hz: float, scene: Scene) -> Passage:
    """Cut a sound into the record of a scene; see `disc.cutting.cut_sound`."""
    bench = scene.bench
    cutting = cut_sound(sound, rate_hz=rate_hz, level_m_s=scene.level_m_s, cut=bench.disc.cut)
    return Passage(cutting, bench.rotation, scene.rig.wow)


def filmed_group(scene: Scene, number: int) -> FilmedGroup:
    """Return what happened while a group of the scene was filmed."""
    return scene.rig.filmed(number, sequence=scene.bench.sequence, seed=scene.seed)


def render_group(scene: Scene, passage: Passage, number: int) -> ImageArray:
    """Return the film of one group.

    Parameters
    ----------
    scene : Scene
    passage : Passage
        What is cut into the record; from `cut_passage`.
    number : int
        Of the group, from 0.

    Returns
    -------
    uint8 or uint16 array, shape (frame, row, column)
        Canonical grey pictures.
    """
    filmed = filmed_group(scene, number)
    picture, first_column = noise_free_strip(scene, passage, filmed)
    field = field_of(scene)
    start_px = filmed.arc_start_m / scene.bench.sensor.pixel_pitch_m - first_column
    seeds = np.random.SeedSequence([scene.seed, NOISE_STREAM, number]).generate_state(len(start_px), np.uint64)
    sensor = scene.bench.sensor
    images = np.empty((len(start_px), sensor.height_px, sensor.width_px), sensor.dtype)
    for image, start, light, seed in zip(images, start_px, filmed.light, seeds, strict=True):
        image[:] = _frame(scene, picture, field * np.float32(light), start, int(seed))
    return images


def noise_free_strip(scene: Scene, passage: Passage, filmed: FilmedGroup) -> tuple[Field, int]:
    """Return the picture of the whole stretch that a group sees, and the place of its column 0 in pitches from s = 0."""
    sensor = scene.bench.sensor
    start_px = filmed.arc_start_m / sensor.pixel_pitch_m
    # on the raster of blocks, so that the same place is blurred alike whichever group shows it
    first = (int(np.floor(start_px.min())) - TAPS // 2) // COARSE * COARSE
    wanted = int(np.ceil(start_px.max())) + sensor.width_px + TAPS // 2 + 1 - first
    columns = -(-wanted // COARSE) * COARSE
    strip = surface_strip(
        scene,
        passage,
        first_column=first - LARGEST_PX,
        columns=columns + 2 * LARGEST_PX,
        margin_px=LARGEST_PX,
        stage_m=filmed.stage_m,
    )
    return picture_of(scene, strip, focus_error_m=filmed.focus_error_m), first


def _frame(scene: Scene, picture: Field, field: Field, start_px: float, seed: int) -> ImageArray:
    whole = int(np.floor(start_px))
    light = np.empty_like(field)
    _slide(picture[:, whole - TAPS // 2 + 1 :], _sinc_taps(start_px - whole), field, light)
    return scene.noise.expose(light, white_level=scene.bench.sensor.white_level, seed=seed)


def _sinc_taps(fraction: float) -> Field:
    """Return the weights of eight columns for a place between the fourth and the fifth."""
    away = np.arange(TAPS) - (TAPS // 2 - 1) - fraction
    window = np.i0(5.0 * np.sqrt(np.maximum(0, 1 - (away / (TAPS / 2)) ** 2)))
    taps = np.sinc(away) * window
    return np.asarray(taps / taps.sum(), np.float32)


@numba.njit(cache=True, nogil=True)
def _slide(picture: Field, taps: Field, field: Field, light: Field) -> None:
    for row in range(light.shape[0]):
        _slide_row(picture[row], taps, field[row], light[row])


@numba.njit(cache=True, nogil=True, fastmath=True)
def _slide_row(picture: Field, taps: Field, field: Field, light: Field) -> None:
    for column in range(len(light)):
        total = np.float32(0)
        for tap in range(TAPS):
            total += taps[tap] * picture[column + tap]
        light[column] = total * field[column]
