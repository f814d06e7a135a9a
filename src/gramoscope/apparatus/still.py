"""A capture of photographs: a folder with `capture.toml` and pictures, or one picture alone, read one picture at a time.

As with films, what the world did to the pictures never raises: one that cannot be read shows nothing (`seen` is all False),
and says in words what happened. Several threads may read different pictures at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gramoscope.apparatus.groove_direction import groove_direction
from gramoscope.apparatus.manifest import MANIFEST_NAME
from gramoscope.apparatus.manifest_still import StillManifest, read_still_manifest
from gramoscope.apparatus.still_bench import Row, StillBench, scale_of, sense_across
from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Frame, Lost
from gramoscope.camera.frames_image import read_picture
from gramoscope.camera.frames_tiff import read_first_page
from gramoscope.camera.grey import fit_to_bits, grey_of_colour
from gramoscope.camera.pattern import IMAGE_SUFFIXES, TIFF_SUFFIXES, is_inside
from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import mirror
from gramoscope.errors import ArgumentError, CaptureError, ManifestError, NoFramesError, require
from gramoscope.signal_path import ImageArray, StillPicture

UNSURE = 0.1
"""A direction that was found with less coherence is told as doubtful."""


@dataclass(frozen=True, eq=False)
class StillCapture:
    """A capture of photographs that was opened; `open_stills`, `open_picture`.

    Its pictures are numbered as the groups of a film are.

    Attributes
    ----------
    folder : Path
        Where the pictures lie.
    manifest : StillManifest
    bench : StillBench
    name : str
        Of the folder, or of the one picture.
    path : Path
        What was opened: the folder, or the one picture.
    problems : tuple of str
        What is wrong with the capture as a whole, in words.
    """

    folder: Path
    manifest: StillManifest
    bench: StillBench
    name: str
    path: Path
    problems: tuple[str, ...] = field(default=())

    layout = "stills"

    @property
    def group_count(self) -> int:
        """How many pictures there are."""
        return self.bench.row.pictures

    def group(self, number: int) -> StillPicture:
        """Read one picture.

        Parameters
        ----------
        number : int
            0 … `group_count` − 1.

        Returns
        -------
        StillPicture
            Canonical and grey; one that could not be read is black and not `seen`.
        """
        require(0 <= number < self.group_count, f"picture {number}", f"0 … {self.group_count - 1}")
        bench = self.bench
        stored = read_photograph(self.folder / self.manifest.pictures[number], folder=self.folder)
        if isinstance(stored, Lost):
            image = np.zeros((bench.sensor.height_px, bench.sensor.width_px), bench.sensor.dtype)
            problems: tuple[str, ...] = (stored.why,)
            seen = np.zeros(image.shape, np.bool_)
        else:
            image, problems = _canonical(stored, bench)
            seen = np.ones(image.shape, np.bool_)
        return StillPicture(
            number=number,
            image=image,
            arc_start_m=number * bench.row.step_px * bench.sensor.pixel_pitch_m,
            lateral_start_m=0.0,
            pixel_pitch_m=bench.sensor.pixel_pitch_m,
            white_level=bench.sensor.white_level,
            seen=seen,
            problems=problems,
        )

    def files_of_group(self, number: int) -> tuple[Path, ...]:
        """Return the file of one picture."""
        return (self.folder / self.manifest.pictures[number],)

    def common_files(self) -> tuple[Path, ...]:
        """Return the manifest, if there is one."""
        return (self.folder / MANIFEST_NAME,) if self.path == self.folder else ()


def open_stills(folder: str | Path, *, rpm: float | None = None) -> StillCapture:
    """Open a folder of photographs.

    Parameters
    ----------
    folder : path
        Where its `capture.toml` lies.
    rpm : float, optional
        Its speed, where `capture.toml` does not tell.

    Returns
    -------
    StillCapture

    Raises
    ------
    CaptureError
        If there is no such folder.
    ManifestError
        If its manifest is wrong, or a picture lies outside the folder.
    NoFramesError
        If not one picture can be read.
    """
    folder = Path(folder)
    manifest = read_still_manifest(folder)
    manifest = replace(manifest, rpm=rpm) if manifest.rpm is None else manifest
    for name in manifest.pictures:
        if not is_inside(folder / name, folder):
            raise ManifestError(
                f"{folder / name} leads out of the capture's folder, to {(folder / name).resolve()}",
                "pictures inside the folder",
                "copy the files into the capture instead of linking to them",
            )
    try:
        return _opened(folder, manifest, name=folder.resolve().name, path=folder)
    except ArgumentError as error:
        raise ManifestError(f"{folder / MANIFEST_NAME}: {error.found}", error.needed, error.remedy) from None


def open_picture(path: str | Path, known: StillManifest | None = None) -> StillCapture:
    """Open one picture without a manifest.

    Parameters
    ----------
    path : path
        PNG, TIFF, JPEG or BMP.
    known : StillManifest, optional
        What somebody knows of it; its `pictures` do not count.

    Returns
    -------
    StillCapture

    Raises
    ------
    CaptureError
        If there is no such file, or it is no picture.
    NoFramesError
        If it cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise CaptureError(
            f"there is no picture {path}", "a picture file, or the folder of a capture", "check the path"
        )
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise CaptureError(
            f"{path} is neither the folder of a capture nor a picture",
            f"a file that ends in {', '.join(IMAGE_SUFFIXES)}",
        )
    manifest = replace(known or StillManifest(()), pictures=(path.name,))
    return _opened(path.parent, manifest, name=path.stem, path=path)


