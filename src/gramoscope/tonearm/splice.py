"""Splicing: where each stretch really begins, by what its overlap with the one before says.

Neighbouring groups show the same piece of record twice: at the end of one and the start of the next. The normalised
cross-correlation of the two strips has its peak at the error of the nominal group step. The encoder's error at group g is
e_g; its overlaps measure differences e_{g+1} − e_g with a small error, and the encoder itself says that e_g is around zero
with a large one. A Kalman filter of one state puts both together, so that small errors of the overlaps do not pile up
along a whole side.

Across the groove the same peak says whether the picture moved by something else than the log of the stage knows: somebody
touched the table, the stage slipped. On films of which the truth is known it says so to 5 nm (0.012 pixels, correlation
0.97) and without bias. Where it is no chance, all that follows is moved back; the place of the walls is then continuous.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numba
import numpy as np
import numpy.typing as npt
from numpy.polynomial import polynomial

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.quality import Quality
from gramoscope.signal_path import Texture, WallTrace

TEXTURED = 0.1
"""Rows with less power, of the strongest row's, are left out: they are mostly noise."""
COARSE = 3
"""The rough search looks at every third of the others."""
ROWS, COLUMNS = 2, 3
"""The lattice about the peak reaches so far to each side."""
REFINEMENTS, NEWTON_ROUNDS = 4, 8
LEAST_DISSIMILARITY = 0.01
"""No strips are more alike than that, as (1 − c)/c: the microscope itself is not that steady."""


# in whichever order the processor adds fastest
@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _row_product(a, first, b, other, count):  # type: ignore[no-untyped-def]
    """Product of a part of one row with a part of another, of strips as one line."""
    here, there = np.uint64(first), np.uint64(other)
    total = np.float32(0)
    for x in range(np.uint64(count)):
        total += a[here + x] * b[there + x]
    return total


@numba.njit(cache=True, nogil=True)
def _squares_before(strip, rows, out):  # type: ignore[no-untyped-def]
    """Write sums of squares of rows up to each column, [row, column + 1]."""
    for y in rows:
        total = 0.0
        out[y, 0] = total
        for x in range(strip.shape[1]):
            total += strip[y, x] * strip[y, x]
            out[y, x + 1] = total


@numba.njit(cache=True, nogil=True)
def correlate_strips(a, b, column_shift, row_shift, least_columns, rows):  # type: ignore[no-untyped-def]
    """Return the normalised correlation of strip b, moved by whole rows and columns, with strip a.

    a[y, x] is compared with b[y − row_shift[i], x − column_shift[j]] where both exist, for y in `rows`; result [i, j] is
    −1 … 1, and 0 where fewer than `least_columns` columns overlap.
    """
    height, width, other_width = a.shape[0], a.shape[1], b.shape[1]
    one, other = a.reshape(a.size), b.reshape(b.size)
    of_a, of_b = np.empty((height, width + 1)), np.empty((len(b), other_width + 1))
    _squares_before(a, rows, of_a)
    wanted = np.zeros(len(b), np.bool_)
    for dy in row_shift:
        for y in rows:
            if 0 <= y - dy < len(b):
                wanted[y - dy] = True
    _squares_before(b, np.flatnonzero(wanted), of_b)
    out = np.zeros((row_shift.size, column_shift.size))
    for i in range(row_shift.size):
        for j in range(column_shift.size):
            dx = column_shift[j]
            start, stop = max(0, dx), min(width, other_width + dx)
            if stop - start < least_columns:
                continue
            ab, aa, bb = 0.0, 0.0, 0.0
            for y in rows:
                z = y - row_shift[i]
                if 0 <= z < min(height, len(b)):
                    ab += _row_product(one, y * width + start, other, z * other_width + start - dx, stop - start)
                    aa += of_a[y, stop] - of_a[y, start]
                    bb += of_b[z, stop - dx] - of_b[z, start - dx]
            if aa > 0 and bb > 0:
                out[i, j] = ab / np.sqrt(aa * bb)
    return out


def _textured(strip: npt.NDArray[np.float32]) -> IntArray:
    """Return the rows that hold most of a strip's texture."""
    power = np.einsum("ij,ij->i", strip, strip)
    return np.flatnonzero(power >= TEXTURED * power.max(initial=0.0))


