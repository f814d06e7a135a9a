"""One stretch of groove on its way through the reading: its picture, and where its walls are believed to run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from gramoscope.conventions import BoolArray, Float32Array, FloatArray, IntArray
from gramoscope.pickup.texture.tone import Tone

AS_IT_IS = Tone()


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch laid ready for reading.

    Attributes
    ----------
    columns : float32 array, shape (column, row)
        The registered picture, transposed.
    usable : bool array, shape (column,)
        Columns that rest on enough frames.
    burnt : int64 array, shape (place, 2)
        Column and row of each place at full scale.
    displacement_px : float64 array, shape (2, column)
        The present path of each wall.
    support : float64 array, shape (stripe, column)
        How sharp the coarse search found each stripe.
    tone : Tone
        In which the picture is seen: before it is interpolated, for bright grains ring less then.
    """

    columns: Float32Array
    usable: BoolArray
    burnt: IntArray
    displacement_px: FloatArray
    support: FloatArray
    tone: Tone = AS_IT_IS

    def in_tone(self, tone: Tone) -> Stretch:
        """Return the same stretch seen in a tone; only a picture that is as it was can be seen in another one."""
        if tone == self.tone or tone.compression == self.tone.compression == 0:
            return self
        assert self.tone.compression == 0
        return replace(self, columns=tone(self.columns), tone=tone)

    def moved(self, step_px: FloatArray) -> Stretch:
        """Return the same stretch with its paths moved, shape (2, column)."""
        return replace(self, displacement_px=self.displacement_px + step_px)


@numba.njit(cache=True, nogil=True)
def _brighter(column, level):  # type: ignore[no-untyped-def]
    count = 0
    for row in range(column.size):
        count += column[row] >= level
    return count


@numba.njit(cache=True, nogil=True)
def places_brighter(columns, level):  # type: ignore[no-untyped-def]
    """Return column and row of all points of a picture, [column, row], that reach a level, shape (place, 2)."""
    counts = np.empty(len(columns), np.int64)
    for x in range(len(columns)):
        counts[x] = _brighter(columns[x], level)
    places, n = np.empty((counts.sum(), 2), np.int64), 0
    for seen in np.flatnonzero(counts):
        for row in range(columns.shape[1]):
            if columns[seen, row] >= level:
                places[n, 0], places[n, 1] = seen, row
                n += 1
    return places
