"""How the grooves of a row of pictures hang together: which stretches, picture by picture and turn by turn, are one passage.

A stretch is one groove in one picture. Neighbouring pictures are laid on each other by what both show (`tonearm.stitch`), and
a groove goes on in the next picture where its edges do (`tonearm.turns`). Where the row shows a whole turn the same is done
once more, between what it shows at the end of the turn and at its start, and the passages go on turn after turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gramoscope.apparatus.still_bench import StillBench
from gramoscope.conventions import FloatArray
from gramoscope.signal_path import GrooveEdges, StillPicture, Texture
from gramoscope.tonearm.splice import Match
from gramoscope.tonearm.stitch import Stitch
from gramoscope.tonearm.turns import NEAR_PX, GrooveEnds, continued, half_spacing, levels_of, nearest_level


@dataclass(frozen=True)
class Stretch:
    """One groove in one picture.

    Attributes
    ----------
    picture, groove : int
        Numbers of both.
    arc_start_m, lateral_start_m : float
        Where column 0 and row 0 of the picture lie, in the frame of the passage.
    columns : int
        Of the picture.
    unmatched : bool
        Whether the picture could not be laid on the one before.
    """

    picture: int
    groove: int
    arc_start_m: float
    lateral_start_m: float
    columns: int
    unmatched: bool = False


@dataclass(frozen=True, eq=False)
class Looked:
    """What is remembered of a picture until its neighbour has been seen.

    Attributes
    ----------
    number, columns : int
    grooves : int
    head, tail, closing : Texture
        What it shows at its start, at its end, and about the end of the turn.
    head_row_px, tail_row_px, closing_row_px : float64 arrays, shape (groove, 2, column)
        Edges in the same columns, and `NEAR_PX` at the least.
    head_first, tail_first, closing_first : int
        Columns where these begin.
    """

    number: int
    columns: int
    grooves: int
    head: Texture
    tail: Texture
    closing: Texture
    head_row_px: FloatArray
    tail_row_px: FloatArray
    closing_row_px: FloatArray
    tail_first: int
    closing_first: int


@dataclass
class RowOfPictures:
    """Takes pictures in, in order, and says in the end which passages they show.

    Parameters
    ----------
    bench : StillBench
    stitch : Stitch
    """

    bench: StillBench
    stitch: Stitch
    matches: list[Match] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    turn_match: Match | None = None
    _chains: list[list[Stretch]] = field(default_factory=list)
    _going_on: dict[int, int] = field(default_factory=dict)
    _joins: dict[int, int] = field(default_factory=dict)
    _waiting: dict[int, float] = field(default_factory=dict)
    _late: dict[int, float] = field(default_factory=dict)
    _first: Looked | None = None
    _before: Looked | None = None
    _place_m: tuple[float, float] = (0.0, 0.0)
    _last_place_m: tuple[float, float] = (0.0, 0.0)
    _closed: bool = False

    @property
    def turn_px(self) -> float | None:
        """Columns in a turn, by what the pictures show; None where they show none."""
        nominal = self.bench.row.turn_px
        if nominal is None or self.turn_match is None or np.isnan(self.turn_match.error_m):
            return nominal
        return nominal + self.turn_match.error_m / self.bench.sensor.pixel_pitch_m

    def looked(self, picture: StillPicture, edges: Sequence[GrooveEdges]) -> Looked:
        """Return what has to be remembered of a picture; from any thread."""
        columns, row = picture.image.shape[1], self.bench.row
        overlap = max(columns - int(np.floor(row.step_px)), 0) if row.pictures > 1 else 0
        shown = max(overlap + self.stitch.reach_px, NEAR_PX)
        rows = np.array([groove.row_px for groove in edges]).reshape(len(edges), 2, columns)
        ends = 0 if row.turn_px is None else int(np.floor(row.turn_px - picture.number * row.step_px))
        closing = max(ends - max(self.stitch.reach_px, NEAR_PX), 0)
        past_turn = self._head_columns()
        return Looked(
            picture.number,
            columns,
            len(edges),
            head=self.stitch.texture(picture, 0, max(shown, past_turn if picture.number == 0 else 0)),
            tail=self.stitch.texture(picture, columns - shown, columns),
            closing=self.stitch.texture(picture, closing, columns),
            head_row_px=rows[:, :, : max(shown, past_turn if picture.number == 0 else 0)],
            tail_row_px=rows[:, :, max(columns - shown, 0) :],
            closing_row_px=rows[:, :, closing:],
            tail_first=max(columns - shown, 0),
            closing_first=closing,
        )

    def _head_columns(self) -> int:
        """Columns that may be shown once more after a turn."""
        row = self.bench.row
        if row.turn_px is None:
            return 0
        total = (row.pictures - 1) * row.step_px + self.bench.sensor.width_px
        return int(np.ceil(total - row.turn_px)) + self.stitch.reach_px

    def add(self, looked: Looked) -> None:
        """Take in the next picture."""
        if self._closed or looked.grooves == 0:
            return
        step_m = self.bench.row.step_px * self.bench.sensor.pixel_pitch_m
        match = None
        if self._before is None:
            self._place_m = looked.number * step_m, 0.0
        else:
            match = self._placed(self._before, looked)
        self._first = self._first or looked
        self._chain(looked, match)
        self._before = looked
        turn_px, row = self.bench.row.turn_px, self.bench.row
        if turn_px is not None and looked.number * row.step_px + looked.columns >= turn_px:
            self._close(looked)

    def _placed(self, before: Looked, after: Looked) -> Match:
        """Lay a picture on the one before."""
        match = self.stitch.match(before.tail, after.head)
        self.matches.append(match)
        pitch_m = self.bench.sensor.pixel_pitch_m
        arc_m, lateral_m = self._place_m
        step_m = (after.number - before.number) * self.bench.row.step_px * pitch_m
        if np.isnan(match.error_m):
            self.problems.append(
                f"picture {after.number} could not be laid on the one before (correlation {match.correlation:.2f}): the "
                "nominal step stands"
            )
            self._place_m = arc_m + step_m, lateral_m
        else:
            self._place_m = arc_m + step_m + match.error_m, lateral_m - match.row_error_m
        return match

    def _chain(self, looked: Looked, match: Match | None) -> None:
        """Append each groove to the one that it continues."""
        arc_m, lateral_m = self._place_m
        linked: dict[int, int] = {}
        if self._before is not None:
            before, after = self._ends(self._before), self._ends(looked, head=True)
            linked = {there: here for here, there in enumerate(continued(before, after)) if there is not None}
            self._wait(before, {*linked.values()})
        levels = levels_of(self._ends(looked, head=True).row_px)
        going_on = {}
        for groove in range(looked.grooves):
            chain = self._going_on.get(linked.get(groove, -1), self._found_again(float(levels[groove]), levels))
            if chain == len(self._chains):
                self._chains.append([])
                if self._before is not None:
                    self._late[chain] = float(levels[groove])
            unmatched = match is not None and bool(np.isnan(match.error_m))
            self._chains[chain].append(Stretch(looked.number, groove, arc_m, lateral_m, looked.columns, unmatched))
            going_on[groove] = chain
        self._going_on = going_on
        self._last_place_m = self._place_m

    def _wait(self, before: GrooveEnds, linked: set[int]) -> None:
        """Remember where grooves ran that the next picture does not show: the one after it may."""
        levels = levels_of(before.row_px)
        self._waiting |= {self._going_on[k]: float(levels[k]) for k in self._going_on if k not in linked}

    def _found_again(self, level: float, levels: FloatArray) -> int:
        """The chain that waits where a groove begins, or a new one."""
        near = nearest_level(level, self._waiting, half_spacing(levels))
        if near is None:
            return len(self._chains)
        del self._waiting[near]
        return near

    def _ends(self, looked: Looked, *, head: bool = False) -> GrooveEnds:
        """The edges at an end of a picture, in the frame of the row: of the new one, or of the one before."""
        pitch_m = self.bench.sensor.pixel_pitch_m
        arc_m, lateral_m = self._place_m if head else self._last_place_m
        first, rows = (0, looked.head_row_px) if head else (looked.tail_first, looked.tail_row_px)
        return GrooveEnds(int(np.rint(arc_m / pitch_m)) + first, rows + lateral_m / pitch_m)

    def _close(self, last: Looked) -> None:
        """Lay the end of the turn on its start, and note which groove goes on as which."""
        assert self._first is not None
        self._closed = True
        pitch_m, turn_px = self.bench.sensor.pixel_pitch_m, self.bench.row.turn_px or 0.0
        arc_m, lateral_m = self._place_m
        start = _moved(self._first.head, turn_px * pitch_m, 0.0)
        end = _moved(last.closing, arc_m - last.number * self.bench.row.step_px * pitch_m, lateral_m)
        self.turn_match = self.stitch.match(end, start)
        if np.isnan(self.turn_match.error_m):
            self.problems.append(
                "the end of the turn could not be laid on its start: turns are joined at the nominal place"
            )
        turn = self.turn_px or 0.0
        before = GrooveEnds(
            int(np.rint(arc_m / pitch_m)) + last.closing_first, last.closing_row_px + lateral_m / pitch_m
        )
        after = GrooveEnds(int(np.rint(turn)), self._first.head_row_px + self.turn_drift_m / pitch_m)
        starts = {chain[0].groove: k for k, chain in enumerate(self._chains) if chain[0].picture == self._first.number}
        links = continued(before, after)
        for here, there in enumerate(links):
            if there is not None and starts[there] != self._going_on[here]:
                self._joins[self._going_on[here]] = starts[there]
        # grooves that were missed at an end of the turn: where they were seen last, and seen first
        ends, begins = levels_of(before.row_px), levels_of(after.row_px)
        self._waiting |= {self._going_on[k]: float(ends[k]) for k, there in enumerate(links) if there is None}
        late = {chain: level + self.turn_drift_m / pitch_m for chain, level in self._late.items()}
        late |= {starts[k]: float(begins[k]) for k in starts if starts[k] not in self._joins.values()}
        for chain, level in sorted(self._waiting.items()):
            next_one = nearest_level(level, {k: v for k, v in late.items() if k != chain}, half_spacing(ends))
            if next_one is not None:
                self._joins[chain] = next_one
                del late[next_one]

    @property
    def turn_drift_m(self) -> float:
        """How far rows have moved across the groove after a turn, by what the pictures show: a drift of the stage."""
        match = self.turn_match
        return 0.0 if match is None or np.isnan(match.row_error_m) else -match.row_error_m

    def passages(self) -> list[tuple[Stretch, ...]]:
        """Return the stretches of each passage, both in playing order, each passage counted from its own start."""
        pitch_m = self.bench.sensor.pixel_pitch_m
        turn_m = (self.turn_px or 0.0) * pitch_m
        found = []
        for first in sorted(set(range(len(self._chains))) - set(self._joins.values()), key=self._rank):
            passage: list[Stretch] = []
            chain: int | None = first
            turns = 0
            origin_m = self._chains[first][0].arc_start_m
            while chain is not None:
                passage += [
                    _shifted(one, turns * turn_m - origin_m, turns * self.turn_drift_m) for one in self._chains[chain]
                ]
                chain, turns = self._joins.get(chain), turns + 1
            found.append(tuple(passage))
        return found

    def _rank(self, chain: int) -> tuple[int, int]:
        """Grooves play in the order of their rows; those that come in later after those that are there before."""
        first = self._chains[chain][0]
        return first.picture, first.groove


def _shifted(stretch: Stretch, arc_m: float, lateral_m: float) -> Stretch:
    return Stretch(
        stretch.picture,
        stretch.groove,
        stretch.arc_start_m + arc_m,
        stretch.lateral_start_m + lateral_m,
        stretch.columns,
        stretch.unmatched,
    )


def _moved(texture: Texture, arc_m: float, lateral_m: float) -> Texture:
    return Texture(texture.strip, texture.arc_start_m + arc_m, texture.pixel_pitch_m, lateral_m)
