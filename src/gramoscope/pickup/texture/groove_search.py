"""The coarse search: roughly where the groove runs through one stretch, by all its stripes together.

For every cell of columns and every displacement of the groove, lateral and vertical, the ridges at the places where the
model puts the stripes are added up; a stripe that the model puts out of sight adds nothing. The best path through these
sums, with steps from cell to cell no steeper than a groove can be, is found by Viterbi's algorithm, which needs no start
and is not led astray by a scratch, a chipped wall or a stripe that vanishes for a while. Then each wall looks for its own
path near the common one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, Float32Array, FloatArray, IntArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.film_lanes import PIXELS, add_lines
from gramoscope.pickup.texture.layout import BOTTOM_PX, StripeLayout, wall_sign
from gramoscope.pickup.texture.sharpness import ridges

# Places are unsigned, for signed ones may count from the end, and keep loops from being vectorised; arrays are lines, for
# taking part of one costs as much as the work on it.


@numba.njit(cache=True, nogil=True)
def _copy(values, first, size, out, begin):  # type: ignore[no-untyped-def]
    here, there = np.uint64(first), np.uint64(begin)
    for k in range(np.uint64(size)):
        out[there + k] = values[here + k]


@numba.njit(cache=True, nogil=True)
def _add(values, size, out, begin):  # type: ignore[no-untyped-def]
    there = np.uint64(begin)
    for k in range(np.uint64(size)):
        out[there + k] += values[k]


@numba.njit(cache=True, nogil=True)
def _best_of_three(sums, begin, far, price, best, first, size):  # type: ignore[no-untyped-def]
    """Write some sums, or those so far away, on either side, at a price."""
    here, there, before, behind = np.uint64(first), np.uint64(begin), np.uint64(begin - far), np.uint64(begin + far)
    for k in range(np.uint64(size)):
        best[here + k] = max(sums[there + k], max(sums[before + k], sums[behind + k]) - price)


@numba.njit(cache=True, nogil=True)
def _raise(sums, begin, far, price, best, first, size):  # type: ignore[no-untyped-def]
    """Raise some of the best sums to those so far away, on either side, at a price."""
    here, before, behind = np.uint64(first), np.uint64(begin - far), np.uint64(begin + far)
    for k in range(np.uint64(size)):
        best[here + k] = max(best[here + k], max(sums[before + k], sums[behind + k]) - price)


@numba.njit(cache=True, nogil=True)
def _best_by_steps(sums, begin, far, count, cost, best, first, size):  # type: ignore[no-untyped-def]
    """Write the best sums up to `count` steps of `far` places away, each at the cost of its square."""
    if count == 0:
        _copy(sums, begin, size, best, first)
        return
    _best_of_three(sums, begin, far, best.dtype.type(cost), best, first, size)
    for step in range(2, count + 1):
        _raise(sums, begin, step * far, best.dtype.type(cost * step * step), best, first, size)


@numba.njit(cache=True, nogil=True)
def _add_best_of_three(best, begin, far, price, sums, first, size):  # type: ignore[no-untyped-def]
    """Add what `_best_of_three` says."""
    here, there, before, behind = np.uint64(first), np.uint64(begin), np.uint64(begin - far), np.uint64(begin + far)
    for k in range(np.uint64(size)):
        sums[here + k] += max(best[there + k], max(best[before + k], best[behind + k]) - price)


@numba.njit(cache=True, nogil=True)
def _go_on(sums, begin, line, size, reach, cost, along, new):  # type: ignore[no-untyped-def]
    """Add the best sums of one cell, which begin at a place, to the scores of the next."""
    margin = reach[0] * line
    _best_by_steps(sums, begin, 1, reach[1], cost[1], along, margin, size)
    if reach[0] == 1:
        _add_best_of_three(along, margin, line, along.dtype.type(cost[0]), sums, begin + size, size)
        return
    _best_by_steps(along, margin, line, reach[0], cost[0], new, 0, size)
    _add(new, size, sums, begin + size)


@numba.njit(cache=True, nogil=True)
def _way_back(sums, begin, shape, line, reach, cost):  # type: ignore[no-untyped-def]
    """Return the path that ends where the sum is largest, and that sum."""
    cells, rows, columns = shape
    size = rows * line
    path = np.empty((2, cells), np.int64)
    end = begin + (cells - 1) * size
    best = end + np.argmax(sums[end : end + size])
    total, i, j = sums[best], (best - end) // line, (best - end) % line
    path[0, -1], path[1, -1] = i, j
    for cell in range(cells - 1, 0, -1):
        most, from_i, from_j = -np.inf, i, j
        for m in range(max(0, i - reach[0]), min(rows, i + reach[0] + 1)):
            for n in range(max(0, j - reach[1]), min(columns, j + reach[1] + 1)):
                value = (
                    sums[begin + ((cell - 1) * rows + m) * line + n] - cost[0] * (m - i) ** 2 - cost[1] * (n - j) ** 2
                )
                if value > most:
                    most, from_i, from_j = value, m, n
        i, j = from_i, from_j
        path[0, cell - 1], path[1, cell - 1] = i, j
    return path, total


@numba.njit(cache=True, nogil=True)
def _room(shape, reach, real):  # type: ignore[no-untyped-def]
    """What paths through so many cells, rows and columns add up in, with a margin after each row that no path enters."""
    cells, rows, columns = shape
    line = columns + reach[1]
    sums = np.empty(reach[1] + cells * rows * line + PIXELS, real)
    sums[: reach[1]] = -np.inf
    along = np.full((rows + 2 * reach[0]) * line, -np.inf, real)
    return line, sums, along, np.empty(rows * line, real)


@numba.njit(cache=True, nogil=True)
def best_path(score, largest_step, step_cost):  # type: ignore[no-untyped-def]
    """Return the path through score[cell, i, j] with the largest sum, and that sum (A. Viterbi, 1967).

    From cell to cell i and j change by at most `largest_step[0]` and `[1]`, each at a cost of its `step_cost` times the
    square of the change; as these add up, the best step in j is found first and that in i after it. What came before a
    place is found again on the way back.
    """
    cells, rows, columns = score.shape
    line, sums, along, new = _room(score.shape, largest_step, score.dtype)
    size, begin = rows * line, largest_step[1]
    for cell in range(cells):
        for i in range(rows):
            first = begin + cell * size + i * line
            sums[first : first + columns] = score[cell, i]
            sums[first + columns : first + line] = -np.inf
        if cell > 0:
            _go_on(sums, begin + (cell - 1) * size, line, size, largest_step, step_cost, along, new)
    return _way_back(sums, begin, score.shape, line, largest_step, step_cost)


@numba.njit(cache=True, nogil=True)
def _write_above(values, first, level, count, lines, begin):  # type: ignore[no-untyped-def]
    here, there = np.uint64(first), np.uint64(begin)
    for k in range(np.uint64(count)):
        lines[there + k] = values[here + k] - level


@numba.njit(cache=True, nogil=True)
def _views(looks, first_row, seen_rows, line, shape):  # type: ignore[no-untyped-def]
    """Return what is seen of ridges of such a shape, each kind of view once, and where displacements begin in it.

    A view is (where it begins in the ridges of the first cell, how much is seen, where that begins in a line of its own);
    outside it nothing is seen. Lines of views lie one after the other, `length` apart.
    """
    stripes, verticals = first_row.shape
    cells, thirds = shape
    lowest = np.min(first_row) // GRID_PX
    length = np.max(first_row) // GRID_PX - lowest + line + PIXELS
    views, begins, count = np.empty((stripes * verticals, 3), np.int64), np.empty((verticals, stripes), np.int64), 0
    for i in range(stripes):
        for v in range(verticals):
            part = first_row[i, v] % GRID_PX
            first = max(-((part - seen_rows[i, v, 0]) // GRID_PX), lowest)
            seen = max(min((seen_rows[i, v, 1] - part) // GRID_PX + 1, lowest + length) - first, 0)
            there = (looks[i, v] * GRID_PX + part) * cells * thirds + first
            known = 0
            while known < count and not (
                views[known, 0] == there and views[known, 1] == seen and views[known, 2] == first - lowest
            ):
                known += 1
            if known == count:
                views[count] = there, seen, first - lowest
                count += 1
            begins[v, i] = known * length + first_row[i, v] // GRID_PX - lowest
    return views[:count], begins.reshape(begins.size), length


@numba.njit(cache=True, nogil=True)
def _common_path(coarse, swing, looks, first_row, seen_rows, absent, largest_step, step_cost):  # type: ignore[no-untyped-def]
    """Return the best path through the sums of all stripes, cell by cell.

    coarse[look, row % GRID_PX, cell, row // GRID_PX] holds every third row, so that neighbouring displacements lie side by
    side; swing[v, k] is what displacements cost; stripe i of a groove with vertical displacement v and the first lateral one
    lies in row first_row[i, v], is seen in rows from seen_rows[i, v, 0] to seen_rows[i, v, 1], and looks like looks[i, v].
    """
    _, _, cells, thirds = coarse.shape
    verticals, laterals = swing.shape
    shape, stripes = (cells, verticals, laterals), len(first_row)
    line, sums, along, new = _room(shape, largest_step, coarse.dtype)
    usual = np.full((verticals + PIXELS // line + 1, line), -np.inf, coarse.dtype)
    usual[:verticals, :laterals] = -swing
    costs, ridges_, size = usual.reshape(usual.size), coarse.reshape(coarse.size), verticals * line
    views, begins, length = _views(looks, first_row, seen_rows, line, (cells, thirds))
    # out of sight a stripe adds nothing
    seen = np.zeros(len(views) * length, coarse.dtype)
    for cell in range(cells):
        begin = largest_step[1] + cell * size
        for k in range(len(views)):
            there, count, first = views[k]
            _write_above(ridges_, there + cell * thirds, absent, count, seen, k * length + first)
        for v in range(verticals):
            add_lines(costs, v * line, seen, begins, v * stripes, stripes, 1, sums, begin + v * line, line)
        if cell > 0:
            _go_on(sums, begin - size, line, size, largest_step, step_cost, along, new)
    return _way_back(sums, largest_step[1], shape, line, largest_step, step_cost)


@numba.njit(cache=True, nogil=True)
def _thin_out(ridge, coarse):  # type: ignore[no-untyped-def]
    """Write coarse[row % GRID_PX, cell, row // GRID_PX]: on a coarse grid a ridge is where any of three rows is."""
    cells, height = ridge.shape
    near = np.empty(height, np.float32)
    for cell in range(cells):
        row = ridge[cell]
        near[0], near[-1] = max(row[0], row[1]), max(row[-1], row[-2])
        _largest_of_three(row[:-2], row[1:-1], row[2:], near[1:-1])
        for part in range(GRID_PX):
            some = near[part::GRID_PX]
            coarse[part, cell, : some.size] = some
            coarse[part, cell, some.size :] = np.float32(0)


@numba.njit(cache=True, nogil=True)
def _largest_of_three(before, here, after, out):  # type: ignore[no-untyped-def]
    for j in range(out.size):
        out[j] = max(here[j], max(before[j], after[j]))


def _grid(low: float, high: float) -> IntArray:
    """Return the points of the coarse grid from low to high, 0 among them."""
    return GRID_PX * np.arange(min(int(low // GRID_PX) + 1, 0), max(int(high // GRID_PX), 0) + 1)


@dataclass(frozen=True)
class GrooveSearch:
    """The coarse search.

    Parameters
    ----------
    swing_px : float
        Largest displacement of the groove in the direction of its cut, if that is vertical or 45/45; a lateral cut may
        swing as far as the picture shows.
    drift_px : float
        Largest slow displacement in a direction that the cut does not use (warp, focus, an eccentric hole).
    step_cost : float
        For the square of one row from cell to cell, in units of a stripe's sharpness: keeps paths from jittering.
    wall_reach_px : float
        How far a single wall may run from the common path.
    absent : float
        Sharpness below which a stripe that should be seen speaks against a path.
    usual_swing_px, usual_drift_px, swing_cost : float
        Displacements of that size, in the direction of the cut and in another one, cost so much sharpness, and others as
        their squares: where one stripe alone is seen it is taken for the one that needs the smaller swing, and its
        motion for one in the direction of the cut.
    """

    swing_px: float = 120.0
    drift_px: float = 18.0
    step_cost: float = 0.02
    wall_reach_px: float = 8.0
    absent: float = 0.2
    usual_swing_px: float = 200.0
    usual_drift_px: float = 12.0
    swing_cost: float = 0.15

    def __post_init__(self) -> None:
        require(self.usual_swing_px > 0, f"a usual swing of {self.usual_swing_px} px", "above 0")
        require(self.usual_drift_px > 0, f"a usual drift of {self.usual_drift_px} px", "above 0")

    def find(self, sharp: Float32Array, layout: StripeLayout, *, cut: Cut) -> tuple[FloatArray, FloatArray]:
        """Return where both walls run.

        Parameters
        ----------
        sharp : float32 array, shape (cell, row)
            From `texture.sharpness`.
        layout : StripeLayout
        cut : {"lateral", "vertical", "stereo"}

        Returns
        -------
        displacement_px : float64 array, shape (2, cell)
            Of each wall.
        support : float64 array, shape (stripe, cell)
            Sharpness of the ridge found for each stripe; 0 where it cannot be seen.
        """
        ridge = ridges(sharp)
        lateral, vertical = self._common(sharp, ridge, layout, cut)
        common = np.array([lateral - vertical, lateral + vertical])
        return self._own_paths(ridge, layout, common)

    def _common(
        self, sharp: Float32Array, ridge: Float32Array, layout: StripeLayout, cut: Cut
    ) -> tuple[FloatArray, FloatArray]:
        """Return the lateral and the vertical displacement that suit all stripes, on a grid of `GRID_PX`."""
        cells, height = ridge.shape
        grid = _grid_of(self, layout, cut, height, cells > 1)
        coarse = np.empty((len(grid.halves), GRID_PX, cells, -(-height // GRID_PX)), np.float32)
        for look, half in enumerate(grid.halves):
            flanks = (half + FLANK_PX[0], half + FLANK_PX[1])
            _thin_out(ridges(sharp, half_px=half, flank_px=flanks) if half else ridge, coarse[look])
        path, _ = _common_path(
            coarse, grid.swing, grid.looks, grid.first_row, grid.seen_rows, np.float32(self.absent), *grid.steps
        )
        return grid.lateral_px[path[1]], grid.vertical_px[path[0]]

    def _own_paths(
        self, ridge: Float32Array, layout: StripeLayout, common: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Let each wall look for its stripes, row by row, near the common path; merged stripes lead nobody."""
        path, support = common.copy(), np.zeros((layout.wall.size, len(ridge)))
        depth = layout.from_bottom_px[:, None] - 0.5 * (common[OUTER] - common[INNER])
        alone = (depth < 0) | (depth >= MERGED_PX)
        limits = np.array([layout.first_row, layout.last_row])
        _own(ridge, layout.rest_row, layout.wall, limits, alone, int(self.wall_reach_px), self.step_cost, path, support)
        return path, support


@dataclass(frozen=True, eq=False)
class _Grid:
    """What the common search goes through.

    Attributes
    ----------
    lateral_px, vertical_px : float64 arrays, shape (lateral,), (vertical,)
        Displacements.
    swing : float32 array, shape (vertical, lateral)
        What they cost.
    halves : tuple of int
        Half widths of the ridges that are looked at; 0 for those of single stripes.
    looks, first_row, seen_rows : int64 arrays, shape (stripe, vertical), the last one (stripe, vertical, 2)
        See `_common_path`.
    steps : (int64 array, float64 array), shape (2,)
        Largest steps from cell to cell, vertical and lateral, and what they cost.
    """

    lateral_px: FloatArray
    vertical_px: FloatArray
    swing: Float32Array
    halves: tuple[int, ...]
    looks: IntArray
    first_row: IntArray
    seen_rows: IntArray
    steps: tuple[IntArray, FloatArray]


@lru_cache(maxsize=8)
def _grid_of(search: GrooveSearch, layout: StripeLayout, cut: Cut, height: int, several_cells: bool) -> _Grid:
    """Return the grid of a search, the same for all stretches of a passage."""
    reach = {
        "lateral": (np.inf, search.drift_px),
        "vertical": (search.drift_px, search.swing_px),
        "stereo": (search.swing_px, search.swing_px),
    }[cut]
    # further than this no stripe is seen
    low, high = (layout.first_row - layout.rest_row).min(), (layout.last_row - layout.rest_row).max()
    lateral = _grid(max(low - reach[1], -reach[0]), min(high + reach[1], reach[0]))
    vertical = _grid(-reach[1], reach[1])
    used = [cut != "vertical", cut != "lateral"]
    large = [search.usual_swing_px if use else search.usual_drift_px for use in used]
    swing = search.swing_cost * ((lateral / large[0]) ** 2 + (vertical[:, None] / large[1]) ** 2)
    depth = layout.from_bottom_px[:, None] - vertical
    merged = (depth >= 0) & (depth < MERGED_PX)
    rest = (
        np.rint(layout.rest_row).astype(np.int64)[:, None] + wall_sign(layout.wall).astype(np.int64)[:, None] * vertical
    )
    first_row = np.where(merged, int(np.rint(layout.middle_row)), rest) + lateral[0]
    half = np.where(merged, np.maximum(GRID_PX * np.rint(depth / GRID_PX), 2 * GRID_PX), 0).astype(np.int64)
    halves, looks = np.unique(half, return_inverse=True)
    on_wall = (merged | (depth > BOTTOM_PX)) & (depth < layout.half_width_px)
    rows = np.array([np.maximum(np.ceil(layout.first_row), 0), np.minimum(np.floor(layout.last_row), height - 1)])
    seen = np.where(on_wall[:, :, None], rows.T[:, None], [0, -1]).astype(np.int64)
    steps = np.array([1 if use else int(several_cells) for use in used])
    # what the cut does not use changes slowly: a step of one grid point costs as much as a cell without its stripes
    costs = np.array([search.step_cost * GRID_PX if use else 1.0 for use in used])
    return _Grid(
        lateral.astype(np.float64),
        vertical.astype(np.float64),
        swing.astype(np.float32),
        tuple(halves.tolist()),
        looks.reshape(half.shape),
        first_row,
        seen,
        (steps[::-1].copy(), costs[::-1].copy()),
    )


@numba.njit(cache=True, nogil=True)
def _ridge_at(ridge, cell, place, limits):  # type: ignore[no-untyped-def]
    """The ridge at a place; 0 out of sight."""
    row = int(np.rint(place))
    seen = limits[0] <= row <= limits[1]
    return ridge[cell, min(max(row, 0), ridge.shape[1] - 1)] if seen else np.float32(0)


@numba.njit(cache=True, nogil=True)
def _own(ridge, rest_row, wall, limits, alone, reach, step_cost, path, support):  # type: ignore[no-untyped-def]
    """Move the path of each wall to where its stripes are, and write how sharp they are there."""
    steps, costs = np.array([0, 3]), np.array([0.0, step_cost])
    score = np.empty((len(ridge), 1, 2 * reach + 1), ridge.dtype)
    for w in (INNER, OUTER):
        for cell in range(len(ridge)):
            for k in range(2 * reach + 1):
                aside = k - reach
                score[cell, 0, k] = -PULL * step_cost * aside * aside
                for i in range(wall.size):
                    if wall[i] == w and alone[i, cell]:
                        score[cell, 0, k] += _ridge_at(ridge, cell, rest_row[i] + path[w, cell] + aside, limits[:, i])
        path[w] += best_path(score, steps, costs)[0][1] - reach
        for i in range(wall.size):
            if wall[i] == w:
                for cell in range(len(ridge)):
                    for near in range(-2, 3):
                        seen = _ridge_at(ridge, cell, rest_row[i] + path[w, cell] + near, limits[:, i])
                        support[i, cell] = seen if near == -2 else max(support[i, cell], seen)


PULL = 0.3
"""A wall is held to the common path by so much of what steps from cell to cell cost."""
MERGED_PX = 16.0
"""Nearer to the middle of the groove than this, both stripes of a sharp plane are one: all between them is sharp."""
FLANK_PX = (5, 13)
"""Beside what is sharp, as far as `ridges` looks beside a stripe."""
GRID_PX = 3
"""Step of the common search; with ridges seven rows wide nothing is missed, and one step a cell is a slope of 0.37."""
