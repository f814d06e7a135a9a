"""Reading photographs: the edges of all grooves are found picture by picture, then each passage is played from them.

Every picture is looked at once and let go; its edges go to disk, into the file that the microscopist gets (`edge_file`), and
come back groove by groove. So memory holds a few pictures, however many there are.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gramoscope.apparatus.still import StillCapture
from gramoscope.conventions import MILLIMETRES_PER_METRE
from gramoscope.errors import CaptureError, require
from gramoscope.pickup.cartridge import Line, Sketch
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.pickup.edges.edge_trace import wall_trace
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player.centring import Centring
from gramoscope.player.edge_file import edge_writer, read_edges
from gramoscope.player.outputs import EDGES, GROOVE_LABELS, GROOVES
from gramoscope.player.provenance import InputHashes, hash_group
from gramoscope.player.reading import Passage
from gramoscope.player.row_of_pictures import Looked, RowOfPictures, Stretch
from gramoscope.player.wall_angle import WallAngle, wall_angle_of
from gramoscope.player.workers import in_order
from gramoscope.quality import NOT_MEASURED, Quality
from gramoscope.signal_path import GrooveEdges, StillPicture, WallTrace

if TYPE_CHECKING:
    from gramoscope.player.film import Told
    from gramoscope.player.monitor import Monitor
    from gramoscope.player.outputs import Outputs
    from gramoscope.player.play import Settings
    from gramoscope.player.recipe import Recipe

SHOWN_PX = 2048
"""Columns of a picture that are drawn."""
SILENCE_S = 0.001
"""Between two grooves that do not join."""
GROOVE_COLUMNS = ("groove", "start_s", "stop_s", "length_mm", "turns", "first_picture", "last_picture", "measured")


@dataclass
class PlayedGroove:
    """Where a passage lies in the sound, and what was seen of it."""

    number: int
    stretches: tuple[Stretch, ...]
    turns: int
    length_m: float
    samples: int = 0
    measured_samples: int = 0
    start_s: float = float("nan")
    stop_s: float = float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Return a row of the table."""
        return {
            "groove": self.number + 1,
            "start_s": self.start_s,
            "stop_s": self.stop_s,
            "length_mm": MILLIMETRES_PER_METRE * self.length_m,
            "turns": self.turns,
            "first_picture": self.stretches[0].picture,
            "last_picture": self.stretches[-1].picture,
            "measured": self.measured_samples / self.samples if self.samples else 0.0,
        }


