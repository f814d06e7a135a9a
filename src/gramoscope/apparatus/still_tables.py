"""The tables of a `capture.toml` of photographs as pydantic models: every key, its kind, its range and its default."""

from __future__ import annotations

from decimal import Decimal
from typing import Literal

from pydantic import Field

from gramoscope.apparatus.manifest_tables import Count, Note, Number, Table


class StillDiscTable(Table):
    """The record, as far as anybody knows it."""

    cut: Literal["lateral", "vertical", "stereo"]
    rpm: Number | None = Field(default=None, gt=0, le=1000)
    radius_mm: Number | None = Field(default=None, gt=0, le=1000)
    groove_width_um: Number = Field(default=Decimal(150), gt=0, le=10_000)
    wall_angle_deg: Number | None = Field(default=None, gt=0, lt=90)
    characteristic: str | None = Field(default=None, min_length=1)
    title: Note = None
    performer: Note = None
    label: Note = None
    matrix: Note = None
    side: Note = None
    date: Note = None


class StillCameraTable(Table):
    """The pictures: their scale, and which way the groove runs in them."""

    bits: Count | None = Field(default=None, ge=8, le=16)
    pixel_pitch_um: Number | None = Field(default=None, gt=0, le=1000)
    groove_along: Literal["columns", "rows"] | None = None
    along: Literal["forward", "backward"] = "forward"
    across: Literal["inward", "outward"] | None = None


class StillSequenceTable(Table):
    """Which pictures there are, and how they lie along the groove."""

    kind: Literal["still"]
    pictures: list[str] = Field(min_length=1, max_length=1_000_000)
    step_px: Number | None = Field(default=None, gt=0, le=1_000_000)
    turn_px: Number | None = Field(default=None, gt=0, le=1_000_000_000)


class StillFile(Table):
    """A whole `capture.toml` of photographs."""

    format: Literal["gramoscope-capture/1"]
    disc: StillDiscTable
    camera: StillCameraTable = Field(default_factory=StillCameraTable)
    sequence: StillSequenceTable
