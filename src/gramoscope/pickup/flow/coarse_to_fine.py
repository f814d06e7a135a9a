"""The flow of Horn and Schunck between two pictures, whatever its size: from coarse to fine, each level solved by multigrid.

A differential method sees motion of a part of a pixel. So the flow is found in small pictures first (`picture_pyramid`), drawn
larger, the second picture brought over the first by it, and what is left is found in turn (P. Anandan, IJCV 2, 1989; T. Brox,
A. Bruhn, N. Papenberg and J. Weickert, ECCV 2004). At every level the energy is

    Σ_pixels s² ψ(t²/s²)  +  α² Σ_edges ε² ψ(|w − w′|²/ε²),        ψ(x) = 2 √(1 + x) − 2,

the first differences of Horn and Schunck's with costs that grow like a square near zero and straight further out, so that
neither dust nor an edge of motion pulls its whole neighbourhood along. It is made quadratic about the flow so far
(`motion_tensor`, k = 1/√(1 + …)).

**Cells.** Flow is smooth, pictures are not. Every pixel of the full picture is heard, but flow is found at the middles of cells
of a few pixels and drawn linearly between. The equations of 4 × 4 pixels become one; solving costs little beside looking.

**Lamp.** A second picture that is brighter or darker by one factor is made alike: the ratio of the means where both see the
same, found at the coarse levels. Light that changes from place to place is not allowed for.

**Common motion.** Grains of one size are not seen in small pictures. So the search begins with the shift of the whole picture
that phase correlation finds at the third level (C. D. Kuglin and D. C. Hines, 1975), if with it the pictures differ less.

**Looks.** At coarse levels a look costs nothing, and large motion needs several; at the finest level one is enough, but for
edges of motion, which a second sharpens.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numba
import numpy as np
import numpy.typing as npt
from scipy import fft

from gramoscope.conventions import Float32Array
from gramoscope.errors import require
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.pickup.flow.motion_tensor import flow_of_cells, motion_tensor
from gramoscope.pickup.flow.multigrid import FlowEquations, add_enlarged, solve_flow
from gramoscope.pickup.flow.picture_pyramid import picture_pyramid

Picture: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
Field: TypeAlias = tuple[Float32Array, Float32Array]

LEAST_PX = 24
"""No level is smaller than this on its shorter side, so far as pictures allow."""
LEAST_PICTURE_PX = 8
"""Smallest picture that has a flow."""
COMMON_LEVEL = 2
"""The finest level at which the lamp is compared, and where the common motion is looked for."""
EQUAL = np.ones(4, np.float32)


@dataclass(frozen=True)
class CoarseToFine:
    """The flow between two pictures.

    Parameters
    ----------
    alpha : float
        Weight of smoothness, grey levels, positive: neighbouring cells whose flow differs by a small part d of a
        pixel cost as much as one pixel that differs by α d in brightness.
    robust_levels : float
        s, grey levels, positive: a pixel that differs by more than this loses weight.
    edge_px : float
        ε, pixels of a level, positive: neighbouring cells whose flow differs by more than this are bound less firmly.
    cell_px : int
        Side of a cell.
    looks : int
        How often the finest level is warped and solved; each coarser level is once more than the one below it.
    rounds : int
        V-cycles a look.
    """

    alpha: float = 60.0
    robust_levels: float = 10.0
    edge_px: float = 0.05
    cell_px: int = 4
    looks: int = 1
    rounds: int = 1

    def __post_init__(self) -> None:
        for name in ("alpha", "robust_levels", "edge_px"):
            require(getattr(self, name) > 0, f"{name} is {getattr(self, name)}", "a positive number")
        for name in ("cell_px", "looks", "rounds"):
            require(getattr(self, name) >= 1, f"{name} is {getattr(self, name)}", "at least one")

    def flow(self, first: Picture, second: Picture, *, start: Flow | None = None, start_level: int = 1) -> Flow:
        """Return the flow from the first picture to the second.

        Parameters
        ----------
        first, second : uint8 or uint16 arrays, shape (row, column)
            At least 8 × 8, the same shape.
        start : Flow, optional
            A flow that is known to be near, of the pictures' shape and finite: the search begins with it, and not in the
            smallest picture.
        start_level : int
            Where it begins then: 0 is the full picture, 1 half of it. Right to about 2^`start_level` pixels is near enough.

        Returns
        -------
        Flow
            I₂(x + w(x)) = I₁(x). A picture without texture does not flow.

        Raises
        ------
        ArgumentError
            If the pictures differ in shape or are too small, or the start is of another shape.
        """
        _checked(first, second, start)
        levels = _level_count(first.shape) if start is None else min(start_level + 1, _level_count(first.shape))
        pyramids = picture_pyramid(first, levels=levels), picture_pyramid(second, levels=levels)
        cells = None if start is None else _cells_of_flow(start, cell_px=self.cell_px, level=levels - 1)
        u, v = self._descend(*pyramids, cells)
        return Flow(*(flow_of_cells(field, first.shape, cell_px=self.cell_px) for field in (u, v)))

    def _descend(self, first: list[Float32Array], second: list[Float32Array], cells: Field | None) -> Field:
        gain = _ratio(first[-1].mean(), second[-1].mean())
        if cells is None:
            cells = _slid(first, second, cell_px=self.cell_px)
        for level in reversed(range(len(first))):
            here, there = first[level], second[level]
            cells = _laid_on(cells, here.shape, cell_px=self.cell_px)
            for _ in range(self.looks + level):
                cells = self._look(here, there if gain == 1 else there * np.float32(gain), cells)
            if level >= min(COMMON_LEVEL, len(first) - 1):
                gain = _gain(here, there, cells, cell_px=self.cell_px)
        return cells

    def _look(self, first: Float32Array, second: Float32Array, cells: Field) -> Field:
        """Warp, and solve for the flow that the rest tells."""
        u, v = cells
        xx, xy, yy, xt, yt = tensor = motion_tensor(
            first, second, u, v, cell_px=self.cell_px, scale=self.robust_levels
        )  # fmt: skip
        along, down = _bonds(u, v, np.float32(self.alpha**2), np.float32(1 / self.edge_px**2))
        right = np.stack([xx * u + xy * v - xt, xy * u + yy * v - yt])
        return solve_flow(FlowEquations(tensor[:3], right, along, down, EQUAL), rounds=self.rounds, start=cells)


def _checked(first: Picture, second: Picture, start: Flow | None) -> None:
    require(
        first.shape == second.shape, f"pictures of {first.shape} and {second.shape} pixels", "two of the same shape"
    )
    require(
        first.ndim == 2 and min(first.shape) >= LEAST_PICTURE_PX,
        f"a picture of shape {first.shape}",
        f"rows and columns, at least {LEAST_PICTURE_PX} of each",
    )
    if start is not None:
        shape = np.shape(start.u)
        require(shape == first.shape, f"a start of {shape} for pictures of {first.shape} pixels", "the same shape")


def _level_count(shape: tuple[int, ...]) -> int:
    levels, side = 1, min(shape)
    while side // 2 >= LEAST_PX:
        levels, side = levels + 1, (side + 1) // 2
    return levels


def _slid(first: list[Float32Array], second: list[Float32Array], *, cell_px: int) -> Field:
    """Cells of the smallest picture that all move with the common motion."""
    level = min(COMMON_LEVEL, len(first) - 1)
    down, along = (step / (1 << (len(first) - 1 - level)) for step in common_shift_px(first[level], second[level]))
    rows, columns = (-(-size // cell_px) for size in first[-1].shape)
    return np.full((rows, columns), along, np.float32), np.full((rows, columns), down, np.float32)


def common_shift_px(first: Float32Array, second: Float32Array) -> tuple[int, int]:
    """Return by how many whole rows and columns the second picture is shifted, by phase correlation.

    Parameters
    ----------
    first, second : float32 arrays, shape (row, column)

    Returns
    -------
    down, along : int
        At most half the picture; 0 where no shift makes the pictures more alike.
    """
    a, b = (fft.rfft2(picture - picture.mean()) for picture in (first, second))
    cross = b * a.conj()
    # frequencies that hold less than the mean tell little of the shift, and count less
    weight = np.abs(cross)
    peak = fft.irfft2(cross / (weight + max(float(weight.mean()), 1e-12)), s=first.shape)
    place = np.unravel_index(int(peak.argmax()), peak.shape)
    down, along = (int(p) - size * (2 * int(p) > size) for p, size in zip(place, first.shape, strict=True))
    if _difference(first, second, down, along) < _difference(first, second, 0, 0):
        return down, along
    return 0, 0


def _difference(first: Float32Array, second: Float32Array, down: int, along: int) -> float:
    """Mean square of what differs beside the means, where both pictures are."""
    (here_y, there_y), (here_x, there_x) = (
        (slice(max(-d, 0), size - max(d, 0)), slice(max(d, 0), size + min(d, 0)))
        for d, size in zip((down, along), first.shape, strict=True)
    )
    return float((second[there_y, there_x] - first[here_y, here_x]).var())


def _laid_on(cells: Field, shape: tuple[int, ...], *, cell_px: int) -> Field:
    """The cells of a level, taken from those of the level above unless they are its own already."""
    rows, columns = -(-shape[0] // cell_px), -(-shape[1] // cell_px)
    if cells[0].shape == (rows, columns):
        return cells
    u, v = (_doubled(field, rows, columns) for field in cells)
    return u, v


def _doubled(field: Float32Array, rows: int, columns: int) -> Float32Array:
    """A field of half the size drawn larger, and its vectors with it."""
    fine = np.zeros((rows + 2, columns + 2), np.float32)
    add_enlarged(np.pad(field, 1), fine, np.float32(2))
    return fine[1:-1, 1:-1].copy()


def _cells_of_flow(flow: Flow, *, cell_px: int, level: int) -> Field:
    """Means of a flow over the cells of a level, in its pixels."""
    side, scale = cell_px << level, np.float32(1 / (1 << level))
    starts = [np.arange(0, size, side) for size in flow.u.shape]
    shape = [np.diff([*s, size]) for s, size in zip(starts, flow.u.shape, strict=True)]
    area = np.outer(*shape).astype(np.float32)
    u, v = (
        np.add.reduceat(np.add.reduceat(f, starts[0], axis=0), starts[1], axis=1) * scale / area
        for f in (flow.u, flow.v)
    )
    return u, v


@numba.njit(cache=True, nogil=True)
def _bond_row(u, v, u_next, v_next, alpha2, per_edge2, out):  # type: ignore[no-untyped-def]
    one = np.float32(1)
    for x in range(out.size):
        du, dv = u_next[x] - u[x], v_next[x] - v[x]
        out[x] = alpha2 / np.sqrt(one + per_edge2 * (du * du + dv * dv))


@numba.njit(cache=True, nogil=True)
def _bonds(u, v, alpha2, per_edge2):  # type: ignore[no-untyped-def]
    """How firmly neighbouring cells are bound, given the flow so far: k of `FlowEquations`."""
    rows, columns = u.shape
    along, down = np.zeros((rows, columns + 1), np.float32), np.zeros((rows + 1, columns), np.float32)
    for y in range(rows):
        _bond_row(u[y, :-1], v[y, :-1], u[y, 1:], v[y, 1:], alpha2, per_edge2, along[y, 1:-1])
    for y in range(1, rows):
        _bond_row(u[y - 1], v[y - 1], u[y], v[y], alpha2, per_edge2, down[y])
    return along, down


def _ratio(here: float, there: float) -> float:
    return float(here / there) if here > 0 and there > 0 else 1.0


def _gain(first: Float32Array, second: Float32Array, cells: Field, *, cell_px: int) -> float:
    """How much brighter the first picture is, over the pixels that both show: the nearest one will do for a mean."""
    height, width = first.shape
    u, v = (flow_of_cells(field, first.shape, cell_px=cell_px) for field in cells)
    row = np.rint(np.arange(height)[:, None] + v).astype(np.intp)
    column = np.rint(np.arange(width)[None, :] + u).astype(np.intp)
    seen = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    return _ratio(first[seen].mean(), second[row[seen], column[seen]].mean()) if seen.any() else 1.0
