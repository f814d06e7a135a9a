"""Pairs of pictures, 8 bits, whose flow is known at every point of the first: I₂(x + w(x)) = I₁(x), plus noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from experiments.seed_paper.flow_tree import MIDDLE, read_tree
from experiments.seed_paper.flow_tree import TRUE as TREE_FLOW
from experiments.seed_paper.take import film_in_memory, noise_sound, short_bench
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.signal_path import ImageArray
from gramoscope.simulation.scene import Scene, filming_bench

SHAPE = (1024, 1280)
NOISE = 2.0
"""Standard deviation of the camera's noise in pairs that are not filmed, grey levels of 8 bits."""
SOUND_RATE_HZ = 96_000.0


@dataclass(frozen=True, eq=False)
class Pair:
    """Two pictures, the flow from the first to the second, and which points count."""

    name: str
    first: ImageArray
    second: ImageArray
    true: Flow
    counted: BoolArray


def pairs(shape: tuple[int, int] = SHAPE) -> list[Pair]:
    """Return all pairs; without the tree where its frames are absent."""
    edge = disc_on_ground(shape)
    made = [groove(shape), slow_warp(shape), slide(shape), fast_warp(shape), dim_warp(shape), edge, at_the_edge(edge)]
    tree = read_tree()
    return made if tree is None else [*made, tree_pair(tree), enlarged_tree(tree)]


def groove(shape: tuple[int, int] = SHAPE, *, seed: int = 11) -> Pair:
    """Film two frames of an ordinary 78: the record slides as a whole, most rows are blurred, some are dark."""
    bench = short_bench(frames=2, groups=5, base=filming_bench(height_px=shape[0]))
    sound = noise_sound(low_hz=200, high_hz=4000, seconds=0.1, seed=seed)
    take = film_in_memory(sound, SOUND_RATE_HZ, Scene(bench, seed=seed), [4])
    group = take.groups[0]
    step = float(np.diff(take.true_starts_m(group))[0] / group.pixel_pitch_m)
    first, second = (np.ascontiguousarray(image[: shape[0], : shape[1]]) for image in group.images)
    flow = Flow(np.full(first.shape, -step, np.float32), np.zeros(first.shape, np.float32))
    return Pair(f"groove, filmed, {step:.2f} px", first, second, flow, _within(flow))


def slow_warp(shape: tuple[int, int] = SHAPE) -> Pair:
    """A grained surface under a smooth flow of up to 3 px."""
    return _warped("grain, smooth flow up to 3 px", shape, _smooth_flow(shape, 3.0, seed=1), grain_px=1.5, seed=2)


def slide(shape: tuple[int, int] = SHAPE) -> Pair:
    """The same grain, sliding by 17 px as a whole, with a smooth flow of up to 1 px besides."""
    flow = _smooth_flow(shape, 1.0, seed=8)
    slid = Flow(flow.u - np.float32(17.3), flow.v)
    return _warped("grain, slides by 17.3 px, ± 1 px", shape, slid, grain_px=1.5, seed=9)


def fast_warp(shape: tuple[int, int] = SHAPE) -> Pair:
    """Texture of every size under a smooth flow of up to 20 px."""
    return _warped("cloud, smooth flow up to 20 px", shape, _smooth_flow(shape, 20.0, seed=3), grain_px=0.0, seed=4)


def dim_warp(shape: tuple[int, int] = SHAPE) -> Pair:
    """The same with the lamp 5 % dimmer in the second picture."""
    return _warped(
        "the same, lamp 5 % dimmer", shape, _smooth_flow(shape, 20.0, seed=3), grain_px=0.0, seed=4, lamp=0.95
    )


