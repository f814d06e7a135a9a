"""From the tables of `capture.toml` to a canonical `Bench` and back, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from decimal import Context, Decimal, Inexact, localcontext
from typing import Any, Literal, cast

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.apparatus.manifest_tables import (
    FORMAT,
    NOTES,
    CameraTable,
    CoverGlassTable,
    FilmFile,
    FilmSequenceTable,
)
from gramoscope.camera.sensor import Sensor
from gramoscope.conventions import mirror_row
from gramoscope.disc.formats import Disc
from gramoscope.errors import require
from gramoscope.microscope.cover_glass import CoverGlass, Side
from gramoscope.microscope.objective import Objective
from gramoscope.turntable.rotation import Rotation

_EXACT = Context(prec=2000, traps=[Inexact])
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")
MICRO, MILLI = 6, 3


def bench_of_file(content: FilmFile) -> Bench:
    """Return the canonical bench that a file describes.

    Parameters
    ----------
    content : FilmFile or CaptureFile

    Returns
    -------
    Bench

    Raises
    ------
    ArgumentError
        If the parts do not go together.
    """
    disc, microscope = content.disc, content.microscope
    return Bench(
        disc=Disc(
            cut=disc.cut,
            groove_width_m=si_of(disc.groove_width_um, MICRO),
            wall_angle_rad=rad_of(disc.wall_angle_deg),
            characteristic=disc.characteristic,
            notes={name: text for name in NOTES if (text := getattr(disc, name)) is not None},
        ),
        rotation=Rotation(
            rpm=float(disc.rpm), radius_m=si_of(disc.radius_mm, MILLI), pitch_m=si_of(disc.pitch_um, MICRO)
        ),
        objective=Objective(
            magnification=float(microscope.magnification),
            numerical_aperture=float(microscope.numerical_aperture),
            tube_length_m=si_of(microscope.tube_length_mm, MILLI),
        ),
        cover_glass=None if content.cover_glass is None else _glass(content.cover_glass, content.camera),
        sensor=_sensor(content.camera),
        sequence=_sequence(content.sequence),
        focus_below_land_m=si_of(microscope.focus_below_land_um, MICRO),
    )


def _glass(table: CoverGlassTable, camera: CameraTable) -> CoverGlass:
    edge, shift = table.edge_row, table.focus_shift_um
    return CoverGlass(
        thickness_m=si_of(table.thickness_mm, MILLI),
        refractive_index=float(table.refractive_index),
        side=_mirrored_side(table.side, rows=camera.rows),
        edge_row=None if edge is None else float(_mirrored_row(edge, height_px=camera.height_px, rows=camera.rows)),
        focus_shift_m=None if shift is None else si_of(shift, MICRO),
    )


def _sensor(camera: CameraTable) -> Sensor:
    return Sensor(
        width_px=camera.width_px,
        height_px=camera.height_px,
        bits=camera.bits,
        colour=camera.colour,
        pixel_pitch_m=si_of(camera.pixel_pitch_um, MICRO),
        columns=camera.columns,
        rows=camera.rows,
    )


def _sequence(table: FilmSequenceTable) -> Sequence:
    return Sequence(
        groups=table.groups,
        frames_per_group=table.frames_per_group,
        frame_step_m=si_of(table.frame_step_um, MICRO),
        group_step_m=si_of(table.group_step_um, MICRO),
    )


def file_of_bench(bench: Bench, *, frames: str, log: str | None) -> dict[str, Any]:
    """Return the tables that describe a bench, the inverse of `bench_of_file`; keys without a value are left out.

    Parameters
    ----------
    bench : Bench
        Canonical.
    frames : str
    log : str or None

    Returns
    -------
    dict
        As `tomllib` would read it, with decimals for numbers.

    Raises
    ------
    ArgumentError
        If the disc has notes of a kind that the format does not know.
    """
    disc, rotation, objective, sensor, sequence = (
        bench.disc, bench.rotation, bench.objective, bench.sensor, bench.sequence,
    )  # fmt: skip
    strange = sorted(set(disc.notes) - set(NOTES))
    require(not strange, f"the disc has the notes {', '.join(strange)}", f"some of {', '.join(NOTES)}")
    tables: dict[str, Any] = {
        "format": FORMAT,
        "disc": {
            "cut": disc.cut,
            "rpm": decimal_of(rotation.rpm),
            "radius_mm": shifted(rotation.radius_m, MILLI),
            "groove_width_um": shifted(disc.groove_width_m, MICRO),
            "wall_angle_deg": deg_of(disc.wall_angle_rad),
            "pitch_um": shifted(rotation.pitch_m, MICRO),
            "characteristic": disc.characteristic,
            **{name: disc.notes.get(name) for name in NOTES},
        },
        "microscope": {
            "magnification": decimal_of(objective.magnification),
            "numerical_aperture": decimal_of(objective.numerical_aperture),
            "tube_length_mm": shifted(objective.tube_length_m, MILLI),
            "focus_below_land_um": shifted(bench.focus_below_land_m, MICRO),
        },
        "cover_glass": _glass_table(bench.cover_glass, sensor),
        "camera": {
            "width_px": sensor.width_px,
            "height_px": sensor.height_px,
            "bits": sensor.bits,
            "colour": sensor.colour,
            "pixel_pitch_um": shifted(sensor.pixel_pitch_m, MICRO),
            "columns": sensor.columns,
            "rows": sensor.rows,
        },
        "sequence": {
            "frames": frames,
            "groups": sequence.groups,
            "frames_per_group": sequence.frames_per_group,
            "frame_step_um": shifted(sequence.frame_step_m, MICRO),
            "group_step_um": shifted(sequence.group_step_m, MICRO),
            "log": log,
        },
    }
    return without_none(tables)


def _glass_table(glass: CoverGlass | None, sensor: Sensor) -> dict[str, Any] | None:
    if glass is None:
        return None
    edge, shift = glass.edge_row, glass.focus_shift_m
    return {
        "thickness_mm": shifted(glass.thickness_m, MILLI),
        "refractive_index": decimal_of(glass.refractive_index),
        "edge_row": None
        if edge is None
        else _mirrored_row(decimal_of(edge), height_px=sensor.height_px, rows=sensor.rows),
        "side": _mirrored_side(glass.side, rows=sensor.rows),
        "focus_shift_um": None if shift is None else shifted(shift, MICRO),
    }


def without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables without the keys that have no value."""
    return {
        key: without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }


