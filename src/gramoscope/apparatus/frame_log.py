"""`frames.csv`: where the rig's encoder says that each frame was taken. Nominal, not exact."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gramoscope.apparatus.bench import Sequence
from gramoscope.conventions import MICROMETRES_PER_METRE, BoolArray, FloatArray

HEADER = ("group", "frame", "arc_um", "time_s")
STAGE = "stage_um"
_NAMED_PROBLEMS = 20
NEIGHBOURS = 3
"""So many groups on either side are asked whether they agree."""
FARTHEST_M = 1e4
"""No groove is so long."""


@dataclass(frozen=True, eq=False)
class FrameLog:
    """The log, one entry a frame.

    Attributes
    ----------
    arc_m, stage_m : float64 arrays, shape (group, frame)
        Place s of column 0, and radial position of the microscope; NaN where the log says nothing of use.
    has_stage : bool
        Whether the log has a column for the stage.
    problems : tuple of str
        What was wrong with it, in words.
    """

    arc_m: FloatArray
    stage_m: FloatArray
    has_stage: bool = False
    problems: tuple[str, ...] = ()


def nominal_arc_m(group: int, *, sequence: Sequence) -> FloatArray:
    """Return where the frames of a group start when nobody logged it: g · group_step + k · frame_step."""
    frame = np.arange(sequence.frames_per_group, dtype=np.float64)
    return np.asarray(group * sequence.group_step_m + frame * sequence.frame_step_m, np.float64)


def believed_places(arc_m: FloatArray, nominal_m: FloatArray, *, width_m: float) -> tuple[FloatArray, BoolArray]:
    """Return where the frames of a group begin, and which of the logged places are not believed.

    Frames of a group overlap: the record turns a little from one to the next. A place that lies further than a quarter of a
    frame from where the others lead to expect it is a slip of the encoder, and is put where they do.

    Parameters
    ----------
    arc_m : float64 array, shape (frame,)
        As logged; NaN where nothing was, and there nothing is changed.
    nominal_m : float64 array, shape (frame,)
        Taken for all where most logged steps are longer than a frame.
    width_m : float
        Of a frame.

    Returns
    -------
    arc_m : float64 array, shape (frame,)
    slipped : bool array, shape (frame,)
    """
    slipped = np.zeros(arc_m.size, np.bool_)
    known = np.flatnonzero(np.isfinite(arc_m))
    if known.size < 2:
        return arc_m, slipped
    step_m = float(np.median(np.diff(arc_m[known]) / np.diff(known)))
    if abs(step_m) > width_m:
        slipped[known] = True
        return np.where(slipped, nominal_m, arc_m), slipped
    off_m = arc_m[known] - step_m * known
    # of an even number the lower one in the middle: there is such a frame, and others near it
    usual_m = np.sort(off_m)[(known.size - 1) // 2]
    slipped[known] = np.abs(off_m - usual_m) > width_m / 4
    return np.where(slipped, usual_m + step_m * np.arange(arc_m.size), arc_m), slipped


def stands_alone(number: int, log: FrameLog, *, sequence: Sequence, width_m: float) -> float | None:
    """Return where a group should be, if its logged place is near to that of no neighbour: a slip of the encoder.

    A place is told from the nominal one; where a rig really jumps, groups behind the jump agree with each other. While nobody
    behind a group is known (a film that is still being made) it is believed.

    Parameters
    ----------
    number : int
        Of the group.
    log : FrameLog
    sequence : Sequence
    width_m : float
        Of a frame; places within ten of them are near.

    Returns
    -------
    float or None
        How far from its nominal place the group is by its neighbours (median); None if it is where it says.
    """
    first_m, near_m = log.arc_m[:, 0], 10 * width_m
    for beside in (number - 1, number + 1):  # nearly always
        if 0 <= beside < len(first_m):
            step_m = first_m[beside] - first_m[number] - (beside - number) * sequence.group_step_m
            if abs(step_m) <= near_m:
                return None
    groups = np.arange(max(number - NEIGHBOURS, 0), min(number + NEIGHBOURS + 1, len(log.arc_m)))
    away_m = [log.arc_m[group] - nominal_arc_m(int(group), sequence=sequence) for group in groups]
    off_m = np.array([float(np.median(one[np.isfinite(one)])) if np.isfinite(one).any() else np.nan for one in away_m])
    mine = off_m[groups == number][0]
    others = off_m[(groups != number) & np.isfinite(off_m)]
    nobody_behind_yet = number + 1 < len(log.arc_m) and not np.isfinite(off_m[groups > number]).any()
    if np.isnan(mine) or nobody_behind_yet or others.size < 2 or np.abs(others - mine).min() <= near_m:
        return None
    return float(np.median(others))


def read_log(path: Path, *, sequence: Sequence) -> FrameLog:
    """Read a log; what is wrong with it is told and not raised.

    Parameters
    ----------
    path : Path
    sequence : Sequence
        How many groups and frames there are.

    Returns
    -------
    FrameLog
    """
    empty = np.full((sequence.groups, sequence.frames_per_group), np.nan)
    try:
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            rows = csv.reader(file)
            header = tuple(name.strip() for name in next(rows, []))
            if header not in (HEADER, (*HEADER, STAGE)):
                wrong = f"{path.name}: the first line is not {','.join(HEADER)}; nominal places are used"
                return FrameLog(empty, empty, problems=(wrong,))
            return _filled(rows, empty, name=path.name, has_stage=STAGE in header)
    except (OSError, csv.Error) as error:
        reason = "is missing" if isinstance(error, FileNotFoundError) else f"cannot be read ({error})"
        return FrameLog(empty, empty, problems=(f"{path.name} {reason}; nominal places are used",))


class GrowingLog:
    """A log that is still being written; `grow` reads what came since.

    Parameters
    ----------
    path : Path
    sequence : Sequence

    Attributes
    ----------
    log : FrameLog
        Its arrays fill as the log grows.
    """

    def __init__(self, path: Path, *, sequence: Sequence) -> None:
        empty = np.full((sequence.groups, sequence.frames_per_group), np.nan)
        self.log = FrameLog(empty, empty.copy())
        self._path, self._read_bytes = path, 0
        self._header: tuple[str, ...] = ()

    def grow(self) -> None:
        """Read the lines that are whole by now; what is wrong with one is left out, and found when the film is done."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._read_bytes)
                new = file.read()
        except FileNotFoundError:
            return
        whole = new[: new.rfind(b"\n") + 1]
        self._read_bytes += len(whole)
        for row in csv.reader(whole.decode("utf-8-sig", errors="replace").splitlines()):
            if not self._header:
                self._header = tuple(name.strip() for name in row)
            elif row:
                _enter(row, self.log.arc_m, self.log.stage_m, has_stage=STAGE in self._header)