def disc_on_ground(shape: tuple[int, int] = SHAPE) -> Pair:
    """A disc that moves another way than the ground behind it: an edge of motion."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    radius = 0.3 * shape[0]
    u, v, u0, v0 = 3.3, -1.4, -2.2, 0.6

    def inside(row: FloatArray, column: FloatArray) -> BoolArray:
        return np.asarray(np.hypot(row - shape[0] / 2, column - shape[1] / 2) < radius)

    disc, ground = (_texture(shape, grain_px=0.0, seed=seed) for seed in (5, 6))
    on = inside(rows, columns)
    first = np.where(on, disc, ground)
    moved = (_drawn(disc, rows - v, columns - u), _drawn(ground, rows - v0, columns - u0))
    second = np.where(inside(rows - v, columns - u), *moved)
    flow = Flow(np.where(on, u, u0).astype(np.float32), np.where(on, v, v0).astype(np.float32))
    hidden = inside(rows + v0 - v, columns + u0 - u) & ~on
    return Pair("disc on a ground, edge of motion", *_filmed(first, second, seed=7), flow, _within(flow) & ~hidden)


def at_the_edge(pair: Pair, *, reach_px: int = 10) -> Pair:
    """The same pictures, only the points near the edge."""
    on = pair.true.u > 0
    near = ndimage.binary_dilation(on, iterations=reach_px) & ~ndimage.binary_erosion(on, iterations=reach_px)
    return replace(pair, name=f"the same, within {reach_px} px of the edge", counted=pair.counted & near)


def tree_pair(tree: ImageArray) -> Pair:
    """Frames 20 and 21 of the translating tree at their own size, 150 × 150."""
    shape = tree[MIDDLE].shape
    flow = Flow(np.broadcast_to(TREE_FLOW.u, shape), np.broadcast_to(TREE_FLOW.v, shape))
    return Pair("translating tree, 150 × 150", tree[MIDDLE], tree[MIDDLE + 1], flow, _within(flow))


def enlarged_tree(tree: ImageArray, shape: tuple[int, int] = SHAPE) -> Pair:
    """The same, enlarged by cubic splines."""
    small = tree[MIDDLE].shape
    scale = (small[0] - 1) / (shape[0] - 1), (small[1] - 1) / (shape[1] - 1)
    rows, columns = np.arange(shape[0]) * scale[0], np.arange(shape[1]) * scale[1]
    grid = np.meshgrid(rows, columns, indexing="ij")
    frames = [
        ndimage.map_coordinates(tree[i].astype(np.float64), grid, order=3, mode="nearest") for i in (MIDDLE, MIDDLE + 1)
    ]
    u = np.interp(columns, np.arange(small[1]), TREE_FLOW.u[0]) / scale[1]
    flow = Flow(np.broadcast_to(u.astype(np.float32), shape), np.zeros(shape, np.float32))
    first, second = (np.clip(np.rint(f), 0, 255).astype(np.uint8) for f in frames)
    return Pair("translating tree, enlarged", first, second, flow, _within(flow))


def _smooth_flow(shape: tuple[int, int], largest_px: float, *, seed: int) -> Flow:
    """A field of a few waves longer than 350 px, its longest vector so long."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    parts = []
    for _ in range(2):
        field = np.zeros(shape)
        for _ in range(6):
            down, along = rng.uniform(-1, 1, 2) * 2 * np.pi / 500
            field += rng.normal() * np.cos(down * rows + along * columns + rng.uniform(0, 2 * np.pi))
        parts.append(field)
    scale = largest_px / np.hypot(*parts).max()
    return Flow(*((scale * part).astype(np.float32) for part in parts))


def _texture(shape: tuple[int, int], *, grain_px: float, seed: int) -> FloatArray:
    """Grains of one size (standard deviation of the Gaussian), or with 0 a spectrum that falls with the frequency."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=shape)
    if grain_px > 0:
        field = ndimage.gaussian_filter(white, grain_px, mode="wrap")
    else:
        f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :])
        spectrum = np.fft.rfft2(white) / np.maximum(f, 1 / 200) * np.exp(-((f / 0.25) ** 2))
        field = np.fft.irfft2(spectrum, s=shape)
    return np.asarray(110 + 35 * field / field.std())


def _drawn(texture: FloatArray, rows: FloatArray, columns: FloatArray) -> FloatArray:
    return np.asarray(ndimage.map_coordinates(texture, [rows, columns], order=5, mode="grid-wrap"))


def _warped(name: str, shape: tuple[int, int], flow: Flow, *, grain_px: float, seed: int, lamp: float = 1.0) -> Pair:
    """The second picture is the texture itself, the first looks it up at x + w(x)."""
    texture = _texture(shape, grain_px=grain_px, seed=seed)
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    first = _drawn(texture, rows + flow.v, columns + flow.u)
    return Pair(name, *_filmed(first, lamp * texture, seed=seed + 100), flow, _within(flow))


def _filmed(first: FloatArray, second: FloatArray, *, seed: int) -> tuple[ImageArray, ImageArray]:
    rng = np.random.default_rng(seed)
    noisy = [image + rng.normal(0, NOISE, image.shape) for image in (first, second)]
    a, b = (np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in noisy)
    return a, b


def _within(flow: Flow) -> BoolArray:
    """Points that the second picture still shows."""
    rows, columns = np.mgrid[: flow.u.shape[0], : flow.u.shape[1]]
    row, column = rows + flow.v, columns + flow.u
    return np.asarray((row >= 0) & (row <= flow.u.shape[0] - 1) & (column >= 0) & (column <= flow.u.shape[1] - 1))
