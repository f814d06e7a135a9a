"""Stretches side by side: what is asked of many of them at once, and what goes to eight filters abreast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numba
import numpy as np

from gramoscope.cache_line import double_room
from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.errors import require
from gramoscope.quality import FlagArray
from gramoscope.tonearm.abreast import FILTERS
from gramoscope.tonearm.place_samples import PlaceSamples
from gramoscope.tonearm.stretches import Stretch
from gramoscope.tonearm.walls_abreast import ALLOWED, GATE_VARIANCE, READINGS, VALUE, VARIANCE

LEAST_SHARE = 1e-3
"""Samples that keep less of their information are left out."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Stretches on one grid, the shorter ones filled up with samples that nobody measured.

    Attributes
    ----------
    step_m : float
        Of the grid, and from one sample to the next.
    arc_start_m : float64 array, shape (stretch,)
    first_bin, size : int64 arrays, shape (stretch,)
        Bin nearest to the first sample, and how many samples there are: one for each bin.
    place_m, variance, share : float64 arrays, shape (stretch, 2, sample)
        See `Stretch`.
    suspect : bool array, shape (stretch, 2, sample)
    flags : uint16 array, shape (stretch, 2, sample)
    correlation_samples : float64 array, shape (stretch,)
    level : float64 array, shape (stretch, 2)
        How loud each is, lateral and vertical (`tonearm.level`).
    """

    step_m: float
    arc_start_m: FloatArray
    first_bin: IntArray
    size: IntArray
    place_m: FloatArray
    variance: FloatArray
    share: FloatArray
    suspect: BoolArray
    flags: FlagArray
    correlation_samples: FloatArray
    level: FloatArray

    @property
    def fraction(self) -> FloatArray:
        """How far beside its bin each sample lies, −½ … ½ of a step, shape (stretch,)."""
        return self.arc_start_m / self.step_m - self.first_bin

    def put_right(self, error: float) -> Batch:
        """Return the batch with errors that are so many times as large as it claims."""
        return replace(self, variance=error**2 * self.variance)

    @property
    def trusted_m(self) -> FloatArray:
        """Places of the samples that are not suspect, NaN elsewhere."""
        return np.where(self.suspect, np.nan, self.place_m)

    def samples(self) -> list[PlaceSamples]:
        """Return the samples of each stretch, both walls in turn."""
        arc = self.arc_start_m[:, None] + np.arange(self.place_m.shape[2]) * self.step_m
        bins = self.first_bin[:, None] + np.arange(self.place_m.shape[2])
        kept = np.maximum(self.share, LEAST_SHARE)
        weighed = self.variance * self.correlation_samples[:, None, None] / kept
        whole = PlaceSamples(
            _in_turn(np.stack([arc, arc], axis=1)),
            _in_turn(np.stack([bins, bins], axis=1)),
            _in_turn(np.broadcast_to(np.arange(2)[:, None], self.place_m.shape)),
            _in_turn(np.where(self.share > LEAST_SHARE, self.place_m, np.nan)),
            _in_turn(weighed),
            _in_turn(self.variance),
            _in_turn(self.suspect),
            _in_turn(self.flags),
        )
        length = 2 * self.place_m.shape[2]
        return [whole.part(slice(i * length, i * length + 2 * size)) for i, size in enumerate(self.size.tolist())]

    def readings(self) -> FloatArray:
        """Return what eight filters abreast read, shape (eight, bin, `walls_abreast.READINGS`, `FILTERS`)."""
        eights = -(-self.size.size // FILTERS)
        shape = (eights, self.place_m.shape[2], READINGS, FILTERS)
        out: FloatArray = double_room(int(np.prod(shape))).reshape(shape)
        _readings(self.place_m, self.variance, self.share, self.suspect, self.correlation_samples, out)
        return out


def _in_turn(values: np.ndarray) -> np.ndarray:
    return values.swapaxes(1, 2).reshape(-1)


@numba.njit(cache=True, nogil=True)
def _readings(place_m, variance, share, suspect, correlation_samples, out):  # type: ignore[no-untyped-def]
    out[:, :, VALUE : VALUE + 2] = 0.0
    out[:, :, VARIANCE : VARIANCE + 2] = np.inf
    out[:, :, GATE_VARIANCE : GATE_VARIANCE + 2] = 1.0
    out[:, :, ALLOWED : ALLOWED + 2] = 0.0
    for i in range(len(place_m)):
        eight, lane = i // FILTERS, i % FILTERS
        for wall in range(2):
            for k in range(place_m.shape[2]):
                mine = share[i, wall, k]
                if mine > LEAST_SHARE and np.isfinite(place_m[i, wall, k]):
                    out[eight, k, VALUE + wall, lane] = place_m[i, wall, k]
                    out[eight, k, VARIANCE + wall, lane] = variance[i, wall, k] * correlation_samples[i] / mine
                    out[eight, k, GATE_VARIANCE + wall, lane] = variance[i, wall, k]
                    out[eight, k, ALLOWED + wall, lane] = 0.0 if suspect[i, wall, k] else 1.0


def batch_of(stretches: Sequence[tuple[Stretch, FloatArray]], step_m: float) -> Batch:
    """Return stretches side by side, given each with its level in both directions.

    Raises
    ------
    ArgumentError
        If the samples of a stretch are not as far from each other as the grid's.
    """
    for stretch, _ in stretches:
        require(
            abs(stretch.step_m - step_m) < 1e-9 * step_m,
            f"a stretch with a sample every {stretch.step_m * 1e6:g} µm",
            f"one every {step_m * 1e6:g} µm, as before",
        )
    size = np.array([stretch.arc_m.size for stretch, _ in stretches])
    start = np.array([stretch.arc_m[0] for stretch, _ in stretches])
    shape = (len(stretches), 2, int(size.max()))
    place, variance, share = np.full(shape, np.nan), np.full(shape, np.nan), np.ones(shape)
    suspect, flags = np.zeros(shape, np.bool_), np.zeros(shape, np.uint16)
    for i, (stretch, _) in enumerate(stretches):
        for all_, mine in (
            (place, stretch.place_m),
            (variance, stretch.variance),
            (share, stretch.share),
            (suspect, stretch.suspect),
            (flags, stretch.flags),
        ):
            all_[i, :, : size[i]] = mine
    return Batch(
        step_m,
        start,
        np.rint(start / step_m).astype(np.int64),
        size,
        place,
        variance,
        share,
        suspect,
        flags,
        np.array([stretch.correlation_samples for stretch, _ in stretches]),
        np.array([level for _, level in stretches]),
    )
