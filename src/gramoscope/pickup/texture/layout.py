"""Where the stripes lie, and where each of them can be seen.

One model for all stripes: a stripe lies at its place at rest plus the displacement of its wall. A stripe that is sharp
through the glass can be seen in the glass's half of the picture only, one that is sharp beside it only in the other half;
when the groove swings far a stripe crosses the edge and is gone, and when it swings farther still the other wall's stripe
beside the glass comes in. So there are four stripes with a glass, of which seldom more than three are seen. A stripe also
ends where its wall does: when the groove rises, its bottom lifts the lowest stripes out of focus.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.conventions import INNER, OUTER, BoolArray, FloatArray, IntArray

BOTTOM_PX = 8.0
"""Nearer to the middle of the groove its rounded bottom leaves no wall to be sharp on."""


@dataclass(frozen=True, eq=False)
class StripeLayout:
    """The stripes of a bench.

    Attributes
    ----------
    rest_row : float64 array, shape (stripe,)
        Row of each stripe while its wall is not displaced.
    wall : int array, shape (stripe,)
        `INNER` or `OUTER`.
    first_row, last_row : float64 arrays, shape (stripe,)
        Outermost rows in which each stripe can be seen.
    middle_row : float
        Of the groove at rest.
    half_width_px : float
        Of the groove at the land.
    """

    rest_row: FloatArray
    wall: IntArray
    first_row: FloatArray
    last_row: FloatArray
    middle_row: float
    half_width_px: float

    @staticmethod
    def of_bench(bench: Bench, *, edge_margin_px: float) -> StripeLayout:
        """Return the layout that a manifest promises.

        Parameters
        ----------
        bench : Bench
        edge_margin_px : float
            Half of the zone along the glass edge in which no stripe is read.
        """
        stripes = _all_stripes(bench)
        height = bench.sensor.height_px
        limits = [_half(stripe, bench, edge_margin_px) for stripe in stripes]
        return StripeLayout(
            np.array([stripe.row for stripe in stripes]),
            np.array([stripe.wall for stripe in stripes]),
            np.array([max(low, 0.0) for low, _ in limits]),
            np.array([min(high, height - 1.0) for _, high in limits]),
            (stripes[-1].row + stripes[0].row) / 2,
            bench.disc.groove_width_m / 2 / bench.sensor.pixel_pitch_m,
        )

    @cached_property
    def from_bottom_px(self) -> FloatArray:
        """How far from the middle of the groove each stripe lies at rest, shape (stripe,)."""
        return np.where(self.wall == INNER, self.rest_row - self.middle_row, self.middle_row - self.rest_row)

    def of_wall(self, wall: int) -> StripeLayout:
        """Return the stripes of one wall."""
        mine = self.wall == wall
        return replace(
            self,
            rest_row=self.rest_row[mine],
            wall=self.wall[mine],
            first_row=self.first_row[mine],
            last_row=self.last_row[mine],
        )

    def at(self, rest_row: FloatArray) -> StripeLayout:
        """Return the same layout with other places at rest."""
        return replace(self, rest_row=rest_row)

    def rows(self, displacement_px: FloatArray) -> FloatArray:
        """Return where the stripes run.

        Parameters
        ----------
        displacement_px : float64 array, shape (2, place)
            Of the walls.

        Returns
        -------
        float64 array, shape (stripe, place)
        """
        return self.rest_row[:, None] + displacement_px[self.wall]

    def visible(self, rows: FloatArray, *, half_px: float) -> BoolArray:
        """Tell where windows of ± `half_px` rows about the stripes, shape (stripe, place), show their wall and nothing else.

        They must lie in the half of the picture that is sharp there, above the groove's rounded bottom, below the land.
        """
        seen = np.ones(rows.shape, np.bool_)
        _see(rows, self.middle_of(rows), self.wall, self.seen_between, self.on_wall_px(half_px), float(half_px), seen)
        return seen

    def middle_of(self, rows: FloatArray) -> FloatArray:
        """Return the row of the groove's middle, shape (place,): it moves as the walls do in the mean."""
        middle = np.empty(rows.shape[1])
        _follow_middle(rows, self.rest_row, self._tellers, self.middle_row, middle)
        return middle

    @cached_property
    def _tellers(self) -> IntArray:
        """One stripe of each wall that there is, which tells how it moves."""
        return np.concatenate([np.flatnonzero(self.wall == wall)[:1] for wall in (INNER, OUTER)])

    @cached_property
    def seen_between(self) -> FloatArray:
        """First and last row of each stripe, shape (2, stripe)."""
        return np.array([self.first_row, self.last_row])

    def on_wall_px(self, half_px: float) -> tuple[float, float]:
        """Return how near to the groove's middle, and how far from it, windows of ± `half_px` rows show a wall."""
        return BOTTOM_PX + half_px, self.half_width_px - half_px


@numba.njit(cache=True, nogil=True)
def _follow_middle(rows, rest_row, tellers, middle_row, middle):  # type: ignore[no-untyped-def]
    """Write where the middle of the groove runs, by the stripes that tell."""
    for x in range(middle.size):
        moved = 0.0
        for i in tellers:
            moved += rows[i, x] - rest_row[i]
        middle[x] = middle_row + moved / max(tellers.size, 1)


@numba.njit(cache=True, nogil=True)
def _see(rows, middle, wall, limits, from_middle, half_px, seen):  # type: ignore[no-untyped-def]
    """Take away what windows about stripes, [stripe, column], do not see whole, of a groove with its middle in some rows."""
    for i in range(rows.shape[0]):
        see_stripe(rows[i], middle, wall[i], limits[:, i], from_middle, half_px, seen[i])


@numba.njit(cache=True, nogil=True)
def see_stripe(row, middle, wall, limits, from_middle, half_px, seen):  # type: ignore[no-untyped-def]
    """Take away what windows about one stripe do not see whole."""
    side = 1.0 if wall == INNER else -1.0
    low, high = limits[0] + half_px, limits[1] - half_px
    for x in range(row.size):
        away = side * (row[x] - middle[x])
        inside = (row[x] >= low) & (row[x] <= high)
        seen[x] &= inside & (away >= from_middle[0]) & (away <= from_middle[1])


def _all_stripes(bench: Bench) -> tuple[Stripe, ...]:
    """Both walls in both sharp planes, by rising row."""
    stripes = bench.stripes()
    beside = [stripe for stripe in stripes if not stripe.through_glass]
    if bench.cover_glass is None or not beside:
        return stripes
    middle = sum(stripe.row for stripe in stripes if stripe.through_glass) / 2
    mirrored = Stripe(
        OUTER if beside[0].wall == INNER else INNER, beside[0].depth_below_land_m, 2 * middle - beside[0].row, False
    )
    return tuple(sorted((*stripes, mirrored), key=lambda stripe: stripe.row))


def _half(stripe: Stripe, bench: Bench, margin_px: float) -> tuple[float, float]:
    """First and last row in which a stripe can be sharp."""
    if bench.cover_glass is None:
        return -np.inf, np.inf
    low_half = (bench.cover_glass.side == "low") == stripe.through_glass
    edge = bench.glass_edge_row
    return (-np.inf, edge - margin_px) if low_half else (edge + margin_px, np.inf)


def wall_sign(wall: IntArray) -> FloatArray:
    """Return how a groove that rises moves the stripes of each wall: −1 for the inner wall, +1 for the outer one."""
    return np.where(np.asarray(wall) == INNER, -1.0, 1.0)
