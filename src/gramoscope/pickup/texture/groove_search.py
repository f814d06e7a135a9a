"""The coarse search: roughly where the groove runs through one stretch, by all its stripes together.

For every cell of columns and every displacement of the groove, lateral and vertical, the ridges at the places where the
model puts the stripes are added up; a stripe that the model puts out of sight adds nothing. The best path through these
sums, with steps from cell to cell no steeper than a groove can be, is found by Viterbi's algorithm, which needs no start
and is not led astray by a scratch, a chipped wall or a stripe that vanishes for a while. Then each wall looks for its own
path near the common one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import INNER, OUTER, Float32Array, FloatArray, IntArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.texture.layout import BOTTOM_PX, StripeLayout, wall_sign
from gramoscope.pickup.texture.sharpness import ridges


@numba.njit(cache=True, nogil=True)
def _raise(from_, cost, top):  # type: ignore[no-untyped-def]
    for j in range(top.size):
        top[j] = max(top[j], from_[j] - cost)


@numba.njit(cache=True, nogil=True)
def _add(values, total):  # type: ignore[no-untyped-def]
    for j in range(total.size):
        total[j] += values[j]


@numba.njit(cache=True, nogil=True)
def best_path(score, largest_step, step_cost):  # type: ignore[no-untyped-def]
    """Return the path through score[cell, i, j] with the largest sum, and that sum (A. Viterbi, 1967).

    Quickest where the last axis is the long one. Scores are overwritten by the largest sums of paths that end there: what
    came before a place is found again on the way back.
    From cell to cell i and j change by at most `largest_step[0]` and `[1]`, each at a cost of its `step_cost` times the
    square of the change; as these add up, the best step in j is found first and that in i after it.
    """
    cells, rows, columns = score.shape
    reach_i, reach_j = largest_step[0], largest_step[1]
    real = score.dtype.type
    along, new = np.empty((rows, columns), score.dtype), np.empty(columns, score.dtype)
    for cell in range(1, cells):
        for i in range(rows):
            along[i] = score[cell - 1, i]
            for step in range(1, reach_j + 1):
                cost = real(step_cost[1] * step * step)
                _raise(score[cell - 1, i, step:], cost, along[i, : columns - step])
                _raise(score[cell - 1, i, : columns - step], cost, along[i, step:])
        for i in range(rows):
            new[:] = along[i]
            for step in range(1, reach_i + 1):
                cost = real(step_cost[0] * step * step)
                if i + step < rows:
                    _raise(along[i + step], cost, new)
                if i - step >= 0:
                    _raise(along[i - step], cost, new)
            _add(new, score[cell, i])
    path = np.empty((2, cells), np.int64)
    end = np.argmax(score[cells - 1])
    i, j = end // columns, end % columns
    total = score[cells - 1, i, j]
    path[0, -1], path[1, -1] = i, j
    for cell in range(cells - 1, 0, -1):
        best, from_i, from_j = -np.inf, i, j
        for m in range(max(0, i - reach_i), min(rows, i + reach_i + 1)):
            for n in range(max(0, j - reach_j), min(columns, j + reach_j + 1)):
                value = score[cell - 1, m, n] - step_cost[0] * (m - i) ** 2 - step_cost[1] * (n - j) ** 2
                if value > best:
                    best, from_i, from_j = value, m, n
        i, j = from_i, from_j
        path[0, cell - 1], path[1, cell - 1] = i, j
    return path, total


@numba.njit(cache=True, nogil=True)
def _add_above(values, level, total):  # type: ignore[no-untyped-def]
    for k in range(total.size):
        total[k] += values[k] - level


@numba.njit(cache=True, nogil=True)
def _add_stripe(coarse, first_row, seen_rows, absent, score):  # type: ignore[no-untyped-def]
    """Add a stripe to the scores of displacements whose first one puts it into `first_row`, for each vertical one.

    coarse[row % GRID_PX, cell] holds every third row, so that neighbouring displacements lie side by side.
    """
    cells, verticals, laterals = score.shape
    for v in range(verticals):
        low, high = seen_rows[v]
        start = max(0, -((first_row[v] - low) // GRID_PX))
        stop = min(laterals, (high - first_row[v]) // GRID_PX + 1)
        if stop <= start:
            continue
        row = first_row[v] + GRID_PX * start
        at = row // GRID_PX
        for cell in range(cells):
            _add_above(coarse[row % GRID_PX, cell, at : at + stop - start], absent, score[cell, v, start:stop])


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
        lateral, vertical = self._common(ridge, layout, cut)
        common = np.array([lateral - vertical, lateral + vertical])
        return self._own_paths(ridge, layout, common)

    def _common(self, ridge: Float32Array, layout: StripeLayout, cut: Cut) -> tuple[FloatArray, FloatArray]:
        """Return the lateral and the vertical displacement that suit all stripes, on a grid of `GRID_PX`."""
        height = ridge.shape[1]
        reach = {
            "lateral": (np.inf, self.drift_px),
            "vertical": (self.drift_px, self.swing_px),
            "stereo": (self.swing_px, self.swing_px),
        }[cut]
        # further than this no stripe is seen
        low, high = (layout.first_row - layout.rest_row).min(), (layout.last_row - layout.rest_row).max()
        lateral = _grid(max(low - reach[1], -reach[0]), min(high + reach[1], reach[0]))
        vertical = _grid(-reach[1], reach[1])
        coarse = np.zeros((GRID_PX, len(ridge), -(-height // GRID_PX)), np.float32)
        _thin_out(ridge, coarse)
        used = [cut != "vertical", cut != "lateral"]
        large = [self.usual_swing_px if use else self.usual_drift_px for use in used]
        usual = (lateral / large[0]) ** 2 + (vertical[:, None] / large[1]) ** 2
        score = np.empty((len(ridge), *usual.shape), np.float32)
        score[:] = (-self.swing_cost * usual).astype(np.float32)  # once, not for every cell
        signs = wall_sign(layout.wall).astype(np.int64)
        stripes = zip(layout.rest_row, signs, layout.first_row, layout.last_row, layout.from_bottom_px, strict=True)
        for rest, sign, low, high, from_bottom in stripes:
            first_row = round(rest) + lateral[0] + sign * vertical
            depth = from_bottom - vertical
            on_wall = (depth > BOTTOM_PX) & (depth < layout.half_width_px)
            rows = np.array([max(np.ceil(low), 0), min(np.floor(high), height - 1)])
            seen = np.where(on_wall[:, None], rows, [0, -1]).astype(np.int64)
            _add_stripe(coarse, first_row, seen, np.float32(self.absent), score)
        steps = np.array([1 if use else int(len(ridge) > 1) for use in used])
        # what the cut does not use changes slowly: a step of one grid point costs as much as a cell without its stripes
        costs = np.array([self.step_cost * GRID_PX if use else 1.0 for use in used])
        path, _ = best_path(score, steps[::-1], costs[::-1])
        return lateral[path[1]].astype(np.float64), vertical[path[0]].astype(np.float64)

    def _own_paths(
        self, ridge: Float32Array, layout: StripeLayout, common: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Let each wall look for its stripes, row by row, near the common path."""
        path = common.copy()
        aside = np.arange(-int(self.wall_reach_px), int(self.wall_reach_px) + 1)
        for wall in (INNER, OUTER):
            found = _ridges_at(ridge, layout.of_wall(wall), common[wall][:, None] + aside)
            pull = -0.3 * self.step_cost * aside.astype(np.float64) ** 2
            steps, costs = np.array([0, 3]), np.array([0.0, self.step_cost])
            own, _ = best_path((found.sum(axis=0) + pull)[:, None, :], steps, costs)
            path[wall] += aside[own[1]]
        near = np.arange(-2, 3)
        support = np.zeros((layout.wall.size, len(ridge)))
        for wall in (INNER, OUTER):
            mine = layout.wall == wall
            support[mine] = _ridges_at(ridge, layout.of_wall(wall), path[wall][:, None] + near).max(axis=2)
        return path, support


def _ridges_at(ridge: Float32Array, layout: StripeLayout, displacement_px: FloatArray) -> FloatArray:
    """Return the ridges, shape (stripe, cell, place), at displacements of shape (cell, place); 0 out of sight."""
    rows = np.round(layout.rest_row[:, None, None] + displacement_px).astype(np.int64)
    seen = (rows >= layout.first_row[:, None, None]) & (rows <= layout.last_row[:, None, None])
    values = ridge[np.arange(len(ridge))[:, None], np.clip(rows, 0, ridge.shape[1] - 1)]
    return np.where(seen, values, 0.0)


GRID_PX = 3
"""Step of the common search; with ridges seven rows wide nothing is missed, and one step a cell is a slope of 0.37."""
