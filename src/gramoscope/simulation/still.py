"""A photograph of grooves: the simulator's record with everything in focus, a whole turn side by side with the next ones.

Column x of the picture is an angle, 2π x / `turn_px`, and row y a radius, as in an unrolled scan of a disc. The groove is a
spiral: its turn k runs at the place l = `first_m` + (k + x / `turn_px`) `groove_pitch_m`, and winds about that by what was
cut. Land and both walls are of different brightness; the picture of a step is the normal distribution's integral about the
edge, so that edges lie where they should to any fraction of a pixel. Grain, dust (`gramoscope.disc.damage`) and the camera's
noise come on top. What lies beyond a turn is shown once more, with noise of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.special import ndtr

from gramoscope.apparatus.manifest import MANIFEST_NAME
from gramoscope.apparatus.manifest_still import StillManifest, write_still_manifest
from gramoscope.apparatus.still_bench import Row
from gramoscope.camera.frames_image import write_png
from gramoscope.conventions import FloatArray
from gramoscope.disc.cutting import cut_sound
from gramoscope.disc.damage import Damage, Mark
from gramoscope.disc.formats import Disc
from gramoscope.disc.groove import GrooveProfile
from gramoscope.errors import require
from gramoscope.simulation.passage import Passage
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.wow import Wow

Picture = npt.NDArray[np.uint8]
GRAIN_STREAM, NOISE_STREAM = 0x57111, 0x57112
GRAIN_PX = 0.8
GRAIN_BLOCK_PX, GRAIN_MARGIN_PX = 512, 8


@dataclass(frozen=True)
class StillScene:
    """A spiral of grooves, and the light in which it was photographed.

    Parameters
    ----------
    disc : Disc
    turns : int
        With sound; the groove goes on after it.
    turn_px : int
        Columns in a turn.
    overlap_px : int
        Columns that are shown once more.
    pixel_pitch_m : float
    rpm : float
    groove_pitch_m : float
        From one turn to the next.
    level_m_s : float
        Velocity of the groove, rms.
    land, outer_wall, inner_wall, bottom : float
        Brightness, 0 … 1 of full scale.
    blur_px : float
        Standard deviation of the picture of a point.
    grain : float
        Contrast of the surface, standard deviation.
    noise : float
        Of the camera, standard deviation in grey levels of 255.
    dust_per_m : float
        Specks on a metre of groove.
    seed : int
    """

    disc: Disc = field(default_factory=lambda: Disc(groove_width_m=140e-6))
    turns: int = 12
    turn_px: int = 8192
    overlap_px: int = 256
    pixel_pitch_m: float = 4e-6
    rpm: float = 78.0
    groove_pitch_m: float = 260e-6
    level_m_s: float = 0.03
    land: float = 0.62
    outer_wall: float = 0.25
    inner_wall: float = 0.25
    bottom: float = 0.25
    blur_px: float = 0.9
    grain: float = 0.01
    noise: float = 1.0
    dust_per_m: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        require(self.turns >= 1, f"{self.turns} turns", "at least one")
        require(0 <= self.overlap_px <= self.turn_px, f"{self.overlap_px} columns shown twice", "0 … a turn")
        require(self.blur_px > 0, f"a blur of {self.blur_px} pixels", "above 0")

    @property
    def rotation(self) -> Rotation:
        """Of the circle that places count along."""
        return Rotation(self.rpm, self.turn_px * self.pixel_pitch_m / (2 * np.pi))

    @property
    def first_m(self) -> float:
        """Place l of the middle of the first turn where it starts; row 0 is l = 0."""
        return self.groove_pitch_m

    @property
    def rows(self) -> int:
        """Of the picture."""
        return int(np.ceil((self.turns + 1.75) * self.groove_pitch_m / self.pixel_pitch_m))

    @property
    def columns(self) -> int:
        """Of the picture."""
        return self.turn_px + self.overlap_px

    @property
    def seconds(self) -> float:
        """How long the turns with sound last."""
        return self.turns * 60 / self.rpm


def cut_still(sound: FloatArray, *, rate_hz: float, scene: StillScene) -> Passage:
    """Cut a sound into the record of a scene; see `disc.cutting.cut_sound`."""
    cutting = cut_sound(sound, rate_hz=rate_hz, level_m_s=scene.level_m_s, cut=scene.disc.cut)
    return Passage(cutting, scene.rotation, Wow())


def still_picture(scene: StillScene, passage: Passage, start: int = 0, stop: int | None = None) -> Picture:
    """Return the photograph, or some of its columns.

    Parameters
    ----------
    scene : StillScene
    passage : Passage
        From `cut_still`.
    start, stop : int
        Columns; to the end when `stop` is None.

    Returns
    -------
    uint8 array, shape (row, column)
        Canonical and grey.
    """
    stop = scene.columns if stop is None else stop
    angle_px = np.arange(start, stop) % scene.turn_px
    light = np.full((scene.rows, stop - start), scene.land)
    for turn in range(scene.turns + 1):
        _draw_turn(light, scene, passage, turn, angle_px)
    light *= 1 + scene.grain * _grain(scene, start, stop)
    for mark in _dust(scene):
        _lay(light, mark, scene, angle_px)
    noise = np.random.default_rng([scene.seed, NOISE_STREAM, start]).standard_normal(light.shape)
    return np.clip(np.rint(255 * light + scene.noise * noise), 0, 255).astype(np.uint8)


def edges_of_turn(
    scene: StillScene, passage: Passage, turn: int, angle_px: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the rows of the outer and the inner edge of a turn, in pixels: the truth that is drawn.

    Parameters
    ----------
    scene : StillScene
    passage : Passage
    turn : int
        From 0.
    angle_px : array_like
        Columns within a turn.
    """
    place = np.asarray(angle_px, np.float64) + turn * scene.turn_px
    aside, lift = passage.displacement_m(place * scene.pixel_pitch_m)
    profile = GrooveProfile.of_disc(scene.disc)
    middle = scene.first_m + place / scene.turn_px * scene.groove_pitch_m + aside
    half = profile.width_m / 2
    outer = middle - half + lift / np.tan(profile.outer_angle_rad)
    inner = middle + half - lift / np.tan(profile.inner_angle_rad)
    return outer / scene.pixel_pitch_m, inner / scene.pixel_pitch_m


