"""Linear least squares over a stream, in bounded memory, with errors that hold when neighbours share theirs.

The sums A = XᵀX and Xᵀy are kept block by block. They give the fit, b = A⁻¹ Xᵀy, and what a window of neighbouring blocks
pulls it by, g_w = (Xᵀy)_w − A_w b. If errors farther apart than a window have nothing to do with each other, whatever they do
within, the covariance is

    A⁻¹ (1/L Σ_w h_w h_wᵀ) A⁻¹,      h_w = (1 − A_w A⁻¹)⁻¹ g_w

over all windows of L = 3 blocks, overlapping (Newey and West, 1987), each as it would pull a fit that had not followed it
(the jackknife, which is right where few blocks must tell much). When blocks become too many, neighbours are joined.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gramoscope.conventions import FloatArray, IntArray

WINDOW = 3
"""So many neighbouring blocks share errors."""


@dataclass
class BlockedFit:
    """Sums of a least-squares fit, block by block.

    Parameters
    ----------
    parameters : int
    block_width : float
        A block is so much of the `place` that rows lie at; doubled each time that there are too many.
    most_blocks : int
    """

    parameters: int
    block_width: float
    most_blocks: int = 256
    _sums: dict[int, FloatArray] = field(default_factory=dict)

    def add(self, place: float, rows: FloatArray, values: FloatArray) -> None:
        """Take in equations rows · b = values, all in one block.

        Parameters
        ----------
        place : float
            Which block; errors at distant places are independent.
        rows : float64 array, shape (equation, parameter)
            Finite.
        values : float64 array, shape (equation,)
            Finite.
        """
        block = int(np.floor(place / self.block_width))
        sums = rows.T @ np.column_stack([rows, values])
        self._sums[block] = self._sums[block] + sums if block in self._sums else sums
        while len(self._sums) > self.most_blocks:
            self._join_neighbours()

    @property
    def blocks(self) -> int:
        """How many blocks hold something."""
        return len(self._sums)

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """Return the parameters and their covariance; NaN for parameters of which no row speaks, and where too few blocks do.

        Returns
        -------
        float64 arrays, shapes (parameter,), (parameter, parameter)
        """
        b, covariance = np.full(self.parameters, np.nan), np.full((self.parameters, self.parameters), np.nan)
        if not self._sums:
            return b, covariance
        order = np.array(sorted(self._sums))
        sums = np.array([self._sums[block] for block in order])
        spoken = np.flatnonzero(np.einsum("kii->i", sums[:, :, :-1]))
        xx, xy = sums[:, spoken[:, None], spoken], sums[:, spoken, -1]
        if self.blocks <= spoken.size + WINDOW or np.linalg.cond(xx.sum(axis=0)) > 1e14:
            return b, covariance
        inverse = np.linalg.inv(xx.sum(axis=0))
        found = inverse @ xy.sum(axis=0)
        b[spoken] = found
        pulls = _window_pulls(order, xx, xy - xx @ found, inverse)
        covariance[np.ix_(spoken, spoken)] = inverse @ (pulls.T @ pulls) @ inverse / WINDOW
        return b, covariance

    def _join_neighbours(self) -> None:
        joined: dict[int, FloatArray] = {}
        for block, sums in self._sums.items():
            joined[block // 2] = joined[block // 2] + sums if block // 2 in joined else sums
        self._sums, self.block_width = joined, 2 * self.block_width


def _window_pulls(order: IntArray, xx: FloatArray, pulls: FloatArray, inverse: FloatArray) -> FloatArray:
    """What the windows of neighbouring blocks would pull the fit by if it had not followed them; shape (window, parameter)."""
    starts = np.unique(order[:, None] - np.arange(WINDOW))
    inside = ((order >= starts[:, None]) & (order < starts[:, None] + WINDOW)).astype(np.float64)
    leverage = np.einsum("wk,kij->wij", inside, xx) @ inverse
    return np.asarray(np.linalg.solve(np.eye(xx.shape[1]) - leverage, (inside @ pulls)[:, :, None])[:, :, 0])