def is_picture(path: Path) -> bool:
    """Tell whether a path is that of one picture, and not the folder of a capture."""
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.is_dir()


def _opened(folder: Path, manifest: StillManifest, *, name: str, path: Path) -> StillCapture:
    stored = _first_readable(folder, manifest)
    grey = grey_of_colour(stored) if stored.ndim == 3 else stored
    bits = manifest.bits or 8 * grey.dtype.itemsize
    found = groove_direction(grey) if manifest.groove_along is None else None
    axis = manifest.groove_along or (found.groove_along if found is not None else "columns")
    across = manifest.across or sense_across(axis, manifest.along)
    height, width = grey.shape if axis == "columns" else grey.shape[::-1]
    row = Row(len(manifest.pictures), manifest.row.step_px, manifest.row.turn_px)
    pitch_m, rotation, assumed = scale_of(
        pixel_pitch_m=manifest.pixel_pitch_m, rpm=manifest.rpm, radius_m=manifest.radius_m, turn_px=row.turn_px
    )
    sensor = Sensor(width, height, bits, "rgb" if stored.ndim == 3 else "mono", pitch_m, manifest.along, across)
    bench = StillBench(manifest.disc, rotation, sensor, axis, row, assumed, found is not None)
    _require_a_turn(bench)
    unsure = found is not None and found.coherence < UNSURE
    doubts = (
        ("whether the grooves run along rows or columns could hardly be seen: say --groove-along",) if unsure else ()
    )
    return StillCapture(folder, manifest, bench, name, path, doubts)


def _require_a_turn(bench: StillBench) -> None:
    columns = (bench.row.pictures - 1) * bench.row.step_px + bench.sensor.width_px
    turn_px = bench.row.turn_px
    require(
        turn_px is None or turn_px <= columns,
        f"a turn of {turn_px or 0:g} pixels in pictures that show {columns:g}",
        "pictures of a whole turn at least",
        "leave turn_px out if they show less",
    )


def _first_readable(folder: Path, manifest: StillManifest) -> Frame:
    whys = []
    for name in manifest.pictures:
        stored = read_photograph(folder / name, folder=folder)
        if not isinstance(stored, Lost):
            return stored
        whys.append(stored.why)
    raise NoFramesError(
        f"not one picture of {folder} can be read; {whys[0]}",
        "PNG, TIFF, JPEG or BMP of 8 or 16 bits",
        "check the names of the pictures, and that the copy is complete",
    )


def read_photograph(path: Path, *, folder: Path) -> Frame | Lost:
    """Read a picture as it was stored, or say why it is of no use; it must not lie outside the folder."""
    if not is_inside(path, folder):
        return Lost(f"{path.name} lies outside the folder of the capture and was not opened")
    stored = read_first_page(path) if path.suffix.lower() in TIFF_SUFFIXES else read_picture(path, Contents())
    if isinstance(stored, Lost):
        return stored
    if stored.dtype not in (np.uint8, np.uint16):
        return Lost(f"{path.name} has pixels of type {stored.dtype}, needed whole numbers of 8 or 16 bits")
    if stored.ndim not in (2, 3) or min(stored.shape[:2]) < 16:
        return Lost(f"{path.name} has the shape {stored.shape}, needed is one picture of at least 16 × 16 pixels")
    return stored


def _canonical(stored: Frame, bench: StillBench) -> tuple[ImageArray, tuple[str, ...]]:
    """Turned so that s runs along the columns, mirrored, and grey; with what was odd about it."""
    grey = grey_of_colour(stored) if stored.ndim == 3 else stored
    fitted, remark = fit_to_bits(grey, bits=bench.sensor.bits)
    turned = fitted.T if bench.groove_along == "rows" else fitted
    image = np.ascontiguousarray(mirror(turned, columns=bench.sensor.columns, rows=bench.sensor.rows))
    return image, (remark,) if remark is not None else ()