def _filled(rows: Iterator[list[str]], empty: FloatArray, *, name: str, has_stage: bool) -> FrameLog:
    arc_m, stage_m = empty.copy(), empty.copy()
    problems = []
    for line, row in enumerate(rows, start=2):
        if not row:
            continue
        problem = _enter(row, arc_m, stage_m, has_stage=has_stage)
        if problem:
            problems.append(f"{name}, line {line}: {problem}")
    if len(problems) > _NAMED_PROBLEMS:
        problems[_NAMED_PROBLEMS:] = [f"{name}: {len(problems) - _NAMED_PROBLEMS} more lines like these"]
    return FrameLog(arc_m, stage_m, has_stage=has_stage, problems=tuple(problems))


def _enter(row: list[str], arc_m: FloatArray, stage_m: FloatArray, *, has_stage: bool) -> str | None:
    try:
        place = int(row[0]), int(row[1])
        arc_um = float(row[2])
        stage_um = float(row[len(HEADER)]) if has_stage else 0.0
    except (ValueError, IndexError):
        return f"{','.join(row)[:60]!r} is not a row of numbers"
    if not (0 <= place[0] < arc_m.shape[0] and 0 <= place[1] < arc_m.shape[1]):
        return f"there is no frame {place[1]} in a group {place[0]}"
    if not (math.isfinite(arc_um) and math.isfinite(stage_um)):
        return "a place that is not a finite number"
    if abs(arc_um) > FARTHEST_M * MICROMETRES_PER_METRE:
        return f"a place {arc_um:g} µm along the groove, longer than any"
    repeated = not math.isnan(arc_m[place])
    arc_m[place] = arc_um / MICROMETRES_PER_METRE
    stage_m[place] = stage_um / MICROMETRES_PER_METRE
    return "the same frame once more; the last entry counts" if repeated else None