def _draw_turn(
    light: FloatArray, scene: StillScene, passage: Passage, turn: int, angle_px: npt.NDArray[np.int64]
) -> None:
    outer, inner = edges_of_turn(scene, passage, turn, angle_px)
    middle = (outer + inner) / 2
    reach = int(np.ceil((inner - outer).max() / 2 + 6 * scene.blur_px))
    rows = np.rint(middle).astype(np.int64) + np.arange(-reach, reach + 1)[:, None]
    steps = [ndtr((rows - place) / scene.blur_px) for place in (outer, middle, inner)]
    drawn = (scene.outer_wall - scene.land) * (steps[0] - steps[1]) + (scene.inner_wall - scene.land) * (
        steps[1] - steps[2]
    )
    breadth = np.hypot(scene.blur_px, GrooveProfile.of_disc(scene.disc).bottom_radius_m / 2 / scene.pixel_pitch_m)
    wall = (scene.outer_wall + scene.inner_wall) / 2
    drawn += (scene.bottom - wall) * np.exp(-(((rows - middle) / breadth) ** 2) / 2)
    inside = (rows >= 0) & (rows < scene.rows)
    columns = np.broadcast_to(np.arange(rows.shape[1]), rows.shape)
    light[rows[inside], columns[inside]] += drawn[inside]


