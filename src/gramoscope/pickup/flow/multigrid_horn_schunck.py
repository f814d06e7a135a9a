"""The flow of Horn and Schunck, with the groove-orientation constraint, solved until nothing changes.

The energy is that of `horn_schunck`, whose sweeps may stop long before its least value, at a flow that depends on their number.
Here it is minimised (`multigrid`). Differences are taken between the four nearest neighbours. Horn and Schunck's average counts
eight, 1/6 and 1/12 of each; for smooth flow that is the same as 1/3 of each of the four, which is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.horn_schunck import Flow, lift_of_shear
from gramoscope.pickup.flow.multigrid import FlowEquations, solve_flow


@dataclass(frozen=True)
class MultigridHornSchunck:
    """The least energy of Horn and Schunck, plain (β = γ = 0) or with the groove-orientation constraint.

    Parameters
    ----------
    alpha : float
        Weight of smoothness, in units of the derivatives.
    beta, gamma : float
        As in `GrooveHornSchunck`.
    rounds : int
        V-cycles; see `multigrid.solve_flow`.
    """

    alpha: float = 0.5
    beta: float = 0.5
    gamma: float = 0.5
    rounds: int = 4

    def __post_init__(self) -> None:
        require(self.alpha > 0, f"alpha is {self.alpha}", "a positive weight")
        require(self.rounds >= 1, f"{self.rounds} rounds", "at least one")
        require(self.beta >= 0 and self.gamma >= 0, f"beta {self.beta}, gamma {self.gamma}", "zero or more")

    def flow(self, derivatives: Derivatives, *, shear: FloatArray | None = None, start: Flow | None = None) -> Flow:
        """Return the flow.

        Parameters
        ----------
        derivatives : Derivatives
            Shape (row, column). NaN spreads everywhere: there must be none.
        shear : float64 array, shape (row,), optional
            g, pixels a frame for each pixel down the rows; zero if left out.
        start : Flow, optional
            Where to begin, such as the flow of the stretch before; zero if left out.

        Returns
        -------
        Flow
        """
        begin = None if start is None else (start.u, start.v)
        return Flow(*solve_flow(self.equations(derivatives, shear=shear), rounds=self.rounds, start=begin))

    def equations(self, derivatives: Derivatives, *, shear: FloatArray | None = None) -> FlowEquations:
        """Return what is solved."""
        ix, iy, it = derivatives.x, derivatives.y, derivatives.t
        rows, columns = ix.shape
        lift = lift_of_shear(shear, rows).astype(np.float32)[:, None]
        alpha2, beta2, gamma2 = (np.float32(weight**2) for weight in (self.alpha, self.beta, self.gamma))
        along, down = np.zeros((rows, columns + 1), np.float32), np.zeros((rows + 1, columns), np.float32)
        along[:, 1:-1] = 1
        down[1:-1] = 1
        smooth = alpha2 / 3
        weights = np.array([smooth, smooth + beta2 / 2, smooth, smooth], np.float32)
        return FlowEquations(
            np.stack([ix * ix, ix * iy, iy * iy + gamma2]),
            np.stack([beta2 * lift - ix * it, -iy * it]),
            along,
            down,
            weights,
        )
