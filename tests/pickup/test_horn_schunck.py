"""The flow of Horn and Schunck: closed forms, the energy, the constraint, and the kernel against its reference."""

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow import horn_schunck
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.horn_schunck import (
    Flow,
    GrooveHornSchunck,
    HornSchunck,
    solve_horn_schunck,
    solve_horn_schunck_reference,
)


def _random(shape: tuple[int, int], seed: int = 1) -> Derivatives:
    rng = np.random.default_rng(seed)
    return Derivatives(*(rng.normal(size=shape).astype(np.float32) for _ in range(3)))


def _moving(shape: tuple[int, int], u: np.ndarray | float, v: float, seed: int = 2) -> Derivatives:
    """Derivatives of a wave and noise that move with a known flow: I_t = −I_x u − I_y v."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[: shape[0], : shape[1]]
    x = 0.6 * np.cos(0.4 * column + 0.15 * row) + 0.3 * rng.normal(size=shape)
    y = 0.2 * np.cos(0.4 * column + 0.15 * row) + 0.3 * rng.normal(size=shape)
    return Derivatives(*(a.astype(np.float32) for a in (x, y, -x * u - y * v)))


def _energy(flow: Flow, d: Derivatives, *, alpha: float, beta: float, gamma: float, shear: np.ndarray) -> float:
    """The energy whose stationary point the sweeps look for: each pair of neighbours differs once.

    Horn and Schunck's average has weight 1/6 for each of the four nearest and 1/12 for each of the four next; so has the
    sum of squared differences whose gradient is u − ū.
    """
    u, v = flow.u.astype(np.float64), flow.v.astype(np.float64)
    data = ((d.x * u + d.y * v + d.t) ** 2).sum()

    def rough(f: np.ndarray) -> float:
        nearest = (np.diff(f, axis=0) ** 2).sum() + (np.diff(f, axis=1) ** 2).sum()
        next_ = ((f[1:, 1:] - f[:-1, :-1]) ** 2).sum() + ((f[1:, :-1] - f[:-1, 1:]) ** 2).sum()
        return nearest / 6 + next_ / 12

    between = (shear[1:] + shear[:-1])[:, None] / 2
    carried = ((np.diff(u, axis=0) - between) ** 2).sum() / 2
    return data + alpha**2 * (rough(u) + rough(v)) + beta**2 * carried + gamma**2 * (v**2).sum()


@pytest.mark.parametrize("shape", [(3, 5), (13, 31), (24, 7), (1, 2), (9, 16), (17, 129), (41, 300), (30, 256)])
@pytest.mark.parametrize(("beta", "gamma"), [(0.0, 0.0), (0.7, 0.0), (0.0, 1.3), (0.4, 0.9)])
def test_the_kernel_agrees_with_the_reference(shape: tuple[int, int], beta: float, gamma: float) -> None:
    shear = np.random.default_rng(3).normal(0, 0.3, shape[0])
    weights = {"alpha": 0.8, "beta": beta, "gamma": gamma, "shear": shear, "iterations": 23}
    fast, slow = solve_horn_schunck(_random(shape), **weights), solve_horn_schunck_reference(_random(shape), **weights)
    np.testing.assert_allclose(fast.u, slow.u, atol=3e-6)
    np.testing.assert_allclose(fast.v, slow.v, atol=3e-6)
    assert np.abs(slow.u).max() > 0.1


@pytest.mark.parametrize("shape", [(1, 7), (3, 5), (37, 61), (45, 290), (40, 272)])
@pytest.mark.parametrize("iterations", [1, 2, 9, 20])
def test_sweeps_that_go_together_are_those_that_wait_for_each_other(
    shape: tuple[int, int], iterations: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    d, shear = _random(shape), np.linspace(-0.1, 0.2, shape[0])
    found = []
    for depth in (1, 2, 5, 64):
        monkeypatch.setattr(horn_schunck, "TOGETHER", depth)
        weights = {"alpha": 0.5, "beta": 0.4, "gamma": 0.3, "shear": shear}
        found.append(solve_horn_schunck(d, iterations=iterations, **weights))
    for other in found[1:]:
        np.testing.assert_array_equal(other.u, found[0].u)
        np.testing.assert_array_equal(other.v, found[0].v)
    # not what one sweep fewer gives
    fewer = solve_horn_schunck_reference(d, iterations=iterations + 1, **weights)
    assert np.abs(fewer.u - found[0].u).max() > 1e-5


def test_one_sweep_from_rest_is_the_normal_flow_of_each_point() -> None:
    d, alpha = _random((6, 9)), 0.7
    flow = solve_horn_schunck(d, alpha=alpha, iterations=1)
    share = -d.t / (alpha**2 + d.x**2 + d.y**2)
    np.testing.assert_allclose(flow.u, d.x * share, rtol=1e-5)
    np.testing.assert_allclose(flow.v, d.y * share, rtol=1e-5)


@pytest.mark.parametrize("method", [HornSchunck(), GrooveHornSchunck()])
def test_a_picture_without_texture_does_not_flow(method: HornSchunck | GrooveHornSchunck) -> None:
    nothing = Derivatives(*(np.zeros((11, 17), np.float32) for _ in range(3)))
    flow = method.flow(nothing)
    assert not flow.u.any()
    assert not flow.v.any()


def test_the_groove_method_without_its_weights_is_the_plain_one() -> None:
    d = _random((14, 33))
    plain = HornSchunck(alpha=0.6, iterations=40).flow(d)
    groove = GrooveHornSchunck(alpha=0.6, iterations=40, beta=0.0, gamma=0.0).flow(d, shear=np.full(14, 0.2))
    np.testing.assert_array_equal(groove.u, plain.u)
    np.testing.assert_array_equal(groove.v, plain.v)


def test_a_texture_that_moves_as_a_whole_is_followed() -> None:
    flow = HornSchunck(alpha=0.3, iterations=600).flow(_moving((37, 61), 0.31, -0.17))
    np.testing.assert_allclose(flow.u, 0.31, atol=2e-3)
    np.testing.assert_allclose(flow.v, -0.17, atol=2e-3)


def test_texture_along_the_groove_is_followed_and_none_wanders_across() -> None:
    flow = GrooveHornSchunck(alpha=0.3, gamma=5.0, iterations=600).flow(_moving((37, 61), 0.31, 0.0))
    np.testing.assert_allclose(flow.u, 0.31, atol=2e-3)
    across = GrooveHornSchunck(alpha=0.3, gamma=5.0, iterations=600).flow(_moving((37, 61), 0.31, -0.17))
    assert np.abs(across.v).max() < 0.05


def test_a_wall_of_known_shear_is_followed_through_a_gap_without_texture() -> None:
    shear = np.full(41, 0.02)
    d = _moving((41, 29), (0.02 * (np.arange(41) - 12))[:, None], 0.0)
    true = 0.02 * (np.arange(41) - 12)
    seen = np.zeros((41, 1), np.float32)
    # only the rows above the gap have texture: below it nothing but the shear is known
    seen[:15] = 1
    gap = Derivatives(d.x * seen, d.y * seen, d.t * seen)
    settings = {"alpha": 0.2, "iterations": 6000}
    plain = HornSchunck(**settings).flow(gap)
    groove = GrooveHornSchunck(beta=2.0, gamma=0.5, **settings).flow(gap, shear=shear)
    error = [np.abs(flow.u[15:].mean(axis=1) - true[15:]).max() for flow in (plain, groove)]
    assert error[0] > 0.3
    assert error[1] < 0.03


@pytest.mark.parametrize(("beta", "gamma"), [(0.0, 0.0), (0.6, 0.4)])
def test_the_energy_falls_from_sweep_to_sweep(beta: float, gamma: float) -> None:
    d, shear = _moving((19, 43), 0.4, 0.1), np.linspace(-0.05, 0.08, 19)
    weights = {"alpha": 0.5, "beta": beta, "gamma": gamma, "shear": shear}
    energies = [
        _energy(solve_horn_schunck_reference(d, iterations=n, **weights), d, **weights) for n in (1, 2, 3, 5, 8, 20, 60)
    ]
    assert (np.diff(energies) < 0).all()


def test_the_sweeps_end_where_the_energy_is_least() -> None:
    d, shear = _moving((9, 14), 0.4, 0.1), np.linspace(-0.05, 0.08, 9)
    weights = {"alpha": 0.5, "beta": 0.6, "gamma": 0.4, "shear": shear}
    end = solve_horn_schunck_reference(d, iterations=4000, **weights)
    least, rng = _energy(end, d, **weights), np.random.default_rng(8)
    for _ in range(20):
        aside = Flow(
            end.u + 0.01 * rng.normal(size=end.u.shape).astype(np.float32),
            end.v + 0.01 * rng.normal(size=end.v.shape).astype(np.float32),
        )
        assert _energy(aside, d, **weights) > least


def test_brighter_light_with_heavier_weights_leaves_the_flow_alone() -> None:
    d, shear = _random((12, 23)), np.full(12, 0.1)
    dim = GrooveHornSchunck(alpha=0.5, beta=0.4, gamma=0.3, iterations=50).flow(d, shear=shear)
    bright = GrooveHornSchunck(alpha=2.0, beta=1.6, gamma=1.2, iterations=50).flow(d.scaled(4.0), shear=shear)
    np.testing.assert_array_equal(bright.u, dim.u)
    np.testing.assert_array_equal(bright.v, dim.v)


def test_impossible_weights_are_refused() -> None:
    for settings in ({"alpha": 0.0}, {"iterations": 0}, {"beta": -0.1}, {"gamma": -1.0}):
        with pytest.raises(ArgumentError):
            GrooveHornSchunck(**settings)
    with pytest.raises(ArgumentError):
        HornSchunck(alpha=-1.0)
