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

import numba
import numpy as np
from scipy import ndimage

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.errors import require
from gramoscope.pickup.flow.derivatives import Derivatives

AVERAGE = np.array([[1, 2, 1], [2, 0, 2], [1, 2, 1]]) / 12
"""Horn and Schunck's average over the eight neighbours."""
CACHE_BYTES = 1 << 20
"""What most processors keep near each core."""
BYTES_A_POINT = 36
"""Nine numbers: both flows before and after a sweep, three derivatives, two gains."""


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow on every point of a picture: u along the columns and v along the rows, pixels a frame."""

    u: Float32Array
    v: Float32Array


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _sweep_row(u, v, y, ix, iy, it, gain_u, gain_v, share_u, share_v, side, lift, new_u, new_v):  # type: ignore[no-untyped-def]
    """One row of a sweep: means over the neighbours, `share` of them the average and `side` the vertical pair, put right.

    Indices are unsigned: one that may be negative keeps the loop from becoming vector instructions.
    """
    one, two, half = np.uintp(1), np.uintp(2), np.float32(0.5)
    along_u, along_v = share_u / np.float32(6), share_v / np.float32(6)
    corner_u, corner_v = share_u / np.float32(12), share_v / np.float32(12)
    down_u, up = along_u + side * half, side * lift
    n = np.uintp(y)
    h, s = n + one, n + two
    for x in range(ix.shape[1]):
        w = np.uintp(x)
        c, e = w + one, w + two
        corners_u = (u[n, w] + u[n, e]) + (u[s, w] + u[s, e])
        corners_v = (v[n, w] + v[n, e]) + (v[s, w] + v[s, e])
        mean_u = corner_u * corners_u + (down_u * (u[n, c] + u[s, c]) + (along_u * (u[h, w] + u[h, e]) + up))
        mean_v = corner_v * corners_v + along_v * ((v[n, c] + v[s, c]) + (v[h, w] + v[h, e]))
        error = ix[n, w] * mean_u + (iy[n, w] * mean_v + it[n, w])
        new_u[h, c] = mean_u - gain_u[n, w] * error
        new_v[h, c] = mean_v - gain_v[n, w] * error


@numba.njit(cache=True, nogil=True)
def _gain_row(ix, iy, a, b, gain_u, gain_v):  # type: ignore[no-untyped-def]
    """(I_x/a) / (1 + I_x²/a + I_y²/b) and the same for y: what does not change from sweep to sweep."""
    one = np.float32(1)
    for x in range(ix.size):
        p, q = ix[x] / a, iy[x] / b
        scale = one / (one + ix[x] * p + iy[x] * q)
        gain_u[x] = p * scale
        gain_v[x] = q * scale


@numba.njit(cache=True, nogil=True)
def _repeat_border(field, y):  # type: ignore[no-untyped-def]
    """Give row y of a picture, which has a border of one pixel in `field`, its neighbours beyond the picture."""
    row = field[y + 1]
    row[0], row[-1] = row[1], row[-2]
    if y == 0:
        field[0] = row
    if y == field.shape[0] - 3:
        field[-1] = row


@numba.njit(cache=True, nogil=True)
def _gains(ix, iy, a, b):  # type: ignore[no-untyped-def]
    gain_u, gain_v = np.empty_like(ix), np.empty_like(ix)
    for y in range(ix.shape[0]):
        _gain_row(ix[y], iy[y], a, b, gain_u[y], gain_v[y])
    return gain_u, gain_v


@numba.njit(cache=True, nogil=True)
def _sweeps(ix, iy, it, lift, alpha2, beta2, gamma2, iterations, depth, u, v, u_next, v_next):  # type: ignore[no-untyped-def]
    """All sweeps, `depth` of them at a time.

    A sweep may follow the one before it at a distance of one row: then all that it reads is done, and what it writes over
    has been read. So `depth` sweeps go down the picture together, over rows that the cache still holds. Each row is made
    from the same numbers as if one sweep waited for the other, and comes out the same to the last bit.
    """
    height = ix.shape[0]
    a, b = alpha2 + beta2, alpha2 + gamma2
    gain_u, gain_v = _gains(ix, iy, a, b)
    for done in range(0, iterations, depth):
        together = min(depth, iterations - done)
        for front in range(height + together - 1):
            for sweep in range(max(0, front - height + 1), min(together, front + 1)):
                y = front - sweep
                even = (done + sweep) % 2 == 0
                old_u, new_u = (u, u_next) if even else (u_next, u)
                old_v, new_v = (v, v_next) if even else (v_next, v)
                _sweep_row(
                    old_u,
                    old_v,
                    y,
                    ix,
                    iy,
                    it,
                    gain_u,
                    gain_v,
                    alpha2 / a,
                    alpha2 / b,
                    beta2 / a,
                    lift[y],
                    new_u,
                    new_v,
                )
                _repeat_border(new_u, y)
                _repeat_border(new_v, y)
    return (u, v) if iterations % 2 == 0 else (u_next, v_next)


def _depth(width: int) -> int:
    """How many sweeps go together: so many that their rows fill `CACHE_BYTES`."""
    return max(1, CACHE_BYTES // (BYTES_A_POINT * width))


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
    height, width = derivatives.x.shape
    u, v, u_next, v_next = (np.zeros((height + 2, width + 2), np.float32) for _ in range(4))
    u, v = _sweeps(
        derivatives.x, derivatives.y, derivatives.t, lift_of_shear(shear, height).astype(np.float32),
        np.float32(alpha**2), np.float32(beta**2), np.float32(gamma**2), iterations, _depth(width), u, v, u_next, v_next,
    )  # fmt: skip
    return Flow(u[1:-1, 1:-1], v[1:-1, 1:-1])


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