def _grain(scene: StillScene, start: int, stop: int) -> FloatArray:
    """The surface's own brightness, fixed to the record; it closes upon itself after a turn."""
    first = start - GRAIN_MARGIN_PX
    columns = np.arange(first, stop + GRAIN_MARGIN_PX) % scene.turn_px
    white = np.empty((scene.rows, columns.size))
    for block in np.unique(columns // GRAIN_BLOCK_PX):
        rng = np.random.default_rng([scene.seed, GRAIN_STREAM, int(block)])
        here = np.flatnonzero(columns // GRAIN_BLOCK_PX == block)
        white[:, here] = rng.standard_normal((GRAIN_BLOCK_PX, scene.rows)).T[:, columns[here] - block * GRAIN_BLOCK_PX]
    point = np.zeros(2 * GRAIN_MARGIN_PX + 1)
    point[GRAIN_MARGIN_PX] = 1.0
    spread = float((gaussian_filter(point, GRAIN_PX) ** 2).sum())
    grain = gaussian_filter(white, GRAIN_PX, mode="nearest") / spread
    return np.asarray(grain[:, GRAIN_MARGIN_PX : white.shape[1] - GRAIN_MARGIN_PX], np.float64)


def _dust(scene: StillScene) -> Iterator[Mark]:
    damage = Damage(dust_per_m=scene.dust_per_m)
    length_m = scene.turn_px * scene.pixel_pitch_m
    for turn in range(scene.turns + 1):
        yield from damage.marks(
            0.0,
            length_m,
            groove_width_m=scene.disc.groove_width_m,
            groove_middle_m=scene.first_m + (turn + 0.5) * scene.groove_pitch_m,
            seed=scene.seed * 1000 + turn,
        )


def _lay(light: FloatArray, mark: Mark, scene: StillScene, angle_px: npt.NDArray[np.int64]) -> None:
    pitch_m = scene.pixel_pitch_m
    columns = np.flatnonzero(np.abs(angle_px * pitch_m - mark.centre_m[0]) <= mark.reach_m[0])
    rows = np.arange(scene.rows)
    rows = rows[np.abs(rows * pitch_m - mark.centre_m[1]) <= mark.reach_m[1]]
    if columns.size == 0 or rows.size == 0:
        return
    albedo = np.ones((rows.size, columns.size), np.float32)
    arc_m, lateral_m = (np.asarray(places * pitch_m, np.float64) for places in (angle_px[columns], rows))
    mark.spoil(np.zeros_like(albedo), albedo, arc_m[None, :], lateral_m[:, None])
    light[np.ix_(rows, columns)] *= albedo


def write_still(folder: Path, scene: StillScene, passage: Passage, *, pictures: int = 1, shared_px: int = 64) -> None:
    """Write the photograph as a capture, in one picture or in a row of overlapping ones.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    scene : StillScene
    passage : Passage
    pictures : int
    shared_px : int
        Columns that neighbouring pictures share.
    """
    folder.mkdir(parents=True, exist_ok=True)
    step = -(-(scene.columns - shared_px) // pictures) if pictures > 1 else scene.columns
    names = []
    for number in range(pictures):
        stop = min(number * step + step + (shared_px if pictures > 1 else 0), scene.columns)
        names.append(f"p{number:04d}.png")
        write_png(folder / names[-1], still_picture(scene, passage, number * step, stop))
    manifest = StillManifest(
        pictures=tuple(names),
        disc=scene.disc,
        wall_angle_known=True,
        pixel_pitch_m=scene.pixel_pitch_m,
        rpm=scene.rpm,
        groove_along="columns",
        across="inward",
        row=Row(pictures, float(step) if pictures > 1 else 0.0, float(scene.turn_px)),
    )
    write_still_manifest(folder / MANIFEST_NAME, manifest)


def still_truth_m_s(scene: StillScene, passage: Passage, *, rate_hz: float) -> FloatArray:
    """Return lateral and vertical velocity of the groove in the turns with sound, shape (2, sample); sample 0 is s = 0."""
    time_s = np.arange(int(scene.seconds * rate_hz)) / rate_hz
    return passage.velocity_m_s(scene.rotation.arc_of_time_m(time_s))


def disc_picture(
    scene: StillScene,
    passage: Passage,
    *,
    centre_px: tuple[float, float],
    size_px: tuple[int, int],
    squeeze: float = 1.0,
) -> Picture:
    """Return a photograph of the whole disc, as one looks down on it: the still rolled up again.

    Parameters
    ----------
    scene : StillScene
        Its row 0 lies at the radius of `rotation`.
    passage : Passage
    centre_px : (float, float)
        Row and column of the centre.
    size_px : (int, int)
        Rows and columns of the picture.
    squeeze : float
        Height of a pixel over its width.
    """
    flat = still_picture(replace(scene, noise=0.0, overlap_px=16), passage)
    rows, columns = np.indices(size_px, np.float64)
    up, right = squeeze * (centre_px[0] - rows), columns - centre_px[1]
    angle_px = np.arctan2(up, right) / (2 * np.pi) % 1 * scene.turn_px
    row = scene.turn_px / (2 * np.pi) - np.hypot(up, right)
    light = map_coordinates(
        flat, np.stack([row, angle_px]), order=3, mode="constant", cval=255 * scene.land, output=np.float64
    )
    noise = np.random.default_rng([scene.seed, NOISE_STREAM]).standard_normal(light.shape)
    return np.clip(np.rint(light + scene.noise * noise), 0, 255).astype(np.uint8)
