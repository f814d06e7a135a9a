"""The equations of a smooth flow, solved in a few rounds over grids of every size.

A flow minimises, over the cells of a grid and the edges between neighbours,

    Σ_cells (xx u² + 2 xy u v + yy v² − 2 f u − 2 h v)  +  Σ_edges k [a_u (u − u′)² + a_v (v − v′)²],

with a weight k for each edge and, for each component, one weight a along the rows and one down the columns. With k = α², a = 1
and the motion tensor of single pixels this is the energy of Horn and Schunck, differences taken between the four nearest.

Jacobi's method moves what is known by one cell a sweep, and needs hundreds. Here each round (a V-cycle; A. Brandt, Mathematics
of Computation 31, 1977; for flow D. Terzopoulos, IEEE PAMI 8, 1986, and A. Bruhn et al., IJCV 70, 2006) takes the short waves
of the error out by a few Jacobi sweeps, and leaves the long ones to a grid of half the size, which does the same; one cell is
solved exactly. Sweeps solve the two unknowns of a cell together; their lengths are the inverse zeros of Chebyshev's polynomial
over the quarter … whole of the spectrum that the coarse grid cannot see, 0.5 … 2. No point comes before another, so what is
turned or mirrored is solved alike.

On the coarse grid four cells' sums are added up. An edge there replaces two, over twice the distance: half their sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from gramoscope.conventions import Float32Array, FloatArray

SPECTRUM = (0.5, 2.0)
"""Eigenvalues of D⁻¹A that belong to waves too short for the coarse grid, for equal weights."""


@dataclass(frozen=True, eq=False)
class FlowEquations:
    """The equations on one grid.

    Attributes
    ----------
    tensor : float32 array, shape (3, row, column)
        xx, xy, yy of every cell: positive semidefinite.
    right : float32 array, shape (2, row, column)
        f and h.
    along : float32 array, shape (row, column + 1)
        k between a cell and the one at its left; 0 beyond the borders.
    down : float32 array, shape (row + 1, column)
        k between a cell and the one above it; 0 beyond the borders.
    weights : float32 array, shape (4,)
        a of u along and down, of v along and down.
    """

    tensor: Float32Array
    right: Float32Array
    along: Float32Array
    down: Float32Array
    weights: Float32Array


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _relax_row(  # type: ignore[no-untyped-def]
    un, uw, u, ue, us, vn, vw, v, ve, vs, kw, ke, kn, ks, xx, xy, yy, f, h, weights, length, u_new, v_new
):
    ua, ud, va, vd = weights[0], weights[1], weights[2], weights[3]
    least = np.float32(1e-30)
    for i in range(u_new.size):
        w, e, n, s = kw[i], ke[i], kn[i], ks[i]
        p = xx[i] + ua * (w + e) + ud * (n + s)
        q = yy[i] + va * (w + e) + vd * (n + s)
        r = f[i] + ua * (w * uw[i] + e * ue[i]) + ud * (n * un[i] + s * us[i]) - p * u[i] - xy[i] * v[i]
        t = h[i] + va * (w * vw[i] + e * ve[i]) + vd * (n * vn[i] + s * vs[i]) - q * v[i] - xy[i] * u[i]
        step = length / max(p * q - xy[i] * xy[i], least)
        u_new[i] = u[i] + step * (q * r - xy[i] * t)
        v_new[i] = v[i] + step * (p * t - xy[i] * r)


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _residual_row(  # type: ignore[no-untyped-def]
    un, uw, u, ue, us, vn, vw, v, ve, vs, kw, ke, kn, ks, xx, xy, yy, f, h, weights, left_u, left_v
):
    ua, ud, va, vd = weights[0], weights[1], weights[2], weights[3]
    for i in range(left_u.size):
        w, e, n, s = kw[i], ke[i], kn[i], ks[i]
        p = xx[i] + ua * (w + e) + ud * (n + s)
        q = yy[i] + va * (w + e) + vd * (n + s)
        left_u[i] = f[i] + ua * (w * uw[i] + e * ue[i]) + ud * (n * un[i] + s * us[i]) - p * u[i] - xy[i] * v[i]
        left_v[i] = h[i] + va * (w * vw[i] + e * ve[i]) + vd * (n * vn[i] + s * vs[i]) - q * v[i] - xy[i] * u[i]


@numba.njit(cache=True, nogil=True)
def _relax(tensor, right, along, down, weights, length, u, v, u_new, v_new):  # type: ignore[no-untyped-def]
    """One sweep of Jacobi's method; flows have a border of one cell, whose value does not matter but must be finite."""
    for y in range(right.shape[1]):
        un, uh, us, vn, vh, vs = u[y], u[y + 1], u[y + 2], v[y], v[y + 1], v[y + 2]
        _relax_row(
            un[1:-1], uh[:-2], uh[1:-1], uh[2:], us[1:-1], vn[1:-1], vh[:-2], vh[1:-1], vh[2:], vs[1:-1],
            along[y, :-1], along[y, 1:], down[y], down[y + 1], tensor[0, y], tensor[1, y], tensor[2, y],
            right[0, y], right[1, y], weights, length, u_new[y + 1, 1:-1], v_new[y + 1, 1:-1],
        )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _residual(tensor, right, along, down, weights, u, v, left):  # type: ignore[no-untyped-def]
    for y in range(right.shape[1]):
        un, uh, us, vn, vh, vs = u[y], u[y + 1], u[y + 2], v[y], v[y + 1], v[y + 2]
        _residual_row(
            un[1:-1], uh[:-2], uh[1:-1], uh[2:], us[1:-1], vn[1:-1], vh[:-2], vh[1:-1], vh[2:], vs[1:-1],
            along[y, :-1], along[y, 1:], down[y], down[y + 1], tensor[0, y], tensor[1, y], tensor[2, y],
            right[0, y], right[1, y], weights, left[0, y], left[1, y],
        )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _add_up(fine, coarse):  # type: ignore[no-untyped-def]
    height, width = fine.shape
    for y in range(coarse.shape[0]):
        for x in range(coarse.shape[1]):
            total = np.float32(0)
            for j in range(2 * y, min(2 * y + 2, height)):
                for i in range(2 * x, min(2 * x + 2, width)):
                    total += fine[j, i]
            coarse[y, x] = total


