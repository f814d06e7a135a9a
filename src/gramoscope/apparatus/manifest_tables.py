"""The tables of `capture.toml` as pydantic models: every key, its kind, its range and its default."""

from __future__ import annotations

import datetime
from decimal import Decimal
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

FORMAT = "gramoscope-capture/1"
NOTES = ("title", "performer", "label", "matrix", "side", "date")


def _number(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        raise ValueError("a number")
    return Decimal(value)


def _text(value: object) -> object:
    return str(value) if isinstance(value, int | datetime.date) and not isinstance(value, bool) else value


Number = Annotated[Decimal, BeforeValidator(_number)]
Note = Annotated[str | None, BeforeValidator(_text)]
Count = Annotated[int, Field(strict=True)]


class Table(BaseModel):
    """A table of the file: no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class DiscTable(Table):
    """The record."""

    cut: Literal["lateral", "vertical", "stereo"]
    rpm: Number = Field(gt=0, le=1000)
    radius_mm: Number = Field(gt=0, le=1000)
    groove_width_um: Number = Field(default=Decimal(150), gt=0, le=10_000)
    wall_angle_deg: Number = Field(gt=0, lt=90)
    pitch_um: Number = Field(default=Decimal(0), ge=0, le=10_000)
    characteristic: str | None = Field(default=None, min_length=1)
    title: Note = None
    performer: Note = None
    label: Note = None
    matrix: Note = None
    side: Note = None
    date: Note = None


class MicroscopeTable(Table):
    """The objective, and where its sharp plane lies without glass."""

    magnification: Number = Field(gt=0, le=1000)
    numerical_aperture: Number = Field(gt=0, lt=1)
    tube_length_mm: Number = Field(gt=0, le=10_000)
    focus_below_land_um: Number = Field(default=Decimal(20), ge=-1000, le=1000)


class CoverGlassTable(Table):
    """The glass over half the field."""

    thickness_mm: Number = Field(gt=0, le=10)
    refractive_index: Number = Field(gt=1, le=4)
    edge_row: Number | None = Field(default=None, ge=-100_000, le=100_000)
    side: Literal["low", "high"]
    focus_shift_um: Number | None = Field(default=None, gt=0, le=10_000)


class CameraTable(Table):
    """The camera, and which way round it looks."""

    width_px: Count = Field(ge=16, le=65_536)
    height_px: Count = Field(ge=16, le=65_536)
    bits: Count = Field(ge=8, le=16)
    colour: Literal["rgb", "mono"]
    pixel_pitch_um: Number = Field(gt=0, le=1000)
    columns: Literal["forward", "backward"]
    rows: Literal["inward", "outward"]


class FilmSequenceTable(Table):
    """How the film is to be taken."""

    frames: str | None = None
    groups: Count = Field(default=1, ge=1, le=10_000_000)
    frames_per_group: Count = Field(ge=1, le=10_000)
    frame_step_um: Number = Field(ge=0, le=1_000_000)
    group_step_um: Number = Field(gt=0, le=1_000_000)
    log: str | None = None


class SequenceTable(FilmSequenceTable):
    """How the film was taken, and where it lies."""

    frames: str
    groups: Count = Field(ge=1, le=10_000_000)


class FilmFile(Table):
    """A bench for filming."""

    format: Literal["gramoscope-capture/1"]
    disc: DiscTable
    microscope: MicroscopeTable
    cover_glass: CoverGlassTable | None = None
    camera: CameraTable
    sequence: FilmSequenceTable


class CaptureFile(FilmFile):
    """A whole `capture.toml`."""

    sequence: SequenceTable
