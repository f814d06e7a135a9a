"""The flow of Horn and Schunck, plain and with the constraint that a groove imposes.

**Plain** (Horn and Schunck, Artificial Intelligence 17, 1981). The flow minimises

    ∫ (I_x u + I_y v + I_t)² + α² (|∇u|² + |∇v|²).

With ū the local average of u, each sweep of Jacobi's method sets

    u ← ū − I_x e / (α² + I_x² + I_y²),    v ← v̄ − I_y e / (α² + I_x² + I_y²),    e = I_x ū + I_y v̄ + I_t.

**With the groove-orientation constraint.** The paper (section 5.1) adds a constraint that "regulates the distribution of
horizontal optical flow along the vertical direction since it is known that one of the angles defining wall orientation is
45°", and prints no equation. Ours: the record turns as a rigid body past a lens at distance Z, so a point at depth q below
the focal plane moves with u = U (1 − q/Z), and across the groove v = 0. On a wall that stands at the angle φ the depth
changes by tan φ for each unit across the groove, hence down the rows

    ∂u/∂y = g(y) = ± U tan φ / Z        (− on the wall that falls with the row, + on the other, 0 where unknown).

The energy becomes

    ∫ (I_x u + I_y v + I_t)² + α² (|∇u|² + |∇v|²) + β² (∂u/∂y − g)² + γ² v².

On the grid, with the vertical neighbours carried along by g,  ũ(y) = ½ [u(y−1) + g(y−½) + u(y+1) − g(y+½)], every point
minimises  (I_x u + I_y v + I_t)² + α² [(u − ū)² + (v − v̄)²] + β² (u − ũ)² + γ² v²  (constant factors of the differences
are absorbed in α and β, as Horn and Schunck absorb theirs). Writing the quadratic priors together,

    a = α² + β²,   m = (α² ū + β² ũ)/a,      b = α² + γ²,   n = α² v̄ / b,

the minimum in closed form, and so the Jacobi sweep, is

    u ← m − (I_x/a) e / (1 + I_x²/a + I_y²/b),   v ← n − (I_y/b) e / (1 + I_x²/a + I_y²/b),   e = I_x m + I_y n + I_t,

which for β = γ = 0 is the plain sweep. β spreads what is known of u up and down a wall without spreading it along the
groove; γ says that texture does not wander across the groove.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.errors import require
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.sweep_lanes import ROW, rows_of_strips, sweep_picture
from gramoscope.pickup.picture_room import picture_room

AVERAGE = np.array([[1, 2, 1], [2, 0, 2], [1, 2, 1]]) / 12
"""Horn and Schunck's average over the eight neighbours."""
TOGETHER = 21
"""So many sweeps go over a picture together: what is on the way then stays in the second cache, up to 1280 columns or so."""


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow on every point of a picture: u along the columns and v along the rows, pixels a frame."""

    u: Float32Array
    v: Float32Array


def lift_of_shear(shear: FloatArray | None, height: int) -> FloatArray:
    """Return ½ [g(y−½) − g(y+½)] for every row: what carrying the two vertical neighbours along g adds to their mean.

    Beyond the border the neighbour repeats the border itself, and g is zero there. Without a shear all are zero.
    """
    if shear is None:
        return np.zeros(height)
    between = np.concatenate([[0.0], (shear[1:] + shear[:-1]) / 2, [0.0]])
    return np.asarray((between[:-1] - between[1:]) / 2)


def solve_horn_schunck(
    derivatives: Derivatives,
    *,
    alpha: float,
    iterations: int,
    beta: float = 0.0,
    gamma: float = 0.0,
    shear: FloatArray | None = None,
) -> Flow:
    """Return the flow after some sweeps from zero (see the module's docstring for the equations).

    Parameters
    ----------
    derivatives : Derivatives
        Shape (row, column). NaN spreads to the whole neighbourhood: there must be none.
    alpha : float
        Weight of smoothness, same unit as the spatial derivatives, positive.
    iterations : int
        Jacobi sweeps.
    beta, gamma : float
        Weights of the groove-orientation constraint; 0 for the plain flow.
    shear : float64 array, shape (row,), optional
        g, pixels a frame for each pixel down the rows; zero if left out.

    Returns
    -------
    Flow
    """
    shape = derivatives.x.shape
    u, v = np.empty(shape, np.float32), np.empty(shape, np.float32)
    sweep_picture(
        derivatives.x, derivatives.y, derivatives.t, lift_of_shear(shear, shape[0]).astype(np.float32), np.float32(alpha**2),
        np.float32(beta**2), np.float32(gamma**2), iterations, TOGETHER, picture_room(rows_of_strips(*shape), ROW), u, v,
    )  # fmt: skip
    return Flow(u, v)


def solve_horn_schunck_reference(
    derivatives: Derivatives,
    *,
    alpha: float,
    iterations: int,
    beta: float = 0.0,
    gamma: float = 0.0,
    shear: FloatArray | None = None,
) -> Flow:
    """Return the same as `solve_horn_schunck`, in NumPy and double precision: slow, and meant to be read."""
    ix, iy, it = (np.asarray(d, np.float64) for d in (derivatives.x, derivatives.y, derivatives.t))
    lift = lift_of_shear(shear, ix.shape[0])[:, None]
    a, b = alpha**2 + beta**2, alpha**2 + gamma**2
    u, v = np.zeros_like(ix), np.zeros_like(ix)
    for _ in range(iterations):
        rows = np.pad(u, ((1, 1), (0, 0)), mode="edge")
        carried = (rows[:-2] + rows[2:]) / 2 + lift
        m = (alpha**2 * ndimage.correlate(u, AVERAGE, mode="nearest") + beta**2 * carried) / a
        n = alpha**2 * ndimage.correlate(v, AVERAGE, mode="nearest") / b
        e = (ix * m + iy * n + it) / (1 + ix**2 / a + iy**2 / b)
        u, v = m - ix / a * e, n - iy / b * e
    return Flow(u.astype(np.float32), v.astype(np.float32))


@dataclass(frozen=True)
class HornSchunck:
    """The plain flow of Horn and Schunck.

    Parameters
    ----------
    alpha : float
        Weight of smoothness, in units of the derivatives.
    iterations : int
        Jacobi sweeps.
    """

    alpha: float = 0.5
    iterations: int = 100

    def __post_init__(self) -> None:
        require(self.alpha > 0, f"alpha is {self.alpha}", "a positive weight")
        require(self.iterations >= 1, f"{self.iterations} sweeps", "at least one")

    def flow(self, derivatives: Derivatives, *, shear: FloatArray | None = None) -> Flow:
        """Return the flow; `shear` is of no use to the plain method."""
        return solve_horn_schunck(derivatives, alpha=self.alpha, iterations=self.iterations)


@dataclass(frozen=True)
class GrooveHornSchunck:
    """The flow of Horn and Schunck under the groove-orientation constraint.

    Parameters
    ----------
    alpha, iterations
        As in `HornSchunck`.
    beta : float
        How firmly the flow along the groove follows the walls' shear down the rows, in units of the derivatives.
    gamma : float
        How firmly flow across the groove is held to zero.
    """

    alpha: float = 0.5
    iterations: int = 100
    beta: float = 0.5
    gamma: float = 0.5

    def __post_init__(self) -> None:
        require(self.alpha > 0, f"alpha is {self.alpha}", "a positive weight")
        require(self.iterations >= 1, f"{self.iterations} sweeps", "at least one")
        require(self.beta >= 0 and self.gamma >= 0, f"beta {self.beta}, gamma {self.gamma}", "zero or more")

    def flow(self, derivatives: Derivatives, *, shear: FloatArray | None = None) -> Flow:
        """Return the flow, for a given shear of the walls (pixels a frame for each pixel down the rows)."""
        return solve_horn_schunck(
            derivatives, alpha=self.alpha, iterations=self.iterations, beta=self.beta, gamma=self.gamma, shear=shear
        )