@lru_cache
def _lagrange_polynomials(reach: int) -> FloatArray:
    """Coefficients of Lagrange's polynomials and of their two derivatives, shape (3, node, power), the lowest power first."""
    nodes = np.arange(-reach, reach + 1, dtype=np.float64)
    basis = np.array(
        [polynomial.polyfromroots(nodes[nodes != node]) / np.prod(node - nodes[nodes != node]) for node in nodes]
    )
    orders = np.zeros((3, *basis.shape))
    for order in range(3):
        orders[order, :, : nodes.size - order] = polynomial.polyder(basis, order, axis=1)
    return orders


@numba.njit(cache=True, nogil=True)
def _weights(polynomials, place, out):  # type: ignore[no-untyped-def]
    """Write the values of polynomials and their two derivatives at a place, shape (3, node)."""
    for order in range(3):
        for node in range(out.shape[1]):
            total = 0.0
            for power in range(polynomials.shape[2] - 1, -1, -1):
                total = total * place + polynomials[order, node, power]
            out[order, node] = total


@numba.njit(cache=True, nogil=True)
def _form(u, values, v):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(u.size):
        for j in range(v.size):
            total += u[i] * values[i, j] * v[j]
    return total


@numba.njit(cache=True, nogil=True)
def _peak(values, by_row, by_column):  # type: ignore[no-untyped-def]
    """Newton's way to the top of the surface."""
    u, v = np.empty((3, values.shape[0])), np.empty((3, values.shape[1]))
    row, column = 0.0, 0.0
    for _ in range(NEWTON_ROUNDS):
        _weights(by_row, row, u)
        _weights(by_column, column, v)
        by_u, by_v = _form(u[1], values, v[0]), _form(u[0], values, v[1])
        uu, uv, vv = _form(u[2], values, v[0]), _form(u[1], values, v[1]), _form(u[0], values, v[2])
        steepness = uu * vv - uv * uv
        if uu >= 0 or steepness <= 0:
            return np.nan, np.nan
        row_step, column_step = (uv * by_v - vv * by_u) / steepness, (uv * by_u - uu * by_v) / steepness
        row += min(max(row_step, -0.5), 0.5)
        column += min(max(column_step, -0.5), 0.5)
        if max(abs(row), abs(column)) > 1:
            return np.nan, np.nan
        if max(abs(row_step), abs(column_step)) < 1e-5:
            break
    return row, column