@dataclass(frozen=True, eq=False)
class StillReading:
    """Photographs whose edges were found; see `player.reading.Reading`.

    Attributes
    ----------
    capture : StillCapture
    row : RowOfPictures
        How the pictures lie on each other.
    grooves : list of PlayedGroove
        The passages, in playing order.
    found : dict
        How many grooves were found in each picture.
    problems : dict
        What was found wrong with each picture, in words.
    files : Outputs
    edges_path : Path
    rate_hz : float
    angle : WallAngle or None
        Of the walls, once the edges have been found.
    """

    capture: StillCapture
    row: RowOfPictures
    grooves: list[PlayedGroove]
    found: dict[int, int]
    problems: dict[int, tuple[str, ...]]
    files: Outputs
    edges_path: Path
    rate_hz: float
    hashes: InputHashes = field(default_factory=InputHashes)
    centring: Centring = field(default_factory=Centring)

    angle: WallAngle | None = None

    walls = ("outer", "inner")

    @classmethod
    def begun(
        cls, capture: StillCapture, recipe: Recipe, settings: Settings, files: Outputs, progress: Told | None
    ) -> StillReading:
        """Look at all pictures, and return what they show."""
        require(
            settings.device == PROCESSOR,
            f"photographs on {settings.device.name}",
            "the processor",
            "leave --device out",
        )
        row, cartridge = RowOfPictures(capture.bench, recipe.stitch), recipe.edge_cartridge()
        reading = cls(capture, row, [], {}, {}, files, files.beside(EDGES), settings.rate_hz)
        reading._look(cartridge, settings.workers, progress)
        passages = reading._sort_out(settings.groove)
        disc, known = capture.bench.disc, capture.manifest.wall_angle_known
        angle = wall_angle_of(disc.wall_angle_rad, known, passages, reading._edges)
        return replace(reading, centring=Centring(settings.speed.remove_wow), angle=angle)

    def _look(self, cartridge: EdgeCartridge, workers: int, progress: Told | None) -> None:
        def look(number: int) -> tuple[StillPicture, tuple[GrooveEdges, ...], Looked, dict[str, str]]:
            picture = self.capture.group(number)
            edges = cartridge.find(picture)
            return _without_image(picture), edges, self.row.looked(picture, edges), hash_group(self.capture, number)

        count = self.capture.group_count
        with edge_writer(self.edges_path) as writer:
            for picture, edges, looked, sums in in_order(look, range(count), workers=workers, ahead=1):
                writer.write(picture.number, edges)
                self.row.add(looked)
                self.hashes.add(sums)
                self.found[picture.number] = len(edges)
                if picture.problems:
                    self.problems[picture.number] = picture.problems
                if progress is not None:
                    progress(picture.number + 1, count, "Looking")

    def _sort_out(self, groove: int | None) -> list[tuple[Stretch, ...]]:
        """Turn what was seen into passages, one of them alone to be played if somebody asked for it; return all of them."""
        passages = self.row.passages()
        if not passages:
            raise CaptureError(
                f"no groove was found in {self.capture.path}" + self._first_problem(),
                "land and groove of different brightness, with an edge between them that runs from side to side",
                "see whether groove_along (--groove-along) is right, and look at the picture",
            )
        require(
            groove is None or 1 <= groove <= len(passages),
            f"groove {groove}",
            f"1 … {len(passages)}, the grooves that were found",
        )
        pitch_m = self.capture.bench.sensor.pixel_pitch_m
        for number, stretches in enumerate(passages):
            if groove is None or groove == number + 1:
                last = stretches[-1]
                length_m = last.arc_start_m + (last.columns - 1) * pitch_m
                turns = sum(one.picture == stretches[0].picture for one in stretches)
                self.grooves.append(PlayedGroove(number, stretches, turns, length_m))
        return passages

    def _first_problem(self) -> str:
        return f"; the first problem: {next(iter(self.problems.values()))[0]}" if self.problems else ""

    @property
    def calibration(self) -> Mapping[str, Any]:
        """At which angle the walls stand."""
        return {} if self.angle is None else self.angle.as_dict()

    @property
    def wall_angle_rad(self) -> float:
        """As somebody says, as test tones tell, or 45°."""
        return self.capture.bench.disc.wall_angle_rad if self.angle is None else self.angle.rad

    @property
    def length_m(self) -> float:
        """Of all grooves together."""
        return sum(groove.length_m for groove in self.grooves)

    def passages(self, monitor: Monitor) -> Iterator[Passage]:
        """Yield each groove."""
        for problem in self.row.problems:
            monitor.problem(problem)
        for match in self.row.matches:
            monitor.spliced(match)
        for groove in self.grooves:
            yield Passage(groove.length_m, self._traces(groove, monitor))

    def _traces(self, groove: PlayedGroove, monitor: Monitor) -> Iterator[WallTrace]:
        for stretch in groove.stretches:
            trace = self._trace(stretch)
            groove.samples += trace.flags.size
            groove.measured_samples += int(np.count_nonzero((trace.flags & np.uint16(NOT_MEASURED)) == 0))
            monitor.picked_up(trace, 0)
            yield trace

    def _edges(self, stretch: Stretch) -> GrooveEdges:
        return read_edges(self.edges_path, stretch.picture, stretch.groove)

    def _trace(self, stretch: Stretch) -> WallTrace:
        edges = self._edges(stretch)
        picture = StillPicture(
            number=stretch.picture,
            image=_nothing(stretch.columns),
            arc_start_m=stretch.arc_start_m,
            lateral_start_m=stretch.lateral_start_m,
            pixel_pitch_m=self.capture.bench.sensor.pixel_pitch_m,
            white_level=self.capture.bench.sensor.white_level,
            seen=np.broadcast_to(np.True_, (1, stretch.columns)),
        )
        trace = replace(wall_trace(edges, picture), number=stretch.picture)
        problems = self.problems.pop(stretch.picture, ())
        flags = trace.flags | np.uint16(Quality.NO_OVERLAP) if stretch.unmatched else trace.flags
        return replace(trace, flags=flags, problems=(*trace.problems, *problems))

    def played(self, number: int, start_sample: int, stop_sample: int) -> None:
        """Note where a groove lies in the sound."""
        groove = self.grooves[number]
        groove.start_s, groove.stop_s = start_sample / self.rate_hz, stop_sample / self.rate_hz

    def sketch(self, number: int) -> Sketch | None:
        """Return the middle of a picture and the edges that were found in it; None where there are none."""
        if not self.found.get(number):
            return None
        image, lines = self.capture.group(number).image, []
        first = max(image.shape[1] - SHOWN_PX, 0) // 2
        shown = slice(first, first + SHOWN_PX)
        for groove in range(self.found[number]):
            edges = read_edges(self.edges_path, number, groove)
            measured = np.isfinite(edges.row_px) & ((edges.flags & np.uint16(NOT_MEASURED)) == 0)
            for wall, name in enumerate(("inner edge", "outer edge")):
                # the legend names one groove for all
                label = name if groove == 0 else f"_{name} of groove {groove + 1}"
                lines.append(Line(label, edges.row_px[wall][shown], measured[wall][shown]))
        return Sketch(image[:, shown], tuple(lines))

    def as_dict(self) -> dict[str, Any]:
        """Write the table of grooves and their labels, and return what the report says of them."""
        rows = [groove.as_dict() for groove in self.grooves]
        self.files.beside(GROOVES).write_text(_csv_of(rows), encoding="utf-8")
        labels = (f"{row['start_s']:.6f}\t{row['stop_s']:.6f}\tgroove {row['groove']}\n" for row in rows)
        self.files.beside(GROOVE_LABELS).write_text("".join(labels), encoding="utf-8")
        turn, bench = self.row.turn_match, self.capture.bench
        return {
            "grooves": {
                "played": rows,
                "pictures": self.capture.group_count,
                "found_in_each_picture": list(self.found.values()),
                "silence_between_s": SILENCE_S,
                "turn_px": self.row.turn_px,
                "turn_correlation": None if turn is None else turn.correlation,
                "table": GROOVES,
                "edges": EDGES,
                "labels": GROOVE_LABELS,
            },
            "still_manifest": asdict(self.capture.manifest),
            "scale": {
                "known": not bench.assumed,
                "assumed": list(bench.assumed),
                "groove_along": bench.groove_along,
                "groove_along_found": bench.found_direction,
            },
        }

    def remarks(self) -> Iterator[str]:
        """Say what nobody knows of the scale, and which way the groove was taken to run."""
        if self.angle is not None:
            yield from self.angle.remarks()
        bench = self.capture.bench
        if bench.assumed:
            yield (
                f"the scale is not known; it was assumed that {', that '.join(bench.assumed)}: length, pitch and level of the "
                "sound are arbitrary as far as they depend on that, and its ratios are not"
            )
        if bench.found_direction:
            way = "from side to side" if bench.groove_along == "columns" else "up and down"
            yield (
                f"the grooves were seen to run {way} (along the {bench.groove_along}); which of both directions is forward a "
                "picture does not tell: if the sound plays backwards, say along = backward"
            )


def _without_image(picture: StillPicture) -> StillPicture:
    """The picture without what takes room."""
    return replace(picture, image=_nothing(picture.image.shape[1]), seen=np.broadcast_to(np.True_, (1, 1)))


def _nothing(columns: int) -> Any:
    return np.broadcast_to(np.uint8(0), (1, columns))


def _csv_of(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    table = csv.DictWriter(text, GROOVE_COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()
