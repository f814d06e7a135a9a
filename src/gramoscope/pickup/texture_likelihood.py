"""The cartridge that reads walls by the likelihood of their texture: all stripes, both walls, an error bar for every sample.

Frames are registered by their flow; a coarse search finds the groove in every stretch by itself; what neighbouring rows of
the texture have to do with each other is learned from the passage, and says for every column of every stripe which way the
path must move and how surely (`pickup.texture`). Nothing is known beforehand about the texture, the lens or the camera; of
the manifest only where to look first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numba
import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.camera.exposure import Exposure
from gramoscope.conventions import INNER, BoolArray, FloatArray, IntArray
from gramoscope.errors import require
from gramoscope.pickup.cartridge import Line, Sketch, Spread
from gramoscope.pickup.device import Device, Film
from gramoscope.pickup.overlay import (
    TILE_COLUMNS,
    Overlay,
    frames_in,
    overlay_width,
    slope_along,
    tiles_about,
    to_phases,
)
from gramoscope.pickup.processor import Processor
from gramoscope.pickup.registration import overlap_textures, strip_columns
from gramoscope.pickup.texture.calibration import aligned_layout, calibration_of
from gramoscope.pickup.texture.coarse_path import along_columns, astray, of_walls, settled, silenced
from gramoscope.pickup.texture.following import TAPS, wide_rows
from gramoscope.pickup.texture.groove_search import GrooveSearch
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.learning import Learning, Lesson
from gramoscope.pickup.texture.reading import Evidence, Model, Rules, read, spaced
from gramoscope.pickup.texture.samples import STRIDE_PX, samples_of
from gramoscope.pickup.texture.sharpness import CELL_PX, Sharpness
from gramoscope.pickup.texture.smoothing import half_bell
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.quality import Quality, no_flags
from gramoscope.signal_path import FrameGroup, Texture, WallTrace

Coarse = tuple[FloatArray, FloatArray]

WANDER_PX = 10.0
"""A path that goes further than this from where the coarse search found it sees black, and is not believed."""
NEARLY_WHITE = 0.97
"""Points brighter than this share of full scale are burnt out."""
SEARCH_MARGIN_PX = -16.0
"""The coarse search looks for stripes so far beyond the glass edge: in the mixed zone they are faint, but there."""
BESIDE_PX = 24
"""Columns at either end rest on few frames, and are read no further than the whitener reaches from the others."""
MOST_COLUMNS = 1 << 14
"""Of a stretch that is learned from."""


@dataclass(frozen=True)
class TextureLikelihood:
    """The cartridge before it knows a passage.

    Parameters
    ----------
    bench : Bench
        What the apparatus is.
    learn_groups : int
        From so many groups, spread over the passage, its texture is learned.
    rounds : int
        A stretch is read in so many rounds, by models spaced evenly over those that learning went through.
    edge_margin_px : float
        Stripes are not read nearer to the glass edge than this (beyond the window's own half height).
    exposure, search, learning, rules
        The steps; see each.
    device : Device
        On which groups are read. Learning, once a passage, is the processor's.
    """

    bench: Bench
    learn_groups: int = 64
    rounds: int = 5
    edge_margin_px: float = 6.0
    exposure: Exposure = field(default_factory=Exposure)
    search: GrooveSearch = field(default_factory=GrooveSearch)
    learning: Learning = field(default_factory=Learning)
    rules: Rules = field(default_factory=Rules)
    device: Device = field(default_factory=Processor)

    def __post_init__(self) -> None:
        require(self.learn_groups >= 1, f"learning from {self.learn_groups} groups", "at least one")
        require(self.rounds >= 1, f"reading in {self.rounds} rounds", "at least one")

    def learning_groups(self, group_count: int) -> IntArray:
        """Return which groups of a passage are learned from."""
        count = min(self.learn_groups, group_count)
        return np.unique(np.round(np.linspace(0, group_count - 1, count)).astype(np.int64))

    def learn(
        self,
        group: Callable[[int], FrameGroup],
        group_count: int,
        spread: Spread,
        progress: Callable[[int, int], None] | None = None,
    ) -> TexturePickup:
        """Return the cartridge as it is after learning a passage; see `pickup.cartridge.Cartridge`."""
        numbers = self.learning_groups(group_count)
        total = numbers.size * (2 + len(self.learning.loading))
        done = 0

        def told(count: int) -> None:
            nonlocal done
            done += count
            if progress is not None:
                progress(min(done, total), total)

        seen = list[Sight]()
        for sight in spread(lambda number: self.sight(group(int(number))), numbers):
            told(1)
            if sight is not None:
                seen.append(sight)
        nominal = StripeLayout.of_bench(self.bench, edge_margin_px=SEARCH_MARGIN_PX)
        unread = TexturePickup(self, nominal)
        if not seen:
            return unread
        usual = float(np.median([sight.sharp.typical for sight in seen]))
        layout, paths = aligned_layout(
            [sight.sharp.among(usual) for sight in seen], nominal, self.search, self.bench.disc.cut, spread
        )
        pickup = replace(unread, layout=layout, usual_sharpness=usual)

        def prepared(i: int) -> Stretch:
            usable, _ = self.exposure.sort_out(group(seen[i].number))
            return pickup.stretch(Processor().film(usable), seen[i], paths[i])[0]

        stretches = list(spread(prepared, range(len(seen))))
        told(numbers.size)
        inner = StripeLayout.of_bench(self.bench, edge_margin_px=self.edge_margin_px).at(layout.rest_row)
        lessons = self.learning.learn(
            stretches, inner, self.bench.disc.cut, self.rules, spread, lambda: told(numbers.size)
        )
        fold = {sight.number: i % self.learning.folds for i, sight in enumerate(seen)}
        return replace(pickup, lessons=lessons, fold=fold)

    def sight(self, group: FrameGroup) -> Sight | None:
        """Return what the coarse search needs of a group; None when no frame is usable."""
        usable, _ = self.exposure.sort_out(group)
        return sight_of(Processor().film(usable)) if usable.valid.any() else None


@dataclass(frozen=True, eq=False)
class Sight:
    """A group at first sight.

    Attributes
    ----------
    number : int
        Of the group.
    shift_px : float64 array, shape (valid frame,)
    step_m : float64 array, shape (frame − 1,)
        How far the record turned, see `registration.frame_shifts`.
    sharp : Sharpness
        Where its picture is sharp.
    """

    number: int
    shift_px: FloatArray
    step_m: FloatArray
    sharp: Sharpness


def sight_of(film: Film) -> Sight:
    """Return a group at first sight, by its valid frames."""
    shift_px, step_m = film.device.frame_shifts(film)
    return Sight(film.group.number, shift_px, step_m, film.device.sharpness(film, shift_px))


@dataclass(frozen=True, eq=False)
class TexturePickup:
    """The cartridge that knows its passage.

    Attributes
    ----------
    cartridge : TextureLikelihood
    layout : StripeLayout
        Where the passage has its stripes.
    usual_sharpness : float
        How sharp they are there, see `Sharpness.typical`; 0 before anything was learned.
    lessons : tuple of Lesson
        What it taught; empty when there was nothing to learn from.
    fold : mapping
        Number of a group that was learned from → its fold.
    """

    cartridge: TextureLikelihood
    layout: StripeLayout
    usual_sharpness: float = 0.0
    lessons: tuple[Lesson, ...] = ()
    fold: Mapping[int, int] = field(default_factory=dict)

    @property
    def walls(self) -> tuple[str, ...]:
        """Both walls."""
        return ("inner", "outer")

    @property
    def calibration(self) -> Mapping[str, Any]:
        """What the passage says about the apparatus, beside what the manifest says."""
        last = self.lessons[-1].whole if self.lessons else None
        return calibration_of(self.layout, last, self.cartridge.bench, len(self.fold))

    def read(self, group: FrameGroup) -> WallTrace:
        """Return where both walls of one stretch run.

        Parameters
        ----------
        group : FrameGroup

        Returns
        -------
        WallTrace
            Offsets with their errors, every 8 columns; NaN and flags where a wall could not be read. Slopes are NaN.
        """
        group, exposure_flags = self.cartridge.exposure.sort_out(group)
        if not group.valid.any():
            return self._lost(group, exposure_flags, group.problems)
        if not self.taught:
            return self._lost(group, exposure_flags, (*group.problems, f"group {group.number} is not read: {UNTAUGHT}"))
        film = self.cartridge.device.film(group)
        sight = sight_of(film)
        stretch, laid = self.stretch(film, sight, self.searched(sight))
        path, found = read(stretch, self.models_for(group.number), self.cartridge.bench.disc.cut, self.cartridge.rules)
        return self._trace(group, path, found, exposure_flags, sight.step_m, self.strips(laid, film))

    def searched(self, sight: Sight) -> Coarse:
        """Return where the coarse search finds both walls, and how sharp each stripe; see `GrooveSearch.find`."""
        sharp = sight.sharp.among(self.usual_sharpness)
        return self.cartridge.search.find(sharp, self.layout, cut=self.cartridge.bench.disc.cut)

    def strips(self, laid: Overlay, film: Film) -> tuple[Texture | None, Texture | None]:
        """Return the texture at both ends of a group's mean, by which it is matched with its neighbours."""
        return overlap_textures(
            film.group,
            first=int(laid.frame_index[0]),
            width=laid.columns.shape[0],
            group_step_m=self.cartridge.bench.sequence.group_step_m,
            texture_of=lambda columns: slope_along(film.device.part(laid.columns, columns)),
        )

    @cached_property
    def taught(self) -> bool:
        """Whether the passage was long enough to learn the texture of a stripe at least."""
        return any(stripe is not None for lesson in self.lessons[-1:] for stripe in lesson.whole.stripes)

    @cached_property
    def most_columns(self) -> int:
        """So many columns of a stretch are read: as many as the passage's transforms hold, and room between its ends."""
        lengths = [lesson.whole.length for lesson in self.lessons]
        return min(lengths) - self.cartridge.learning.largest_lag_px // 2 if lengths else MOST_COLUMNS

    def sketch(self, group: FrameGroup) -> Sketch | None:
        """Return one frame and the stripes that were read in it; None when no frame is usable."""
        group, _ = self.cartridge.exposure.sort_out(group)
        if not group.valid.any() or not self.taught:
            return None
        film = self.cartridge.device.film(group)
        sight = sight_of(film)
        begun, _ = self.stretch(film, sight, self.searched(sight))
        stretch, found = read(begun, self.models_for(group.number), self.cartridge.bench.disc.cut, self.cartridge.rules)
        image = group.images[int(np.flatnonzero(group.valid)[0])]
        model = self.lessons[-1].whole
        layout = model.layout
        rows = layout.rows(stretch.displacement_px)
        visible = layout.visible(rows, half_px=model.half_px)
        shown = slice(stretch.first_column, min(stretch.first_column + rows.shape[1], image.shape[1]))
        lines = []
        for number, wall in enumerate(layout.wall):
            measured = visible[number] & (found.information[wall] > 0)
            if model.stripes[number] is not None:
                lowest = layout.from_bottom_px[number] == layout.from_bottom_px[layout.wall == wall].min()
                name = f"{'inner' if wall == INNER else 'outer'} wall, {'lower' if lowest else 'upper'} stripe"
                line = Line(name, np.full(image.shape[1], np.nan), np.zeros(image.shape[1], np.bool_))
                line.row[shown], line.measured[shown] = (
                    one[: shown.stop - shown.start] for one in (rows[number], measured)
                )
                lines.append(line)
        return Sketch(image, tuple(lines))

    def stretch(self, film: Film, sight: Sight, coarse: Coarse) -> tuple[Stretch, Overlay]:
        """Lay a stretch ready: draw the coarse paths column by column, and the picture about the stripes.

        Parameters
        ----------
        film : Film
        sight : Sight
        coarse : (float64 array, shape (2, cell); float64 array, shape (stripe, cell))
            Paths of the walls and support of the stripes, as `searched` finds them.
        """
        group, device = film.group, film.device
        shift_px = to_phases(sight.shift_px)
        height, width = group.images.shape[1], overlay_width(group.images.shape[2], shift_px)
        frames = frames_in(group.images.shape[2], shift_px)
        usable = frames * 2 >= frames.max()
        read = worth_reading(usable, self.most_columns)
        path, support = self._believed(coarse, read)
        rows = np.full((self.layout.wall.size, width), np.nan)
        rows[:, read] = self.layout.rows(path)
        ends = strip_columns(group, width=width, group_step_m=self.cartridge.bench.sequence.group_step_m)
        wanted = tiles_to_draw(rows, self.layout, (height, width), ends, half_px=self.cartridge.learning.half_px)
        laid = device.overlay(film, shift_px, np.flatnonzero(group.valid), wanted)
        columns = laid.columns[read]
        burnt = device.places_brighter(columns, NEARLY_WHITE * group.white_level)
        return Stretch(columns, usable[read], burnt, path, support, device=device, first_column=read.start), laid

    def _believed(self, coarse: Coarse, read: slice) -> Coarse:
        """Return paths and support of some columns, as far as they can be believed."""
        wall, cut, rules = self.layout.wall, self.cartridge.bench.disc.cut, self.cartridge.rules
        path = along_columns(coarse[0], read, cell_px=CELL_PX, half_bell=PATH_BELL)
        support = along_columns(coarse[1], read, cell_px=CELL_PX, half_bell=SUPPORT_BELL)
        lost = astray(path, of_walls(support, wall), cut, least_support=rules.least_support)
        support = silenced(support, lost, wall, least_best_support=rules.least_best_support)
        return settled(path, of_walls(support, wall), cut, smooth_px=rules.smooth_other_px), support

    def models_for(self, number: int) -> list[Model]:
        """Return the models by which a group is read, round by round: none that the group itself has taught."""
        return self._models[self.fold.get(number)]

    @cached_property
    def _models(self) -> dict[int | None, list[Model]]:
        """Those of each fold, and of groups that have taught nothing."""
        lessons = [self.lessons[i] for i in spaced(len(self.lessons), self.cartridge.rounds)]
        folds = {None, *self.fold.values()}
        return {fold: [one.whole if fold is None else one.without[fold] for one in lessons] for fold in folds}

    def _trace(
        self,
        group: FrameGroup,
        stretch: Stretch,
        found: Evidence,
        exposure_flags: Quality,
        step_m: FloatArray,
        strips: tuple[Texture | None, Texture | None],
    ) -> WallTrace:
        first = int(np.flatnonzero(group.valid)[0])
        pitch = group.pixel_pitch_m
        place_px, sigma_px = samples_of(stretch, found, self.cartridge.rules)
        flags = np.isnan(sigma_px) * np.uint16(UNSEEN) | np.uint16(exposure_flags)
        nothing = np.full(place_px.shape, np.nan)
        return WallTrace(
            number=group.number,
            arc_start_m=float(group.arc_start_m[first]) + (stretch.first_column + 0.5 * (STRIDE_PX - 1)) * pitch,
            arc_step_m=pitch * STRIDE_PX,
            offset_m=place_px * pitch + float(group.stage_m[first]),
            offset_sigma_m=sigma_px * pitch,
            slope=nothing,
            slope_sigma=nothing,
            correlation_samples=1.0,
            flags=flags,
            head=strips[0],
            tail=strips[1],
            frame_step_m=step_m,
            problems=group.problems,
        )

    def _lost(self, group: FrameGroup, flags: Quality, problems: tuple[str, ...]) -> WallTrace:
        """A stretch of which nothing can be said."""
        samples = group.images.shape[2] // STRIDE_PX
        nothing = np.full((2, samples), np.nan)
        return WallTrace(
            number=group.number,
            arc_start_m=float(group.arc_start_m[0]) + 0.5 * (STRIDE_PX - 1) * group.pixel_pitch_m,
            arc_step_m=group.pixel_pitch_m * STRIDE_PX,
            offset_m=nothing,
            offset_sigma_m=nothing,
            slope=nothing,
            slope_sigma=nothing,
            correlation_samples=1.0,
            flags=no_flags(2, samples) | np.uint16(flags | UNSEEN),
            problems=problems,
        )


def worth_reading(usable: BoolArray, most: int) -> slice:
    """Return the columns that are read: the usable ones, and on either side as many as their filters reach."""
    inside = np.flatnonzero(usable)
    first = max(int(inside[0]) - BESIDE_PX, 0) // STRIDE_PX * STRIDE_PX
    return slice(first, min(int(inside[-1]) + 1 + BESIDE_PX, usable.size, first + most))


def tiles_to_draw(
    rows: FloatArray, layout: StripeLayout, shape: tuple[int, int], ends: tuple[slice, ...], *, half_px: int
) -> BoolArray:
    """Return which tiles of a picture are looked at: those about stripes that can be read, and at its ends what can be matched.

    Parameters
    ----------
    rows : float64 array, shape (stripe, column)
        Where the stripes run; NaN in columns that are not read.
    layout : StripeLayout
    shape : (int, int)
        Rows and columns of the picture.
    ends : tuple of slice
        Columns that are matched with the neighbours: there a texture will do that cannot be read, as where stripes meet at
        the bottom of the groove.
    half_px : int
        Of the windows.
    """
    shown = layout.visible(rows, half_px=half_px - WANDER_PX)
    for end in ends:
        _show_end(rows[:, end], layout.seen_between, shown[:, end])
    wanted = tiles_about(np.where(shown, rows, np.nan), shape, reach_px=wide_rows(half_px) / 2 + TAPS / 2 + WANDER_PX)
    for end in ends:
        _join(wanted[:, end.start // TILE_COLUMNS : -(-end.stop // TILE_COLUMNS)])
    return wanted


@numba.njit(cache=True, nogil=True)
def _show_end(rows, limits, shown):  # type: ignore[no-untyped-def]
    """Show stripes, [stripe, column], wherever they are in sight, if in most columns none can be read."""
    columns = 0
    for x in range(rows.shape[1]):
        columns += shown[:, x].any()
    if 2 * columns < rows.shape[1]:
        for i in range(rows.shape[0]):
            for x in range(rows.shape[1]):
                shown[i, x] = limits[0, i] <= rows[i, x] <= limits[1, i]


@numba.njit(cache=True, nogil=True)
def _join(wanted):  # type: ignore[no-untyped-def]
    """Want all tiles of a row of which one is wanted."""
    for row in wanted:
        row[:] = row.any()


PATH_BELL, SUPPORT_BELL = half_bell(1.5), half_bell(4.0)
"""Smoothing of paths and support, over cells: one cell of texture is a poor witness."""
UNSEEN = Quality.NO_STRIPE | Quality.INTERPOLATED
UNTAUGHT = "too little of the stripes is seen to learn their texture; the recipe seed-paper reads single groups"