def toml_of_file(content: Mapping[str, Any]) -> str:
    """Return the TOML of the tables that `file_of_bench` made."""
    lines = [f"{key} = {_toml(value)}" for key, value in content.items() if not isinstance(value, Mapping)]
    for name, table in content.items():
        if isinstance(table, Mapping):
            lines += ["", f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _toml(value: str | int | Decimal | list[str]) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        # JSON escapes what TOML escapes, except for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Decimal):
        text = format(value, "f") if -20 < value.adjusted() < 20 else str(value)
        return text if "." in text or "E" in text else f"{text}.0"
    return str(value)


def si_of(value: Decimal, places: int) -> float:
    """Return a number of the file in SI units, so many decimal places smaller."""
    return float(value.scaleb(-places, _EXACT))


def decimal_of(value: float) -> Decimal:
    """Return the shortest decimal that is read back as the same number."""
    return Decimal(repr(float(value)))


def shifted(value_m: float, places: int) -> Decimal:
    """Return an SI number as the file has it, so many decimal places larger."""
    return decimal_of(value_m).scaleb(places, _EXACT)


def rad_of(angle_deg: Decimal) -> float:
    """Return an angle of the file in radians."""
    # as conventions.rad, but for decimals: through a binary number of degrees not every angle could be written
    with localcontext(prec=50):
        return float(angle_deg * _PI / 180)


def deg_of(angle_rad: float) -> Decimal:
    """Return an angle in degrees that `rad_of` reads back to the last bit."""
    with localcontext(prec=50):
        exact = Decimal(angle_rad) * 180 / _PI
        shortest = (Decimal(f"{exact:.{digits}g}") for digits in range(1, 40))
        return next((angle for angle in shortest if rad_of(angle) == angle_rad), exact)


def _mirrored_row(row: Decimal, *, height_px: int, rows: Literal["inward", "outward"]) -> Decimal:
    with localcontext(_EXACT):
        return cast(Decimal, mirror_row(cast(float, row), height_px=height_px, rows=rows))


def _mirrored_side(side: Side, *, rows: Literal["inward", "outward"]) -> Side:
    if rows == "inward":
        return side
    return "high" if side == "low" else "low"
