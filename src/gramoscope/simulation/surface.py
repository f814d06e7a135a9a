"""The surface under the microscope: height and brightness of every point of one strip of record.

A strip lies on the raster of the record itself, columns at whole pixel pitches from s = 0, so that the same place of the
record has the same texture whenever it is filmed. Across the groove there are `PER_ROW` rows of surface for each row of
pixels, evenly spread over it: walls are steep, and a row shows more of them than a column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import FloatArray, lateral_of_row_m
from gramoscope.disc.damage import spoil_surface
from gramoscope.disc.groove import section
from gramoscope.disc.texture import ACROSS, PHASES, TAPS, Field, texel_weights
from gramoscope.simulation.blur_grids import PER_ROW
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.scene import Scene

TEXEL_WEIGHTS = texel_weights()


@dataclass(frozen=True, eq=False)
class Strip:
    """A strip of surface.

    Attributes
    ----------
    first_column : int
        Place of column 0, in pixel pitches from s = 0.
    arc_m, lateral_m : float64 arrays, shape (column,) and (row,)
    height_m, light : float32 arrays, shape (row, column)
        Height of the surface above the undisturbed land, and its brightness, 1 on clean land.
    """

    first_column: int
    arc_m: FloatArray
    lateral_m: FloatArray
    height_m: Field
    light: Field


def surface_strip(
    scene: Scene, passage: Passage, *, first_column: int, columns: int, margin_px: int, stage_m: float
) -> Strip:
    """Return the surface of a stretch.

    Parameters
    ----------
    first_column, columns : int
        The stretch, in pixel pitches from s = 0.
    margin_px : int
        Rows of pixels beyond the picture on either side.
    stage_m : float
        Radial position of the microscope.
    """
    sensor = scene.bench.sensor
    arc_m = np.arange(first_column, first_column + columns, dtype=np.float64) * sensor.pixel_pitch_m
    rows = (np.arange(PER_ROW * (sensor.height_px + 2 * margin_px)) + 0.5) / PER_ROW - 0.5 - margin_px
    lateral_m = lateral_of_row_m(rows, height_px=sensor.height_px, pixel_pitch_m=sensor.pixel_pitch_m, stage_m=stage_m)
    height_m, light = _clean_surface(scene, passage, first_column, arc_m, lateral_m)
    marks = scene.damage.marks(
        arc_m[0],
        arc_m[-1],
        groove_width_m=scene.bench.disc.groove_width_m,
        groove_middle_m=scene.groove_middle_m,
        seed=scene.seed,
    )
    spoil_surface(height_m, light, marks, arc_m=arc_m, lateral_m=lateral_m)
    height_m += scene.rig.surface_height_m(arc_m).astype(np.float32)
    return Strip(first_column, arc_m, lateral_m, height_m, light)


def _clean_surface(
    scene: Scene, passage: Passage, first_column: int, arc_m: FloatArray, lateral_m: FloatArray
) -> tuple[Field, Field]:
    pitch_m = scene.bench.sensor.pixel_pitch_m
    texture = scene.texture.field(first_column, len(arc_m), pitch_m=pitch_m, seed=scene.seed)
    motion = np.concatenate([passage.displacement_m(arc_m), passage.slope(arc_m)])
    height_m = np.empty((len(lateral_m), len(arc_m)), np.float32)
    light = np.empty_like(height_m)
    across_m = lateral_m - scene.groove_middle_m
    _paint(across_m, motion, scene.groove.shape, scene.illumination.lamps, texture, pitch_m, height_m, light)
    return height_m, light


@numba.njit(cache=True, nogil=True)
def _paint(
    across_m: FloatArray,
    motion: FloatArray,
    shape: FloatArray,
    lamps: FloatArray,
    texture: Field,
    pitch_m: float,
    height_m: Field,
    light: Field,
) -> None:
    for row in range(len(across_m)):
        _paint_row(across_m[row], motion, shape, lamps, texture, pitch_m, height_m[row], light[row])


@numba.njit(cache=True, nogil=True)
def _paint_row(
    across_m: float,
    motion: FloatArray,
    shape: FloatArray,
    lamps: FloatArray,
    texture: Field,
    pitch_m: float,
    height_m: Field,
    light: Field,
) -> None:
    """Paint one row of surface; `motion` has lateral and vertical displacement, then their slopes."""
    for column in range(len(height_m)):
        z, slope_l, along = section(across_m - motion[0, column], shape)
        z += motion[1, column]
        # a wall is carried along by the cut; the land stays
        slope_s = motion[3, column] - slope_l * motion[2, column]
        if z > 0:
            z, slope_l, slope_s, along = 0.0, 0.0, 0.0, across_m + pitch_m * ACROSS / 2
        height_m[column] = z
        light[column] = _shade(z, slope_s, slope_l, lamps) * _albedo(texture, along / pitch_m, column)


@numba.njit(cache=True, nogil=True)
def _shade(z: float, slope_s: float, slope_l: float, lamps: FloatArray) -> float:
    """Return the brightness of a tilted surface; `Illumination.brightness` in scalar form."""
    upright = 1 / np.sqrt(1 + slope_s * slope_s + slope_l * slope_l)
    facing = max(0.0, upright * (1 - slope_s * lamps[3] - slope_l * lamps[4]))
    return float((lamps[0] + lamps[1] * upright + lamps[2] * facing) * max(0.0, 1 + lamps[6] * z))


@numba.njit(cache=True, nogil=True)
def _albedo(texture: Field, place: float, column: int) -> float:
    """Look the texture up at an arc length in texels; the sum that `sample_across` writes for whole arrays."""
    phase = int(np.floor(place * PHASES + 0.5))
    first = phase // PHASES + ACROSS // 2 - (TAPS // 2 - 1)
    weights = TEXEL_WEIGHTS[phase % PHASES]
    total = np.float32(0)
    for tap in range(TAPS):
        total += weights[tap] * texture[(first + tap) % ACROSS, column]
    return float(total)
