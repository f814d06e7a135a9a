"""Straightening: a picture of a whole disc becomes a capture of photographs, its grooves side by side from left to right.

Columns become angle, in the direction in which a stylus travels, and rows radius, inwards. As many columns make a turn as
there are pixels round the outermost groove, so that nothing is lost; farther in there are more of them than the picture had.
Angle is what a column stands for: time is right in every turn, and so is velocity, since rows keep their scale. The picture
is resampled wedge by wedge by cubic splines, each wedge from the rectangle that holds it.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from scipy.ndimage import map_coordinates

from gramoscope.apparatus.manifest import MANIFEST_NAME
from gramoscope.apparatus.manifest_still import StillManifest, write_still_manifest
from gramoscope.apparatus.still import read_photograph
from gramoscope.apparatus.still_bench import Row
from gramoscope.camera.frames import Lost
from gramoscope.camera.frames_image import write_png
from gramoscope.camera.grey import grey_of_colour
from gramoscope.disc.formats import Disc
from gramoscope.errors import CaptureError, OutputError, require
from gramoscope.signal_path import ImageArray
from gramoscope.turntable.disc_centre import DiscCentre, groove_band, refined_centre, rough_centre

STRIP_PX, SHARED_PX = 2048, 128
"""Columns of a picture that are its own, and those that it shares with the next."""
AGAIN_PX = 256
"""Columns beyond the turn that show its start once more."""
MARGIN_PX = 8


@dataclass(frozen=True)
class DiscScan:
    """A picture of a whole disc, and what is known of where its grooves are.

    Attributes
    ----------
    image : uint8 or uint16 array, shape (row, column)
    centre : DiscCentre
    inner_px, outer_px : float
        Radii between which it is unrolled.
    """

    image: ImageArray
    centre: DiscCentre
    inner_px: float
    outer_px: float

    @property
    def turn_px(self) -> int:
        """Columns in a turn."""
        return round(2 * np.pi * self.outer_px)

    def strip(self, start: int, stop: int) -> ImageArray:
        """Return some columns of the unrolled picture.

        Parameters
        ----------
        start, stop : int
            Columns; a turn is `turn_px` of them.

        Returns
        -------
        array, shape (row, column), of the type of the picture
        """
        angle = 2 * np.pi * np.arange(start, stop) / self.turn_px
        radius = np.arange(self.outer_px, self.inner_px, -1.0)[:, None]
        row, column = self.centre.places(angle, radius)
        top, left = (max(int(np.floor(places.min())) - MARGIN_PX, 0) for places in (row, column))
        bottom, right = (int(np.ceil(places.max())) + MARGIN_PX + 1 for places in (row, column))
        wedge = self.image[top:bottom, left:right].astype(np.float32)
        light = map_coordinates(wedge, np.stack([row - top, column - left]), order=3, mode="nearest")
        full = np.iinfo(self.image.dtype).max
        return cast(ImageArray, np.clip(np.rint(light), 0, full).astype(self.image.dtype))


def disc_scan(
    path: Path,
    *,
    centre_px: tuple[float, float] | None = None,
    inner_px: float | None = None,
    outer_px: float | None = None,
    turns: int | None = None,
) -> DiscScan:
    """Find centre and grooves of a disc in a picture.

    Parameters
    ----------
    path : Path
        PNG, TIFF, JPEG or BMP, as one looks down on the record.
    centre_px : (float, float), optional
        Column and row; found in the picture when None.
    inner_px, outer_px : float, optional
        Radii; found in the picture when None.
    turns : int, optional
        Only so many, from the outermost inwards.

    Raises
    ------
    CaptureError
        If there is no such picture, or it cannot be read.
    ArgumentError
        If no disc is to be seen in it.
    """
    stored = read_photograph(path, folder=path.parent)
    if isinstance(stored, Lost):
        raise CaptureError(stored.why, "a picture of a disc", "check the path")
    image: ImageArray = grey_of_colour(stored) if stored.ndim == 3 else stored
    start = (centre_px[1], centre_px[0]) if centre_px is not None else rough_centre(image)
    inside = all(0 < place < size - 1 for place, size in zip(start, image.shape, strict=True))
    require(inside, f"a centre at column {start[1]:.1f}, row {start[0]:.1f}", "one inside the picture", "--centre-px")
    found = groove_band(image, DiscCentre(*start))
    inner, outer = (given or seen for given, seen in zip((inner_px, outer_px), found, strict=True))
    reach = min(start[0], start[1], image.shape[0] - 1 - start[0], image.shape[1] - 1 - start[1])
    require(
        outer <= reach, f"grooves out to {outer:g} pixels", f"at most {reach:g}, as far as the picture goes all round"
    )
    centre = refined_centre(image, start, inner_px=inner, outer_px=outer)
    if turns is not None:
        require(turns >= 1, f"{turns} turns", "at least one")
        require(centre.pitch_px > 0, "a disc whose pitch could not be measured", "rings that run inwards", "--inner-px")
        inner = max(inner, outer - (turns + 1.5) * centre.pitch_px)
    return DiscScan(image, centre, inner, outer)


def unroll(
    scan: DiscScan,
    folder: Path,
    *,
    disc: Disc | None = None,
    pixel_pitch_m: float | None = None,
    rpm: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> StillManifest:
    """Write a disc as a capture of photographs, whole or not at all.

    Parameters
    ----------
    scan : DiscScan
    folder : Path
        Does not exist, or is empty.
    disc : Disc, optional
    pixel_pitch_m, rpm : float, optional
        As far as they are known.
    progress : callable, optional
        Told how many pictures are done, and of how many.

    Raises
    ------
    OutputError
        If there is something in the folder, or it cannot be written.
    """
    columns = scan.turn_px + AGAIN_PX
    count = max(1, -(-(columns - SHARED_PX) // STRIP_PX))
    names = tuple(f"pictures/p{number:05d}.png" for number in range(count))
    manifest = StillManifest(
        pictures=names,
        disc=disc or Disc(),
        pixel_pitch_m=pixel_pitch_m,
        rpm=rpm,
        groove_along="columns",
        across="inward",
        row=Row(count, float(STRIP_PX) if count > 1 else 0.0, float(scan.turn_px)),
    )
    with _whole_folder(folder) as part:
        (part / "pictures").mkdir()
        for number, name in enumerate(names):
            stop = min(number * STRIP_PX + STRIP_PX + SHARED_PX, columns)
            write_png(part / name, scan.strip(number * STRIP_PX, stop))
            if progress is not None:
                progress(number + 1, count)
        write_still_manifest(part / MANIFEST_NAME, manifest)
    return manifest


@contextmanager
def _whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder to write into that gets its name when all is well, and vanishes when it is not."""
    folder = folder.resolve()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(f"{folder} exists", "a new or an empty folder", "choose another --out")
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True)
        yield part
        if folder.exists():
            folder.rmdir()
        part.rename(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}", "a disk with room") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
