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
_MICRO, _MILLI = 6, 3


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
            groove_width_m=_si(disc.groove_width_um, _MICRO),
            wall_angle_rad=_rad(disc.wall_angle_deg),
            characteristic=disc.characteristic,
            notes={name: text for name in NOTES if (text := getattr(disc, name)) is not None},
        ),
        rotation=Rotation(
            rpm=float(disc.rpm), radius_m=_si(disc.radius_mm, _MILLI), pitch_m=_si(disc.pitch_um, _MICRO)
        ),
        objective=Objective(
            magnification=float(microscope.magnification),
            numerical_aperture=float(microscope.numerical_aperture),
            tube_length_m=_si(microscope.tube_length_mm, _MILLI),
        ),
        cover_glass=None if content.cover_glass is None else _glass(content.cover_glass, content.camera),
        sensor=_sensor(content.camera),
        sequence=_sequence(content.sequence),
        focus_below_land_m=_si(microscope.focus_below_land_um, _MICRO),
    )


def _glass(table: CoverGlassTable, camera: CameraTable) -> CoverGlass:
    edge, shift = table.edge_row, table.focus_shift_um
    return CoverGlass(
        thickness_m=_si(table.thickness_mm, _MILLI),
        refractive_index=float(table.refractive_index),
        side=_mirrored_side(table.side, rows=camera.rows),
        edge_row=None if edge is None else float(_mirrored_row(edge, height_px=camera.height_px, rows=camera.rows)),
        focus_shift_m=None if shift is None else _si(shift, _MICRO),
    )


def _sensor(camera: CameraTable) -> Sensor:
    return Sensor(
        width_px=camera.width_px,
        height_px=camera.height_px,
        bits=camera.bits,
        colour=camera.colour,
        pixel_pitch_m=_si(camera.pixel_pitch_um, _MICRO),
        columns=camera.columns,
        rows=camera.rows,
    )


def _sequence(table: FilmSequenceTable) -> Sequence:
    return Sequence(
        groups=table.groups,
        frames_per_group=table.frames_per_group,
        frame_step_m=_si(table.frame_step_um, _MICRO),
        group_step_m=_si(table.group_step_um, _MICRO),
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
            "rpm": _decimal(rotation.rpm),
            "radius_mm": _shifted(rotation.radius_m, _MILLI),
            "groove_width_um": _shifted(disc.groove_width_m, _MICRO),
            "wall_angle_deg": _deg(disc.wall_angle_rad),
            "pitch_um": _shifted(rotation.pitch_m, _MICRO),
            "characteristic": disc.characteristic,
            **{name: disc.notes.get(name) for name in NOTES},
        },
        "microscope": {
            "magnification": _decimal(objective.magnification),
            "numerical_aperture": _decimal(objective.numerical_aperture),
            "tube_length_mm": _shifted(objective.tube_length_m, _MILLI),
            "focus_below_land_um": _shifted(bench.focus_below_land_m, _MICRO),
        },
        "cover_glass": _glass_table(bench.cover_glass, sensor),
        "camera": {
            "width_px": sensor.width_px,
            "height_px": sensor.height_px,
            "bits": sensor.bits,
            "colour": sensor.colour,
            "pixel_pitch_um": _shifted(sensor.pixel_pitch_m, _MICRO),
            "columns": sensor.columns,
            "rows": sensor.rows,
        },
        "sequence": {
            "frames": frames,
            "groups": sequence.groups,
            "frames_per_group": sequence.frames_per_group,
            "frame_step_um": _shifted(sequence.frame_step_m, _MICRO),
            "group_step_um": _shifted(sequence.group_step_m, _MICRO),
            "log": log,
        },
    }
    return _without_none(tables)


def _glass_table(glass: CoverGlass | None, sensor: Sensor) -> dict[str, Any] | None:
    if glass is None:
        return None
    edge, shift = glass.edge_row, glass.focus_shift_m
    return {
        "thickness_mm": _shifted(glass.thickness_m, _MILLI),
        "refractive_index": _decimal(glass.refractive_index),
        "edge_row": None
        if edge is None
        else _mirrored_row(_decimal(edge), height_px=sensor.height_px, rows=sensor.rows),
        "side": _mirrored_side(glass.side, rows=sensor.rows),
        "focus_shift_um": None if shift is None else _shifted(shift, _MICRO),
    }


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
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


def _toml(value: str | int | Decimal) -> str:
    if isinstance(value, str):
        # JSON escapes what TOML escapes, except for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Decimal):
        text = format(value, "f") if -20 < value.adjusted() < 20 else str(value)
        return text if "." in text or "E" in text else f"{text}.0"
    return str(value)


def _si(value: Decimal, places: int) -> float:
    return float(value.scaleb(-places, _EXACT))


def _decimal(value: float) -> Decimal:
    return Decimal(repr(float(value)))


def _shifted(value_m: float, places: int) -> Decimal:
    return _decimal(value_m).scaleb(places, _EXACT)


def _rad(angle_deg: Decimal) -> float:
    # as conventions.rad, but for decimals: through a binary number of degrees not every angle could be written
    with localcontext(prec=50):
        return float(angle_deg * _PI / 180)


def _deg(angle_rad: float) -> Decimal:
    with localcontext(prec=50):
        exact = Decimal(angle_rad) * 180 / _PI
        shortest = (Decimal(f"{exact:.{digits}g}") for digits in range(1, 40))
        return next((angle for angle in shortest if _rad(angle) == angle_rad), exact)


def _mirrored_row(row: Decimal, *, height_px: int, rows: Literal["inward", "outward"]) -> Decimal:
    with localcontext(_EXACT):
        return cast(Decimal, mirror_row(cast(float, row), height_px=height_px, rows=rows))


def _mirrored_side(side: Side, *, rows: Literal["inward", "outward"]) -> Side:
    if rows == "inward":
        return side
    return "high" if side == "low" else "low"
