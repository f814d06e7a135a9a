"""Every method of the page on flow, run on the tree and on the groove: flow and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.seed_paper import flow_tree
from experiments.seed_paper.flow_groove import MIDDLE, Groove
from experiments.seed_paper.flow_peers import PairFlow, timed
from experiments.seed_paper.flow_tree import BORDER_ORIGINAL_PX, BORDER_PX, PUBLISHED, TRUE, Score, inside, score
from gramoscope.pickup.flow.flow_method import FlowMethod
from gramoscope.pickup.flow.horn_schunck import Flow, GrooveHornSchunck, HornSchunck
from gramoscope.pickup.flow.registered_flow import common_step_px, registered_flow
from gramoscope.player.recipe import load_recipe
from gramoscope.signal_path import ImageArray

GROOVE_SMOOTHING_PX = load_recipe("seed-paper").pickup["smoothing_px"]
SWEEPS = (10, 20, 50, 100, 200, 500, 1000, 2000)
CONSTRAINED = GrooveHornSchunck(alpha=0.5, iterations=100, beta=0.5, gamma=0.5)
COMMON = "common motion alone"


@dataclass(frozen=True)
class Row:
    """One method, on one film."""

    name: str
    frames: int
    flow: Flow
    seconds: float


@dataclass(frozen=True)
class Published:
    """The rows of the published table, ours and with the fringe of the authors' program."""

    original: Score
    modified: Score
    steep: Score
    density: float
    fringed: Score
    fringed_steep: Score
    fringed_density: float


def published_rows(tree: ImageArray) -> Published:
    """Reproduce the published table."""
    clean, fringed = flow_tree.modified_derivatives(tree), flow_tree.fringed_derivatives(tree)
    counted = inside(BORDER_PX)
    flow, fringed_flow = PUBLISHED.flow(clean), PUBLISHED.flow(fringed)
    steep, fringed_steep = counted & flow_tree.steep(clean), counted & flow_tree.steep(fringed)
    return Published(
        original=score(flow_tree.original_flow(tree), TRUE, inside(BORDER_ORIGINAL_PX)),
        modified=score(flow, TRUE, counted),
        steep=score(flow, TRUE, steep),
        density=steep.sum() / counted.sum(),
        fringed=score(fringed_flow, TRUE, counted),
        fringed_steep=score(fringed_flow, TRUE, fringed_steep),
        fringed_density=fringed_steep.sum() / counted.sum(),
    )


def errors_by_sweeps(tree: ImageArray) -> dict[str, list[float]]:
    """Return the mean angular error on the published points after each number of `SWEEPS`."""
    derivatives, counted = flow_tree.modified_derivatives(tree), inside(BORDER_PX)
    methods = [HornSchunck(PUBLISHED.alpha, sweeps) for sweeps in SWEEPS]
    as_filmed = [method.flow(derivatives) for method in methods]
    registered = [flow_tree.flow_after_registration(tree, method) for method in methods]
    return {
        "as published, frames as filmed": [score(flow, TRUE, counted).angle_deg for flow in as_filmed],
        "the same, frames registered first": [score(flow, TRUE, counted).angle_deg for flow in registered],
    }


def tree_step_px(tree: ImageArray) -> float:
    """Return the common motion of the 11 frames around frame 20, pixels a frame."""
    return common_step_px(tree[flow_tree.MIDDLE - 5 : flow_tree.MIDDLE + 6][::-1])


def tree_rows(tree: ImageArray, others: dict[str, PairFlow]) -> list[Row]:
    """Return every method on the tree."""
    here, there = tree[flow_tree.MIDDLE], tree[flow_tree.MIDDLE + 1]
    shape = here.shape
    settled = HornSchunck(PUBLISHED.alpha, SWEEPS[-1])
    ours = {
        ("no flow at all", 0): lambda: _uniform(shape, 0.0),
        (COMMON, 11): lambda: _uniform(shape, tree_step_px(tree)),
        ("Horn–Schunck, original", 2): lambda: flow_tree.original_flow(tree),
        ("Horn–Schunck, modified", 15): lambda: PUBLISHED.flow(flow_tree.modified_derivatives(tree)),
        (f"the same, {settled.iterations} sweeps", 15): lambda: settled.flow(flow_tree.modified_derivatives(tree)),
        ("registered, Horn–Schunck", 2): lambda: flow_tree.flow_after_registration(tree, PUBLISHED, frames=2),
        ("registered, Horn–Schunck ", 11): lambda: flow_tree.flow_after_registration(tree, PUBLISHED),
        ("registered, with the groove constraint", 11): lambda: flow_tree.flow_after_registration(tree, CONSTRAINED),
    }
    rows = [Row(name.strip(), frames, *timed(work)) for (name, frames), work in ours.items()]
    return rows + [Row(name, 2, *_timed_pair(flow, here, there)) for name, flow in others.items()]


def groove_rows(groove: Groove, others: dict[str, PairFlow]) -> list[Row]:
    """Return every method on the groove; ours with the weights of the recipe `seed-paper`."""
    constrained = load_recipe("seed-paper").pickup["flow"]
    plain = HornSchunck(constrained.alpha, constrained.iterations)
    films = {2: groove.images[MIDDLE : MIDDLE + 2], 11: groove.images[MIDDLE - 5 : MIDDLE + 6]}
    shape = groove.images.shape[1:]
    rows = [
        Row("no flow at all", 0, *timed(lambda: _uniform(shape, 0.0))),
        Row(COMMON, 11, *timed(lambda: _uniform(shape, -common_step_px(films[11], expected_px=groove.step_px)))),
    ]
    for frames, film in films.items():
        for name, method in (
            ("registered, Horn–Schunck", plain),
            ("registered, with the groove constraint", constrained),
        ):
            work = _registered(film, method, groove.step_px)
            rows.append(Row(name, frames, *timed(work)))
    pair = groove.images[MIDDLE], groove.images[MIDDLE + 1]
    return rows + [Row(name, 2, *_timed_pair(flow, *pair)) for name, flow in others.items()]


def _uniform(shape: tuple[int, ...], u_px: float) -> Flow:
    return Flow(np.full(shape, u_px, np.float32), np.zeros(shape, np.float32))


def _registered(film: ImageArray, method: FlowMethod, expected_px: float) -> Callable[[], Flow]:
    return lambda: registered_flow(
        film, method=method, smoothing_px=GROOVE_SMOOTHING_PX, expected_px=expected_px, relative_weights=True
    )


def _timed_pair(method: PairFlow, here: ImageArray, there: ImageArray) -> tuple[Flow, float]:
    return timed(lambda: method(here, there))
