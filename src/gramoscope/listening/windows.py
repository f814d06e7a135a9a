"""Looking at sound that streams by: overlapping windows of it, and sums over the blocks of time that they lie in.

What is learned from a passage is only worth what its parts say alike: sums are kept block by block, so that the scatter from
block to block gives the error. Memory does not grow: when blocks become too many, neighbours are joined.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import Audio

MOST_MISSING = 0.25
"""A window of which a larger share was not measured says nothing."""


@dataclass
class Windows:
    """Cuts a stream of sound into windows; they do not depend on how the stream is cut.

    Parameters
    ----------
    length, hop : int
        Samples of a window, and from the start of one to the start of the next; 0 < hop ≤ length.
    """

    length: int
    hop: int
    _rest: FloatArray = field(default_factory=lambda: np.empty((2, 0)))

    def of(self, piece: Audio) -> Iterator[FloatArray]:
        """Yield the windows that a piece completes; those that were not measured, or are silent, are left out."""
        missing = (piece.flags & np.uint16(NOT_MEASURED)) != 0
        here = np.concatenate([self._rest, [piece.samples, missing]], axis=1)
        starts = range(0, here.shape[1] - self.length + 1, self.hop)
        self._rest = here[:, len(starts) * self.hop :].copy()
        for start in starts:
            samples, unseen = here[:, start : start + self.length]
            if unseen.mean() <= MOST_MISSING and samples.any():
                yield samples


@dataclass
class TimeBlocks:
    """Sums over blocks of time.

    Parameters
    ----------
    most : int
        Blocks that are kept, even.
    """

    most: int
    per_block: int = 1
    _sums: list[FloatArray] = field(default_factory=list)
    _counts: list[int] = field(default_factory=list)

    def add(self, values: FloatArray) -> None:
        """Take in the values of the next window."""
        if self._counts and self._counts[-1] < self.per_block:
            self._sums[-1] = self._sums[-1] + values
            self._counts[-1] += 1
            return
        if len(self._sums) == self.most:
            self._sums = [a + b for a, b in zip(self._sums[::2], self._sums[1::2], strict=True)]
            self._counts = [a + b for a, b in zip(self._counts[::2], self._counts[1::2], strict=True)]
            self.per_block *= 2
        self._sums.append(values)
        self._counts.append(1)

    @property
    def count(self) -> int:
        """How many windows were taken in."""
        return sum(self._counts)

    def sums(self) -> FloatArray:
        """Return the sum of each block, shape (block, ...)."""
        return np.array(self._sums)

    def without_neighbours(self) -> FloatArray:
        """Return the mean of all windows but those of a block and the next, for each such pair and for both ends.

        Returns
        -------
        float64 array, shape (block + 1, ...)
            Each block is left out in two of them.
        """
        sums, counts = self.sums(), np.array(self._counts, np.float64)
        edge = np.zeros_like(sums[:1])
        left_out = np.concatenate([edge, sums]) + np.concatenate([sums, edge])
        rest = counts.sum() - np.concatenate([[0], counts]) - np.concatenate([counts, [0]])
        return np.asarray((sums.sum(axis=0) - left_out) / rest.reshape(-1, *[1] * (sums.ndim - 1)), np.float64)


def jackknife_sigma(without_neighbours: FloatArray) -> float:
    """Return the standard error of an estimate, by what it is without each two neighbouring blocks.

    σ² = (g − 1)/g · ½ Σ (θ_k − θ̄)² with g = blocks/2: the jackknife over pairs that overlap, so that what two neighbours share
    is counted (Künsch, 1989). NaN for fewer than three blocks.
    """
    pairs = (without_neighbours.size - 1) / 2
    if pairs <= 1:
        return float("nan")
    square = float(np.sum((without_neighbours - without_neighbours.mean()) ** 2))
    return float(np.sqrt((pairs - 1) / pairs * square / 2))