def lagrange(reach: int, place: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the weights of values at −reach … reach for the polynomial through them, and for its two derivatives."""
    weights = np.empty((3, 2 * reach + 1))
    _weights(_lagrange_polynomials(reach), place, weights)
    return weights[0], weights[1], weights[2]


def lattice_peak(values: FloatArray) -> tuple[float, float]:
    """Return where, off the middle of a lattice, the smooth surface through its values is highest.

    A correlation is as band-limited as the strips it is made of: the polynomial through all values of a lattice of 5 × 7
    finds its peak to 0.003 pixels, a parabola through three of them to 0.03, and biased towards whole pixels.

    Parameters
    ----------
    values : float64 array, shape (odd, odd)
        Largest in the middle.

    Returns
    -------
    row, column : float
        −1 … 1; NaN where there is no peak.
    """
    rows, columns = values.shape
    row, column = _peak(values, _lagrange_polynomials(rows // 2), _lagrange_polynomials(columns // 2))
    return float(row), float(column)


@dataclass(frozen=True)
class Match:
    """How the head of one stretch lies on the tail of the one before.

    Attributes
    ----------
    error_m : float
        True minus nominal distance along the groove; NaN when no match is believed.
    correlation : float
        Of the two strips at the match.
    row_error_m : float
        By how much more the groove moved across the picture, towards +l, than the log of the stage says; NaN when no match
        is believed.
    """

    error_m: float
    correlation: float
    row_error_m: float = float("nan")


@dataclass(frozen=True)
class Splice:
    """How stretches are joined.

    Parameters
    ----------
    reach_m : float
        How far the true group step may be from the nominal one.
    row_reach_px : int
        How many rows the groove may have moved in the picture meanwhile.
    least_overlap_px : int
        Overlaps narrower than this are not believed.
    least_correlation : float
        Nor are matches worse than this.
    match_sigma_m, encoder_sigma_m : float
        Standard error of a match, and of the encoder (or of the nominal positions).
    row_sigma_m : float
        Standard error of a match across the groove, of strips that correlate by one half; it falls with √((1 − c)/c).
    jump_sigmas : float
        A move of the picture across the groove that the log does not know is believed when it is so many standard errors.
    """

    reach_m: float = 9e-6
    row_reach_px: int = 3
    least_overlap_px: int = 24
    least_correlation: float = 0.5
    match_sigma_m: float = 0.05e-6
    encoder_sigma_m: float = 3e-6
    row_sigma_m: float = 25e-9
    jump_sigmas: float = 6.0

    def match(self, tail: Texture, head: Texture) -> Match:
        """Return how the head of a stretch lies on the tail of the one before."""
        pitch = tail.pixel_pitch_m
        nominal_px = (head.arc_start_m - tail.arc_start_m) / pitch
        reach = int(np.ceil(self.reach_m / pitch))
        columns = int(np.rint(nominal_px)) + np.arange(-reach, reach + 1)
        # the microscope's own move shifts the picture of the groove the other way
        stage_px = (head.stage_m - tail.stage_m) / pitch
        rows = int(np.rint(stage_px)) + np.arange(-self.row_reach_px, self.row_reach_px + 1)
        textured = _textured(tail.strip)
        rough = correlate_strips(tail.strip, head.strip, columns, rows, self.least_overlap_px, textured[::COARSE])
        i, j = np.unravel_index(int(np.argmax(rough)), rough.shape)
        row, column, best = self._refine(tail, head, int(rows[i]), int(columns[j]), textured)
        at_the_end = not (columns[0] < column < columns[-1] and rows[0] - 0.5 <= row <= rows[-1] + 0.5)
        if best < self.least_correlation or at_the_end:
            return Match(float("nan"), best)
        return Match(float((column - nominal_px) * pitch), best, float((stage_px - row) * pitch))

    def _refine(
        self, tail: Texture, head: Texture, row: int, column: int, textured: IntArray
    ) -> tuple[float, float, float]:
        """Row, column and height of the peak of the correlation next to where it was seen roughly; NaN without one."""
        best = 0.0
        for _ in range(REFINEMENTS):
            around = correlate_strips(
                tail.strip,
                head.strip,
                column + np.arange(-COLUMNS, COLUMNS + 1),
                row + np.arange(-ROWS, ROWS + 1),
                self.least_overlap_px,
                textured,
            )
            i, j = divmod(int(np.argmax(around)), around.shape[1])
            best = float(around[i, j])
            if (i, j) == (ROWS, COLUMNS):
                off = lattice_peak(around)
                return row + off[0], column + off[1], best
            row, column = row + i - ROWS, column + j - COLUMNS
        return float("nan"), float("nan"), best

    def join(self, traces: Iterator[WallTrace]) -> Iterator[tuple[WallTrace, Match | None]]:
        """Put each stretch where it really begins.

        Parameters
        ----------
        traces : iterator of WallTrace
            In the order of the passage, at their nominal places.

        Yields
        ------
        trace : WallTrace
            `arc_start_m` corrected, and `offset_m` where the picture moved across the groove by more or less than the log
            of the stage says; flagged `NO_OVERLAP` when it could not be matched to the one before.
        match : Match or None
            What the overlap said; None for the first stretch.
        """
        error, variance, moved = 0.0, 0.0, 0.0
        before: WallTrace | None = None
        for trace in traces:
            match = None
            if before is not None:
                match = self._match_traces(before, trace)
                error, variance = self._update(error, variance, match)
                moved += self._jump(match)
            lost = match is not None and np.isnan(match.error_m)
            flags = trace.flags | np.uint16(Quality.NO_OVERLAP) if lost else trace.flags
            yield (
                replace(trace, arc_start_m=trace.arc_start_m + error, offset_m=trace.offset_m - moved, flags=flags),
                match,
            )
            before = trace

    def _match_traces(self, before: WallTrace, trace: WallTrace) -> Match:
        if before.tail is None or trace.head is None:
            return Match(float("nan"), 0.0)
        return self.match(before.tail, trace.head)

    def _jump(self, match: Match) -> float:
        """How far the picture moved unlogged, if that is no chance; 0 otherwise."""
        if not match.correlation > 0:
            return 0.0
        sigma = self.row_sigma_m * np.sqrt((1 - match.correlation) / match.correlation + LEAST_DISSIMILARITY)
        return match.row_error_m if abs(match.row_error_m) > self.jump_sigmas * sigma else 0.0

    def _update(self, error: float, variance: float, match: Match) -> tuple[float, float]:
        """One step of the filter: the overlap predicts, the encoder corrects."""
        if np.isnan(match.error_m):
            predicted, spread = 0.0, self.encoder_sigma_m**2
        else:
            predicted, spread = error + match.error_m, variance + self.match_sigma_m**2
        gain = spread / (spread + self.encoder_sigma_m**2)
        return predicted * (1 - gain), spread * (1 - gain)
