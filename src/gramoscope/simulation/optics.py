"""From surface to picture: both focal planes, the mixed zone along the glass edge, the darkening towards the corners.

Where the cone of rays of a picture point passes the edge of the cover glass, one part of it goes through the glass and one
beside it: the pixel shows the sum of two pictures, focused at two depths, with weights that change smoothly across the
zone. That each part of the cone blurs with only a part of the disc is not considered.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.disc.texture import Field
from gramoscope.simulation.blur_grids import COARSE, LARGEST_PX, PER_ROW
from gramoscope.simulation.disc_blur import blur
from gramoscope.simulation.scene import Scene
from gramoscope.simulation.surface import Strip

DIRT_STREAM = 0xD127


def glass_share(rows: npt.ArrayLike, *, scene: Scene) -> FloatArray:
    """Return the share of the light that comes through the glass, 0 … 1, at canonical rows; 0 without a glass."""
    rows = np.asarray(rows, np.float64)
    glass = scene.bench.cover_glass
    if glass is None:
        return np.zeros_like(rows)
    into_glass_m = (scene.bench.glass_edge_row - rows) * scene.bench.sensor.pixel_pitch_m
    part = np.clip((into_glass_m / scene.mixed_zone_m + 1) / 2, 0, 1)
    share = part * part * (3 - 2 * part)
    return np.asarray(share if glass.side == "low" else 1 - share, np.float64)


def picture_of(scene: Scene, strip: Strip, *, focus_error_m: float) -> Field:
    """Return the blurred picture of a strip that has `LARGEST_PX` of margin all round.

    Parameters
    ----------
    focus_error_m : float
        How much too high both focal planes lie.

    Returns
    -------
    float32 array, shape (picture row, strip column − 2 `LARGEST_PX`)
        Brightness, 1 for clean land.
    """
    share = glass_share(np.arange(scene.bench.sensor.height_px), scene=scene).astype(np.float32)
    picture = np.zeros((len(share), strip.height_m.shape[1] - 2 * LARGEST_PX), np.float32)
    through, beside = scene.bench.focus_through_glass_m, scene.bench.focus_below_land_m
    for weight, depth_m in ((share, through), (1 - share, beside)):
        rows = _seen(weight)
        if rows.stop > rows.start:
            plane = _focused(scene, strip, rows, focus_error_m - depth_m)
            picture[rows] += weight[rows, None] * plane[: rows.stop - rows.start]
    return picture


def _seen(weight: Field) -> slice:
    """Return the rows that need a picture: all between the first and the last with a weight."""
    rows = np.flatnonzero(weight > 0)
    return slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) else slice(0, 0)


def _focused(scene: Scene, strip: Strip, rows: slice, sharp_height_m: float) -> Field:
    """Return the picture rows asked for (and up to 3 more) as one focal plane shows them."""
    count = -(-(rows.stop - rows.start) // COARSE) * COARSE
    height_m, light = _rows(strip.height_m, rows.start, count), _rows(strip.light, rows.start, count)
    pitch_m = scene.bench.sensor.pixel_pitch_m
    tangent = np.float32(scene.bench.objective.blur_radius_per_defocus)
    radius_px = (height_m - np.float32(sharp_height_m)) * (tangent / np.float32(pitch_m))
    slope_tan = np.gradient(radius_px, np.float32(1 / PER_ROW), axis=0)
    return blur(light, radius_px, slope_tan, floor_px=scene.floor_px, margin_px=LARGEST_PX)


def _rows(surface: Field, first: int, count: int) -> Field:
    """Return the sources of picture rows and their margins; beyond the surface the last row is repeated."""
    rows = np.arange(PER_ROW * first, PER_ROW * (first + count + 2 * LARGEST_PX))
    return surface[np.minimum(rows, len(surface) - 1)]


def field_of(scene: Scene) -> Field:
    """Return what the optics do to every frame alike, shape (row, column): exposure, vignetting, dirt."""
    sensor, lamps = scene.bench.sensor, scene.illumination
    field = lamps.field(height_px=sensor.height_px, width_px=sensor.width_px) * lamps.exposure
    rng = np.random.default_rng([scene.seed, DIRT_STREAM])
    for _ in range(scene.rig.dirt):
        _soil(field, rng)
    return field.astype(np.float32)


def _soil(field: FloatArray, rng: np.random.Generator) -> None:
    """Put one speck on a field that the caller owns: a soft shadow with a firm core."""
    height, width = field.shape
    row, column = rng.uniform(0, height), rng.uniform(0, width)
    radius, depth = rng.uniform(3, 12), rng.uniform(0.1, 0.5)
    y, x = np.ogrid[:height, :width]
    field *= 1 - depth * np.exp(-((((y - row) ** 2 + (x - column) ** 2) / radius**2) ** 1.5))
