"""Samples of both walls in a row, as they are read by the smoother of places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numba
import numpy as np

from gramoscope.cache_line import double_room
from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.quality import FlagArray
from gramoscope.tonearm.groove_prior import taylor
from gramoscope.tonearm.linear_gaussian import Readings


@dataclass(frozen=True, eq=False)
class PlaceSamples:
    """Samples of either wall.

    Attributes
    ----------
    arc_m : float64 array, shape (sample,)
    bin : int64 array, shape (sample,)
        Of the grid, nearest to each.
    wall : int64 array, shape (sample,)
    place_m : float64 array, shape (sample,)
        NaN where nothing was measured, or where the neighbouring stretch has the word.
    variance, gate_variance : float64 arrays, shape (sample,)
        By its share of the information, and as it was measured.
    suspect : bool array, shape (sample,)
    flags : uint16 array, shape (sample,)
    """

    arc_m: FloatArray
    bin: IntArray
    wall: IntArray
    place_m: FloatArray
    variance: FloatArray
    gate_variance: FloatArray
    suspect: BoolArray
    flags: FlagArray

    def part(self, keep: BoolArray | IntArray | slice) -> PlaceSamples:
        """Return some of the samples."""
        return PlaceSamples(
            self.arc_m[keep],
            self.bin[keep],
            self.wall[keep],
            self.place_m[keep],
            self.variance[keep],
            self.gate_variance[keep],
            self.suspect[keep],
            self.flags[keep],
        )

    def flagged(self, flags: FlagArray) -> PlaceSamples:
        """Return the same samples with other flags."""
        return replace(self, flags=flags.astype(np.uint16))

    def measured(self, first_bin: int, stop_bin: int) -> IntArray:
        """Return the numbers of the samples that say something of the bins from … to, in the order of the bins."""
        here = np.flatnonzero(np.isfinite(self.place_m) & (self.bin >= first_bin) & (self.bin < stop_bin))
        return here[np.argsort(self.bin[here], kind="stable")]

    def readings(self, *, first_bin: int, step_m: float, gains: FloatArray) -> Readings:
        """Return measured samples, in the order of their bins, as readings of the state of both directions.

        Parameters
        ----------
        first_bin : int
            The bin that the readings call 0.
        step_m : float
            Of the grid.
        gains : float64 array, shape (2,)
            How far the inner and the outer wall move towards +l when the groove rises by one.
        """
        h = _both_directions(taylor(self.arc_m / step_m - self.bin), gains[self.wall])
        return Readings(self.bin - first_bin, self.wall, h, self.place_m, self.variance, self.gate_variance)


@numba.njit(cache=True, nogil=True)
def _both_directions(row, gain):  # type: ignore[no-untyped-def]
    """Each row, and beside it the same times a gain."""
    size = row.shape[1]
    out = double_room(row.shape[0] * 2 * size).reshape(row.shape[0], 2 * size)
    for j in range(row.shape[0]):
        for i in range(size):
            out[j, i], out[j, size + i] = row[j, i], row[j, i] * gain[j]
    return out


def joined(pieces: Sequence[PlaceSamples]) -> PlaceSamples:
    """Return the samples of several pieces in a row."""
    return PlaceSamples(
        np.concatenate([piece.arc_m for piece in pieces]),
        np.concatenate([piece.bin for piece in pieces]),
        np.concatenate([piece.wall for piece in pieces]),
        np.concatenate([piece.place_m for piece in pieces]),
        np.concatenate([piece.variance for piece in pieces]),
        np.concatenate([piece.gate_variance for piece in pieces]),
        np.concatenate([piece.suspect for piece in pieces]),
        np.concatenate([piece.flags for piece in pieces]),
    )