@numba.njit(cache=True, nogil=True)
def _coarse_edges(along, down, coarse_along, coarse_down):  # type: ignore[no-untyped-def]
    height, width = along.shape[0], down.shape[1]
    rows, columns = coarse_along.shape[0], coarse_down.shape[1]
    half = np.float32(0.5)
    coarse_along[:] = 0
    coarse_down[:] = 0
    for y in range(rows):
        for x in range(1, columns):
            for j in range(2 * y, min(2 * y + 2, height)):
                coarse_along[y, x] += half * along[j, 2 * x]
    for y in range(1, rows):
        for x in range(columns):
            for i in range(2 * x, min(2 * x + 2, width)):
                coarse_down[y, x] += half * down[2 * y, i]


@numba.njit(cache=True, nogil=True)
def add_enlarged(coarse, fine, factor):  # type: ignore[no-untyped-def]
    """Add a coarse field, times a factor, to one of twice its size, linearly between the middles of its cells.

    Both have a border of one cell; that of the coarse one is overwritten by its neighbours.
    """
    rows, columns = coarse.shape[0] - 2, coarse.shape[1] - 2
    coarse[0] = coarse[1]
    coarse[rows + 1] = coarse[rows]
    coarse[:, 0] = coarse[:, 1]
    coarse[:, columns + 1] = coarse[:, columns]
    near, far = np.float32(0.75), np.float32(0.25)
    row = np.empty(columns + 2, np.float32)
    for y in range(fine.shape[0] - 2):
        here, beside = coarse[y // 2 + 1], coarse[y // 2 + 2 * (y & 1)]
        for x in range(columns + 2):
            row[x] = factor * (near * here[x] + far * beside[x])
        for x in range(fine.shape[1] - 2):
            fine[y + 1, x + 1] += near * row[x // 2 + 1] + far * row[x // 2 + 2 * (x & 1)]


def step_lengths(sweeps: int) -> list[np.float32]:
    """Return the lengths of so many sweeps: the inverse zeros of Chebyshev's polynomial over `SPECTRUM`."""
    low, high = SPECTRUM
    angles = np.pi * (np.arange(sweeps) + 0.5) / sweeps
    return [np.float32(2 / (high + low + (high - low) * np.cos(angle))) for angle in angles]


class _Grid:
    """Equations of one size, with room for their solution: what a round works on."""

    def __init__(self, equations: FlowEquations) -> None:
        rows, columns = equations.right.shape[1:]
        self.equations = equations
        self.u, self.v, self.u_next, self.v_next = np.zeros((4, rows + 2, columns + 2), np.float32)
        self.left = np.empty((2, rows, columns), np.float32)

    def sweep(self, lengths: list[np.float32]) -> None:
        e = self.equations
        for length in lengths:
            _relax(
                e.tensor, e.right, e.along, e.down, e.weights, length, self.u, self.v, self.u_next, self.v_next
            )  # fmt: skip
            self.u, self.u_next = self.u_next, self.u
            self.v, self.v_next = self.v_next, self.v

    def residual(self) -> Float32Array:
        e = self.equations
        _residual(e.tensor, e.right, e.along, e.down, e.weights, self.u, self.v, self.left)
        return self.left


def coarser(equations: FlowEquations) -> FlowEquations:
    """Return the equations of the grid of half the size, right-hand side zero."""
    rows, columns = equations.right.shape[1:]
    half_rows, half_columns = (rows + 1) // 2, (columns + 1) // 2
    tensor = np.empty((3, half_rows, half_columns), np.float32)
    for fine, coarse in zip(equations.tensor, tensor, strict=True):
        _add_up(fine, coarse)
    along, down = (
        np.empty((half_rows, half_columns + 1), np.float32),
        np.empty((half_rows + 1, half_columns), np.float32),
    )
    _coarse_edges(equations.along, equations.down, along, down)
    return FlowEquations(tensor, np.zeros((2, half_rows, half_columns), np.float32), along, down, equations.weights)


def _round(grids: list[_Grid], lengths: list[np.float32]) -> None:
    """One V-cycle on the first of the grids and all that are coarser."""
    fine = grids[0]
    if len(grids) == 1:
        fine.sweep([np.float32(1)])
        return
    fine.sweep(lengths)
    coarse = grids[1]
    for left, right in zip(fine.residual(), coarse.equations.right, strict=True):
        _add_up(left, right)
    coarse.u[:] = 0
    coarse.v[:] = 0
    _round(grids[1:], lengths)
    add_enlarged(coarse.u, fine.u, np.float32(1))
    add_enlarged(coarse.v, fine.v, np.float32(1))
    fine.sweep(lengths)


def solve_flow(
    equations: FlowEquations,
    *,
    rounds: int,
    sweeps: int = 2,
    start: tuple[Float32Array, Float32Array] | None = None,
) -> tuple[Float32Array, Float32Array]:
    """Return u and v after some rounds.

    Parameters
    ----------
    equations : FlowEquations
        Finite. A grid without any texture has no solution of its own and gives the start back.
    rounds : int
        V-cycles. Each makes the error three times smaller or more where there is texture everywhere; where nine cells of ten
        have none, a dozen or two are needed.
    sweeps : int
        Of Jacobi's method, before and after the coarser grid.
    start : pair of float32 arrays, shape (row, column), optional
        Where to begin; zero if left out.

    Returns
    -------
    u, v : float32 arrays, shape (row, column)
    """
    grids = [_Grid(equations)]
    while max(grids[-1].left.shape[1:]) > 1:
        grids.append(_Grid(coarser(grids[-1].equations)))
    if start is not None:
        grids[0].u[1:-1, 1:-1], grids[0].v[1:-1, 1:-1] = start
    lengths = step_lengths(sweeps)
    for _ in range(rounds):
        _round(grids, lengths)
    return grids[0].u[1:-1, 1:-1].copy(), grids[0].v[1:-1, 1:-1].copy()


def residual_reference(equations: FlowEquations, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return right-hand side less left-hand side, shape (2, row, column), in NumPy and double precision."""
    xx, xy, yy = equations.tensor.astype(np.float64)
    k_along, k_down = equations.along[:, 1:-1].astype(np.float64), equations.down[1:-1].astype(np.float64)

    def pulled(field: FloatArray, along: float, down: float) -> FloatArray:
        """What the neighbours pull."""
        flux_along, flux_down = along * k_along * np.diff(field, axis=1), down * k_down * np.diff(field, axis=0)
        return np.diff(np.pad(flux_along, ((0, 0), (1, 1))), axis=1) + np.diff(
            np.pad(flux_down, ((1, 1), (0, 0))), axis=0
        )

    ua, ud, va, vd = equations.weights.astype(np.float64)
    f, h = equations.right.astype(np.float64)
    return np.stack([f + pulled(u, ua, ud) - xx * u - xy * v, h + pulled(v, va, vd) - xy * u - yy * v])
