"""The `capture.toml` of photographs, read and written."""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gramoscope.apparatus.manifest import MANIFEST_NAME, load_toml, validated
from gramoscope.apparatus.manifest_bench import MICRO, MILLI, deg_of, rad_of, shifted, si_of, toml_of_file, without_none
from gramoscope.apparatus.manifest_errors import problems_of, several
from gramoscope.apparatus.manifest_tables import FORMAT, NOTES
from gramoscope.apparatus.still_bench import Axis, Row
from gramoscope.apparatus.still_tables import StillFile
from gramoscope.camera.pattern import IMAGE_SUFFIXES, require_inside
from gramoscope.conventions import Columns, Rows
from gramoscope.disc.formats import Disc
from gramoscope.errors import ArgumentError, GramoscopeError, ManifestError

KIND = "still"


@dataclass(frozen=True)
class StillManifest:
    """What somebody says of photographs, in a `capture.toml` or beside a single picture.

    Attributes
    ----------
    pictures : tuple of str
        Files inside the capture's folder, in the order of the groove.
    disc : Disc
    wall_angle_known : bool
        Whether somebody says that the walls stand as `disc` has it. If not, test tones may tell (`pickup.edges.wall_angle`).
    pixel_pitch_m, rpm, radius_m : float or None
        None where nobody knows.
    bits : int or None
        Of the camera; as many as the numbers in the file can have when None.
    groove_along : {"columns", "rows"} or None
        None where it is to be found in the picture.
    along : {"forward", "backward"}
        Whether s grows or falls with that index.
    across : {"inward", "outward"} or None
        Whether l grows or falls with the other index; as a photograph from above shows it when None.
    row : Row
    """

    pictures: tuple[str, ...]
    disc: Disc = field(default_factory=Disc)
    wall_angle_known: bool = False
    pixel_pitch_m: float | None = None
    rpm: float | None = None
    radius_m: float | None = None
    bits: int | None = None
    groove_along: Axis | None = None
    along: Columns = "forward"
    across: Rows | None = None
    row: Row = field(default_factory=Row)


def is_still(path: Path) -> bool:
    """Tell whether a manifest is that of photographs; False for what cannot be read, which whoever reads it will say."""
    file = path / MANIFEST_NAME if path.is_dir() else path
    try:
        sequence = load_toml(file).get("sequence")
    except (GramoscopeError, OSError):  # said by whoever reads it as a film
        return False
    return isinstance(sequence, dict) and sequence.get("kind") == KIND


def read_still_manifest(path: Path) -> StillManifest:
    """Read the manifest of photographs.

    Parameters
    ----------
    path : Path
        A `capture.toml`, or the folder it lies in.

    Returns
    -------
    StillManifest

    Raises
    ------
    CaptureError
        If there is no such folder or file.
    ManifestError
        If a key is missing, unknown or out of its range, or a path leaves the folder. All problems are named at once.
    """
    file = path / MANIFEST_NAME if path.is_dir() else path
    content: StillFile = validated(StillFile, load_toml(file), file=file)
    try:
        for name in content.sequence.pictures:
            _require_picture(name)
        return _manifest_of(content)
    except ArgumentError as error:
        raise ManifestError(f"{file}: {error.found}", error.needed, error.remedy) from None


def _require_picture(name: str) -> None:
    require_inside(name)
    if Path(name).suffix.lower() not in IMAGE_SUFFIXES:
        raise ArgumentError(f"the picture {name!r}", f"a file that ends in {', '.join(IMAGE_SUFFIXES)}")


def _manifest_of(content: StillFile) -> StillManifest:
    disc, camera, sequence = content.disc, content.camera, content.sequence
    count, angle_deg = len(sequence.pictures), disc.wall_angle_deg
    if (sequence.step_px is None) != (count == 1):
        raise ArgumentError(
            f"[sequence] has {count} pictures and {'no step_px' if sequence.step_px is None else 'a step_px'}",
            "step_px, from the start of one picture to that of the next, where there are several pictures, and only there",
        )
    return StillManifest(
        pictures=tuple(sequence.pictures),
        disc=Disc(
            cut=disc.cut,
            groove_width_m=si_of(disc.groove_width_um, MICRO),
            wall_angle_rad=Disc().wall_angle_rad if angle_deg is None else rad_of(angle_deg),
            characteristic=disc.characteristic,
            notes={name: text for name in NOTES if (text := getattr(disc, name)) is not None},
        ),
        wall_angle_known=angle_deg is not None,
        pixel_pitch_m=_si(camera.pixel_pitch_um, MICRO),
        rpm=_si(disc.rpm, 0),
        radius_m=_si(disc.radius_mm, MILLI),
        bits=camera.bits,
        groove_along=camera.groove_along,
        along=camera.along,
        across=camera.across,
        row=Row(count, _si(sequence.step_px, 0) or 0.0, _si(sequence.turn_px, 0)),
    )


def _si(value: Decimal | None, places: int) -> float | None:
    return None if value is None else si_of(value, places)


def write_still_manifest(path: Path, manifest: StillManifest) -> None:
    """Write a manifest, so that `read_still_manifest` gives the same to the last bit.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    manifest : StillManifest

    Raises
    ------
    ArgumentError
        If it holds a value that the format has no place for.
    """
    content = _file_of(manifest)
    try:
        StillFile.model_validate(content)
    except ValidationError as error:
        raise ArgumentError(
            several(problems_of(error, StillFile, content)), "values that capture.toml can hold"
        ) from None
    path.write_text(toml_of_file(content), encoding="utf-8")


def _file_of(manifest: StillManifest) -> dict[str, Any]:
    disc, row = manifest.disc, manifest.row
    # an angle that is not the usual one was put there by somebody, and is not lost
    said = manifest.wall_angle_known or disc.wall_angle_rad != Disc().wall_angle_rad
    degrees = deg_of(disc.wall_angle_rad) if said else None
    return without_none(
        {
            "format": FORMAT,
            "disc": {
                "cut": disc.cut,
                "rpm": _shifted(manifest.rpm, 0),
                "radius_mm": _shifted(manifest.radius_m, MILLI),
                "groove_width_um": shifted(disc.groove_width_m, MICRO),
                "wall_angle_deg": degrees,
                "characteristic": disc.characteristic,
                **{name: disc.notes.get(name) for name in NOTES},
            },
            "camera": {
                "bits": manifest.bits,
                "pixel_pitch_um": _shifted(manifest.pixel_pitch_m, MICRO),
                "groove_along": manifest.groove_along,
                "along": manifest.along,
                "across": manifest.across,
            },
            "sequence": {
                "kind": KIND,
                "pictures": list(manifest.pictures),
                "step_px": _shifted(row.step_px or None, 0),
                "turn_px": _shifted(row.turn_px, 0),
            },
        }
    )


def _shifted(value: float | None, places: int) -> Decimal | None:
    return None if value is None else shifted(value, places)
