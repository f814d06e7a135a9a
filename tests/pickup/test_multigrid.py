"""Multigrid: the least energy in a few rounds, the same whichever way the picture lies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.horn_schunck import Flow, solve_horn_schunck
from gramoscope.pickup.flow.multigrid import FlowEquations, residual_reference, solve_flow
from gramoscope.pickup.flow.multigrid_horn_schunck import MultigridHornSchunck


def _equations(shape: tuple[int, int], *, alpha2: float, seed: int = 1) -> FlowEquations:
    """Cells of random texture, a third of them without any, bonds of very different strength."""
    rng = np.random.default_rng(seed)
    gx, gy, t = rng.normal(size=(3, *shape)) * (rng.random(shape) > 0.3)
    along, down = np.zeros((shape[0], shape[1] + 1)), np.zeros((shape[0] + 1, shape[1]))
    along[:, 1:-1] = alpha2 * rng.uniform(0.2, 1, (shape[0], shape[1] - 1))
    down[1:-1] = alpha2 * rng.uniform(0.2, 1, (shape[0] - 1, shape[1]))
    tensor, right = np.stack([gx * gx, gx * gy, gy * gy]), np.stack([-gx * t, -gy * t])
    return FlowEquations(
        *(a.astype(np.float32) for a in (tensor, right, along, down, np.array([1.0, 1.4, 0.8, 1.1])))
    )  # fmt: skip


def _solved_directly(e: FlowEquations) -> np.ndarray:
    """The same equations as one sparse matrix, in double precision."""
    rows, columns = e.right.shape[1:]
    number = np.arange(rows * columns).reshape(rows, columns)

    def bonds(along: float, down: float) -> sparse.csr_array:
        pairs = [
            (number[:, 1:], number[:, :-1], along * e.along[:, 1:-1].astype(float)),
            (number[1:], number[:-1], down * e.down[1:-1].astype(float)),
        ]
        total = sparse.csr_array((number.size, number.size))
        for here, there, k in pairs:
            i, j, w = here.ravel(), there.ravel(), k.ravel()
            entries = np.concatenate([w, w, -w, -w])
            places = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
            total = total + sparse.csr_array((entries, places), shape=total.shape)
        return total

    xx, xy, yy = (sparse.diags_array(c.ravel().astype(float)) for c in e.tensor)
    a = e.weights.astype(float)
    matrix = sparse.block_array([[xx + bonds(a[0], a[1]), xy], [xy, yy + bonds(a[2], a[3])]], format="csc")
    return np.asarray(spsolve(matrix, e.right.astype(float).ravel())).reshape(2, rows, columns)


@pytest.mark.parametrize("shape", [(1, 9), (13, 31), (64, 48), (7, 90)])
@pytest.mark.parametrize("alpha2", [0.1, 3.0, 300.0])
def test_a_few_rounds_come_to_what_a_direct_solution_says(shape: tuple[int, int], alpha2: float) -> None:
    equations = _equations(shape, alpha2=alpha2)
    exact = _solved_directly(equations)
    found = np.stack(solve_flow(equations, rounds=10))
    assert np.abs(found - exact).max() < 2e-3 * np.abs(exact).max()
    assert np.abs(found - exact).mean() < 3e-4 * np.abs(exact).max()


def test_ten_sweeps_of_jacobi_for_each_round_do_not_come_near() -> None:
    equations = _equations((64, 48), alpha2=300.0)
    exact = _solved_directly(equations)
    first = np.abs(np.stack(solve_flow(equations, rounds=1)) - exact).max()
    third = np.abs(np.stack(solve_flow(equations, rounds=3)) - exact).max()
    assert third < 0.1 * first


def test_the_residual_of_the_solution_is_nothing() -> None:
    equations = _equations((17, 22), alpha2=1.0)
    u, v = _solved_directly(equations)
    assert np.abs(residual_reference(equations, u, v)).max() < 1e-9
    assert np.abs(residual_reference(equations, u + 0.1, v)).max() > 0.01
    found = solve_flow(equations, rounds=12)
    assert np.abs(residual_reference(equations, *(f.astype(float) for f in found))).max() < 1e-4


def test_a_good_start_needs_fewer_rounds() -> None:
    equations = _equations((40, 56), alpha2=30.0)
    exact = _solved_directly(equations)
    near = tuple((f + 0.001).astype(np.float32) for f in exact)
    warm, cold = (np.abs(np.stack(solve_flow(equations, rounds=1, start=s)) - exact).max() for s in (near, None))
    assert warm < 0.05 * cold


def test_no_texture_gives_the_start_back() -> None:
    nothing = Derivatives(*(np.zeros((9, 14), np.float32) for _ in range(3)))
    flow = MultigridHornSchunck(beta=0.0, gamma=0.0).flow(nothing)
    assert not flow.u.any()
    assert not flow.v.any()
    lone = Derivatives(*(np.zeros((1, 1), np.float32) for _ in range(3)))
    assert MultigridHornSchunck(beta=0.0, gamma=0.0).flow(lone).u[0, 0] == 0


def test_a_mirrored_or_turned_picture_has_a_mirrored_or_turned_flow() -> None:
    rng = np.random.default_rng(4)
    x, y, t = rng.normal(size=(3, 32, 64)).astype(np.float32)
    method = MultigridHornSchunck(alpha=2.0, beta=0.0, gamma=0.0)
    flow = method.flow(Derivatives(x, y, t))
    mirrored = method.flow(Derivatives(*(np.ascontiguousarray(a[:, ::-1]) for a in (-x, y, t))))
    np.testing.assert_allclose(mirrored.u[:, ::-1], -flow.u, atol=2e-6)
    np.testing.assert_allclose(mirrored.v[:, ::-1], flow.v, atol=2e-6)
    turned = method.flow(Derivatives(*(np.ascontiguousarray(a.T) for a in (y, x, t))))
    np.testing.assert_allclose(turned.u.T, flow.v, atol=2e-6)
    np.testing.assert_allclose(turned.v.T, flow.u, atol=2e-6)
    assert np.abs(flow.u).max() > 0.1


def _moving(shape: tuple[int, int], u: np.ndarray | float, v: np.ndarray | float) -> Derivatives:
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(2, *shape))
    return Derivatives(*(a.astype(np.float32) for a in (x, y, -x * u - y * v)))


@pytest.mark.parametrize(("beta", "gamma"), [(0.0, 0.0), (0.6, 0.4)])
def test_endless_sweeps_come_to_the_same_flow(beta: float, gamma: float) -> None:
    row, column = np.mgrid[:40, :60]
    derivatives = _moving((40, 60), 0.3 * np.sin(row / 15), 0.1 * np.cos(column / 20))
    shear = np.full(40, 0.01)
    weights = {"alpha": 0.5, "beta": beta, "gamma": gamma}
    swept = solve_horn_schunck(derivatives, iterations=3000, shear=shear, **weights)
    found = MultigridHornSchunck(**weights, rounds=8).flow(derivatives, shear=shear)
    # not the same discretisation: four neighbours, not eight
    assert np.abs(found.u - swept.u).max() < 0.02
    assert np.abs(found.v - swept.v).max() < 0.02
    assert np.abs(swept.u).max() > 0.2


def test_an_affine_flow_is_found_between_borders() -> None:
    row, column = np.mgrid[:48, :64]
    true = Flow(0.2 + 0.004 * column - 0.002 * row, -0.1 + 0.003 * row)
    found = MultigridHornSchunck(alpha=0.3, beta=0.0, gamma=0.0, rounds=8).flow(_moving((48, 64), true.u, true.v))
    inside = np.s_[8:-8, 8:-8]
    np.testing.assert_allclose(found.u[inside], true.u[inside], atol=2e-3)
    np.testing.assert_allclose(found.v[inside], true.v[inside], atol=2e-3)


def test_the_shear_of_a_wall_is_followed_where_nothing_is_seen() -> None:
    true = 0.02 * (np.arange(41) - 12)
    d = _moving((41, 29), true[:, None], 0.0)
    seen = (np.arange(41) < 15).astype(np.float32)[:, None]
    gap = Derivatives(d.x * seen, d.y * seen, d.t * seen)
    flow = MultigridHornSchunck(alpha=0.2, beta=2.0, gamma=0.5, rounds=30).flow(gap, shear=np.full(41, 0.02))
    assert np.abs(flow.u[15:].mean(axis=1) - true[15:]).max() < 0.03


def test_impossible_weights_are_refused() -> None:
    for settings in ({"alpha": 0.0}, {"rounds": 0}, {"beta": -0.1}, {"gamma": -1.0}):
        with pytest.raises(ArgumentError):
            MultigridHornSchunck(**settings)
