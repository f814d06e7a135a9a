"""How exact and how fast is the flow between two pictures, beside OpenCV's DIS, and how near its ceiling is Horn and Schunck's?

    python -m benchmarks.speed.flow [--runs 9] [--table benchmarks/speed/flow.md]

Every method runs on every pair (`flow_pairs`), in turn with the others, on one thread, and DIS and the flow of two pairs at
once on two. OpenCV comes with the extra `peers`; without it only our own rows are made. Then 100 sweeps of Horn and Schunck
over a whole picture, and the same energy solved by multigrid, beside the ceilings of the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.accuracy.table import line_of
from benchmarks.speed.ceilings import Ceilings, measured_ceilings
from benchmarks.speed.flow_pairs import SHAPE, Pair, pairs
from gramoscope.pickup.flow.coarse_to_fine import CoarseToFine
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.flow_error import end_point_error_px
from gramoscope.pickup.flow.horn_schunck import TOGETHER, Flow, HornSchunck, solve_horn_schunck
from gramoscope.pickup.flow.multigrid_horn_schunck import MultigridHornSchunck
from gramoscope.pickup.flow.sweep_lanes import FIELD, ROW
from gramoscope.signal_path import ImageArray

Method = Callable[[ImageArray, ImageArray], Flow]
YARDSTICK = "OpenCV DIS medium"
SWEEPS, ROUNDS = 100, 4
PLAIN = f"{SWEEPS} sweeps of Horn and Schunck"
SETTLED = f"the least energy, {ROUNDS} rounds of multigrid"
LEANEST = 14
"""Vector instructions a point and sweep of the leanest way known to us.

