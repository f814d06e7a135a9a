"""How fast the record shall turn: as the capture says, at a speed that somebody chose, or as a curve says."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from gramoscope.errors import ArgumentError, require
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import DriftingRotation, SpeedCurve
from gramoscope.turntable.speeds import speed_called

CURVE_HEADER = ("time_s", "rpm")


@dataclass(frozen=True)
class Speed:
    """What was chosen about the speed of a transfer.

    Parameters
    ----------
    rpm : float or None
        Turns a minute; as the capture says when None.
    name : str
        What it was called when it was chosen.
    origin : str
        Where the number comes from, in words.
    curve : SpeedCurve or None
        How it changed over time; wins over the capture, and stands beside no `rpm`.
    remove_wow : bool
        Whether the wow of an off-centre hole shall be removed, where it can be measured.
    """

    rpm: float | None = None
    name: str = ""
    origin: str = ""
    curve: SpeedCurve | None = None
    remove_wow: bool = False

    def __post_init__(self) -> None:
        require(
            self.rpm is None or self.curve is None,
            "a speed and a speed curve",
            "one of them",
            "write the speed into the curve",
        )

    @classmethod
    def chosen(cls, rpm: str | None, curve: Path | None, *, remove_wow: bool = False) -> Self:
        """Return what somebody chose on a command line: a number or name of a speed, a file with a curve, both or none."""
        followed = None if curve is None else load_speed_curve(curve)
        if rpm is None:
            return cls(name=str(curve or ""), curve=followed, remove_wow=remove_wow)
        named = speed_called(rpm)
        return cls(named.rpm, rpm.strip(), named.origin, followed, remove_wow)

    def rotation_of(self, nominal: Rotation) -> Rotation:
        """Return how the record turns, for a nominal rotation of which the spiral is kept."""
        if self.curve is not None:
            return DriftingRotation.following(self.curve, nominal)
        return nominal if self.rpm is None else replace(nominal, rpm=self.rpm)

    def done(self, nominal: Rotation) -> str:
        """Return what was changed about the speed, in words and in ASCII; empty when nothing was."""
        words = []
        if self.rpm is not None or self.curve is not None:
            words.append(f"speed {self.rotation_of(nominal).in_words()} in place of {nominal.rpm:g} as captured")
        if self.remove_wow:
            words.append("wow of off-centre hole: removal asked for, outcome in report.json")
        return "; ".join(words)

    def as_dict(self, nominal: Rotation) -> dict[str, Any]:
        """Return what the report says of the speed."""
        rotation = self.rotation_of(nominal)
        curve = None if self.curve is None else {"time_s": self.curve.time_s, "rpm": self.curve.rpm}
        return {
            "rpm": rotation.rpm,
            "chosen": self.name or None,
            "origin": self.origin or None,
            "capture_rpm": nominal.rpm,
            "curve": curve,
        }


def speed_in_words(speed: Mapping[str, Any]) -> str:
    """Return the speed of a report in words: one number, or the lowest and the highest of a curve."""
    if speed["curve"] is None:
        return f"{speed['rpm']:.5g} rpm"
    return f"{min(speed['curve']['rpm']):g} to {max(speed['curve']['rpm']):g} rpm"


def load_speed_curve(path: Path) -> SpeedCurve:
    """Return the curve in a CSV file.

    Parameters
    ----------
    path : Path
        A header, `time_s,rpm`, and a row for each knot. Empty rows do not count.

    Raises
    ------
    ArgumentError
        If it cannot be read, or says something impossible; the line is named.
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _unreadable(path, f"cannot be read: {error}") from error
    numbered = [(number, row) for number, row in enumerate(rows, start=1) if any(cell.strip() for cell in row)]
    if not numbered or tuple(cell.strip() for cell in numbered[0][1]) != CURVE_HEADER:
        raise _unreadable(path, "does not begin with the header")
    knots = [_knot(path, number, row) for number, row in numbered[1:]]
    return SpeedCurve(tuple(time for time, _ in knots), tuple(rpm for _, rpm in knots))


def _knot(path: Path, number: int, row: list[str]) -> tuple[float, float]:
    try:
        time, rpm = (float(cell) for cell in row)
    except ValueError:
        raise _unreadable(path, f"line {number} holds {','.join(row)!r}") from None
    return time, rpm


def _unreadable(path: Path, found: str) -> ArgumentError:
    return ArgumentError(
        f"the speed curve {path}: {found}", "CSV with the header time_s,rpm and two numbers in each row", "0,78.26"
    )