For each component: the pair beside, w + e; with twice the middle the row's sum of three; sums of the rows above and below;
twice the pair of the row itself; a twelfth of it all: 5. Then e = p ū + q v̄ + r (2) and the two corrections (2), with I_x, I_y
and I_t over √(α² + I_x² + I_y²) as p, q and r. Each is a sum, a product or both at once, and counts as one multiply-add.
"""
LEANEST_BYTES = 28
"""Of a point, when each sweep reads u, v, p, q and r from memory and writes u and v."""


@dataclass(frozen=True)
class Row:
    """One method on one pair."""

    pair: str
    method: str
    error_px: float
    error_95_px: float
    median_s: float
    least_s: float


def our_methods() -> dict[str, Method]:
    return {"coarse to fine": CoarseToFine().flow, "coarse to fine, two looks": CoarseToFine(looks=2).flow}


def peer_methods() -> dict[str, Method]:
    """DIS on one thread; nothing without OpenCV."""
    try:
        import cv2
    except ImportError:
        return {}
    presets = {"OpenCV DIS fast": cv2.DISOPTICAL_FLOW_PRESET_FAST, YARDSTICK: cv2.DISOPTICAL_FLOW_PRESET_MEDIUM}

    def dis(preset: int) -> Method:
        def flow(first: ImageArray, second: ImageArray) -> Flow:
            field = cv2.DISOpticalFlow_create(preset).calc(first, second, None)
            return Flow(field[..., 0], field[..., 1])

        return flow

    return {name: dis(preset) for name, preset in presets.items()}


def threads_of_peers(count: int) -> None:
    """Let OpenCV use so many threads, where it is installed."""
    try:
        import cv2
    except ImportError:
        return
    cv2.setNumThreads(count)


def interleaved(works: Sequence[Callable[[], object]], runs: int) -> list[list[float]]:
    """Return the times of some works, each in turn with the others; the first round does not count."""
    spent: list[list[float]] = [[] for _ in works]
    for run in range(runs + 1):
        for times, work in zip(spent, works, strict=True):
            started = time.perf_counter()
            work()
            if run > 0:
                times.append(time.perf_counter() - started)
    return spent


def rows_of(pair: Pair, methods: dict[str, Method], runs: int) -> list[Row]:
    """Return every method on one pair."""
    works = [lambda m=method: m(pair.first, pair.second) for method in methods.values()]
    spent = interleaved(works, runs)
    rows = []
    for name, method, times in zip(methods, methods.values(), spent, strict=True):
        error = end_point_error_px(method(pair.first, pair.second), pair.true)[pair.counted]
        rows.append(
            Row(
                pair.name,
                name,
                float(error.mean()),
                float(np.quantile(error, 0.95)),
                float(np.median(times)),
                min(times),
            )
        )
    return rows


def warm_row(pair: Pair, runs: int, *, share: int = 5) -> Row:
    """A fifth of the rows, from a start that is half a pixel off."""
    height = pair.first.shape[0] // share // 2 * 2
    top = (pair.first.shape[0] - height) // 2
    first, second = (np.ascontiguousarray(p[top : top + height]) for p in (pair.first, pair.second))
    true = Flow(*(np.asarray(f)[top : top + height] for f in (pair.true.u, pair.true.v)))
    start = Flow(true.u + np.float32(0.4), true.v - np.float32(0.3))
    method = CoarseToFine()
    times = interleaved([lambda: method.flow(first, second, start=start)], runs)[0]
    error = end_point_error_px(method.flow(first, second, start=start), true)[pair.counted[top : top + height]]
    name = f"coarse to fine, {height} rows, from 0.5 px off"
    return Row(
        pair.name, name, float(error.mean()), float(np.quantile(error, 0.95)), float(np.median(times)), min(times)
    )


def on_two_threads(pair: Pair, runs: int) -> list[tuple[str, float]]:
    """Seconds a pair: DIS with two threads of its own, ours two pairs at a time."""
    methods = {**our_methods(), **peer_methods()}
    threads_of_peers(2)
    found = []
    with ThreadPoolExecutor(2) as pool:

        def two(method: Method) -> None:
            list(pool.map(lambda _: method(pair.first, pair.second), range(2)))

        works: list[Callable[[], object]] = []
        shares = []
        for name, method in methods.items():
            ours = name in our_methods()
            works.append((lambda m=method: two(m)) if ours else (lambda m=method: m(pair.first, pair.second)))
            shares.append(2 if ours else 1)
        for name, share, times in zip(methods, shares, interleaved(works, runs), strict=True):
            found.append((name, min(times) / share))
    threads_of_peers(1)
    return found


def solver_times(shape: tuple[int, int], runs: int) -> dict[str, float]:
    """Shortest times of the solvers where every point has texture: no number gets too small for the processor."""
    rng = np.random.default_rng(0)
    derivatives = Derivatives(*(0.3 * rng.normal(size=(3, *shape)).astype(np.float32)))
    works: dict[str, Callable[[], object]] = {
        PLAIN: lambda: HornSchunck(0.5, SWEEPS).flow(derivatives),
        f"{SWEEPS} sweeps with the groove constraint": lambda: solve_horn_schunck(
            derivatives, alpha=0.5, iterations=SWEEPS, beta=0.5, gamma=0.5
        ),
        SETTLED: lambda: MultigridHornSchunck(beta=0.0, gamma=0.0, rounds=ROUNDS).flow(derivatives),
    }
    return {name: min(times) for name, times in zip(works, interleaved(list(works.values()), runs), strict=True)}


def sweeps_needed(shape: tuple[int, int] = (256, 320), *, within: float = 0.01) -> tuple[int, int]:
    """Sweeps of Jacobi, and rounds of multigrid, to a hundredth of the flow's size from the least energy.

    Texture is in 4 of every 40 columns only, as on a polished record: flow has to cross what lies between.
    """
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, *shape)) * (np.arange(shape[1]) % 40 < 4)
    row, column = np.mgrid[: shape[0], : shape[1]]
    u, v = 0.4 * np.sin(column / 60), 0.2 * np.cos(row / 50)
    derivatives = Derivatives(*(a.astype(np.float32) for a in (x, y, -x * u - y * v)))
    settled = HornSchunck(0.5, 20_000).flow(derivatives)
    least = MultigridHornSchunck(beta=0.0, gamma=0.0, rounds=30).flow(derivatives)
    size = float(np.hypot(u, v).max())

    def count(numbers: Sequence[int], make: Callable[[int], Flow], end: Flow) -> int:
        near = (n for n in numbers if end_point_error_px(make(n), end).max() < within * size)
        return next(near, numbers[-1])

    sweeps = count([25 * 2**k for k in range(10)], lambda n: HornSchunck(0.5, n).flow(derivatives), settled)
    rounds = count(range(1, 30), lambda n: MultigridHornSchunck(beta=0.0, gamma=0.0, rounds=n).flow(derivatives), least)
    return sweeps, rounds


def table(rows: list[Row]) -> list[str]:
    """Lines of the table of pairs."""
    lines = [
        line_of(("pair", "method", "end-point error px", "95 % below px", "median ms", "least ms", "of DIS medium")),
        "|" + "---|" * 7,
    ]
    yardstick = {row.pair: row.least_s for row in rows if row.method == YARDSTICK}
    for row in rows:
        share = f"{row.least_s / yardstick[row.pair]:.2f}" if row.pair in yardstick else "–"
        times = f"{1e3 * row.median_s:.1f}", f"{1e3 * row.least_s:.1f}"
        lines.append(line_of((row.pair, row.method, f"{row.error_px:.4f}", f"{row.error_95_px:.4f}", *times, share)))
    return lines


def ceiling_lines(times: dict[str, float], shape: tuple[int, int], ceilings: Ceilings) -> list[str]:
    """Lines of the table of solvers."""
    points = SWEEPS * shape[0] * shape[1]
    arithmetic, laid_out = LEANEST * points / ceilings.fma_s, 4 * ROW / FIELD
    memory = laid_out * shape[0] * shape[1] * -(-SWEEPS // TOGETHER) / ceilings.triad_bytes_s
    swept = LEANEST_BYTES * points / ceilings.triad_bytes_s
    lines = [
        line_of(("solver, whole picture", "least ms", "× the arithmetic", "× memory, sweep by sweep")),
        "|" + "---|" * 4,
    ]
    for name, spent in times.items():
        ratios = (f"{spent / arithmetic:.2f}", f"{spent / swept:.2f}") if name.startswith(str(SWEEPS)) else ("–", "–")
        lines.append(line_of((name, f"{1e3 * spent:.1f}", *ratios)))
    return [
        f"Measured in the same run, on one thread: triad {ceilings.triad_bytes_s / 1e9:.1f} GB/s, "
        f"{ceilings.fma_s / 1e9:.0f} · 10⁹ single-precision multiply-adds a second.",
        f"{SWEEPS} sweeps of {shape[1]} × {shape[0]} points: arithmetic, {LEANEST} instructions a point and sweep, "
        f"{1e3 * arithmetic:.1f} ms; memory, {laid_out:.1f} bytes a point once for {TOGETHER} sweeps, {1e3 * memory:.1f} ms; "
        f"memory, if every sweep went through it ({LEANEST_BYTES} bytes), {1e3 * swept:.0f} ms.",
        "",
        *lines,
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    threads_of_peers(1)
    scenes = pairs()
    rows = [row for pair in scenes for row in rows_of(pair, {**our_methods(), **peer_methods()}, given.runs)]
    rows.append(warm_row(scenes[0], given.runs))
    together = on_two_threads(scenes[0], given.runs)
    ceilings = measured_ceilings()
    solvers = solver_times(SHAPE, given.runs)
    round_in_sweeps = solvers[SETTLED] / ROUNDS / (solvers[PLAIN] / SWEEPS)
    sweeps, rounds = sweeps_needed()
    text = "\n".join(
        [
            "# Flow, timed",
            "",
            "    python -m benchmarks.speed.flow --table benchmarks/speed/flow.md",
            "",
            f"Two pictures of {SHAPE[1]} × {SHAPE[0]} where no other size is named, 8 bits, in memory; methods in turn, "
            f"one thread, {given.runs} runs. *Of DIS medium*: shortest time over shortest time. The pairs are made by "
            "`benchmarks/speed/flow_pairs.py`.",
            "",
            *table(rows),
            "",
            f"Two threads, {scenes[0].name}, ms a pair (DIS uses both for a pair, ours takes two pairs at a time): "
            + ", ".join(f"{name} {1e3 * spent:.1f}" for name, spent in together)
            + ".",
            "",
            *ceiling_lines(solvers, SHAPE, ceilings),
            "",
            "To within a hundredth of the flow, where nine columns of ten have no texture (320 × 256): "
            f"{sweeps} sweeps of Jacobi, or {rounds} rounds of multigrid, each of which takes as long as "
            f"{round_in_sweeps:.0f} sweeps.",
        ]
    )
    print(text)
    if given.table is not None:
        given.table.write_text(text + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
