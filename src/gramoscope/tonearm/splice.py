"""Splicing: where each stretch really begins, by what its overlap with the one before says.

Neighbouring groups show the same piece of record twice: at the end of one and the start of the next. The normalised
cross-correlation of the two strips has its peak at the error of the nominal group step. The encoder's error at group g is
e_g; its overlaps measure differences e_{g+1} − e_g with a small error, and the encoder itself says that e_g is around zero
with a large one. A Kalman filter of one state puts both together, so that small errors of the overlaps do not pile up
along a whole side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numba
import numpy as np

from gramoscope.quality import Quality
from gramoscope.signal_path import Texture, WallTrace


@numba.njit(cache=True, nogil=True)
def _row_products(a, b, shift, start, stop):  # type: ignore[no-untyped-def]
    ab = np.float32(0)
    aa = np.float32(0)
    bb = np.float32(0)
    for x in range(start, stop):
        p, q = a[x], b[x - shift]
        ab += p * q
        aa += p * p
        bb += q * q
    return ab, aa, bb


@numba.njit(cache=True, nogil=True)
def correlate_strips(a, b, column_shift, row_shift, least_columns):  # type: ignore[no-untyped-def]
    """Return the normalised correlation of strip b, moved by whole rows and columns, with strip a.

    a[y, x] is compared with b[y − row_shift[i], x − column_shift[j]] where both exist; result [i, j] is −1 … 1, and 0
    where fewer than `least_columns` columns overlap.
    """
    height = a.shape[0]
    out = np.zeros((row_shift.size, column_shift.size))
    for i in range(row_shift.size):
        dy = row_shift[i]
        for j in range(column_shift.size):
            dx = column_shift[j]
            start, stop = max(0, dx), min(a.shape[1], b.shape[1] + dx)
            if stop - start < least_columns:
                continue
            ab, aa, bb = 0.0, 0.0, 0.0
            for y in range(max(0, dy), min(height, height + dy)):
                p, q, r = _row_products(a[y], b[y - dy], dx, start, stop)
                ab += p
                aa += q
                bb += r
            if aa > 0 and bb > 0:
                out[i, j] = ab / np.sqrt(aa * bb)
    return out


def parabola_peak(left: float, middle: float, right: float) -> float:
    """Return where, between −½ and ½, the parabola through three values at −1, 0, 1 is highest."""
    bend = left - 2 * middle + right
    return 0.0 if bend >= 0 else float(np.clip((left - right) / (2 * bend), -0.5, 0.5))


@dataclass(frozen=True)
class Match:
    """How the head of one stretch lies on the tail of the one before.

    Attributes
    ----------
    error_m : float
        True minus nominal distance along the groove; NaN when no match is believed.
    correlation : float
        Of the two strips at the match.
    """

    error_m: float
    correlation: float


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
    """

    reach_m: float = 9e-6
    row_reach_px: int = 3
    least_overlap_px: int = 24
    least_correlation: float = 0.5
    match_sigma_m: float = 0.05e-6
    encoder_sigma_m: float = 3e-6

    def match(self, tail: Texture, head: Texture) -> Match:
        """Return how the head of a stretch lies on the tail of the one before."""
        pitch = tail.pixel_pitch_m
        nominal_px = (head.arc_start_m - tail.arc_start_m) / pitch
        reach = int(np.ceil(self.reach_m / pitch))
        columns = int(np.rint(nominal_px)) + np.arange(-reach, reach + 1)
        # the microscope's own move shifts the picture of the groove the other way
        stage_rows = int(np.rint((tail.stage_m - head.stage_m) / pitch))
        rows = -stage_rows + np.arange(-self.row_reach_px, self.row_reach_px + 1)
        score = correlate_strips(tail.strip, head.strip, columns, rows, self.least_overlap_px)
        i, j = np.unravel_index(int(np.argmax(score)), score.shape)
        best = float(score[i, j])
        if best < self.least_correlation or j in (0, columns.size - 1):
            return Match(float("nan"), best)
        place = columns[j] + parabola_peak(*score[i, j - 1 : j + 2])
        return Match(float((place - nominal_px) * pitch), best)

    def join(self, traces: Iterator[WallTrace]) -> Iterator[tuple[WallTrace, Match | None]]:
        """Put each stretch where it really begins.

        Parameters
        ----------
        traces : iterator of WallTrace
            In the order of the passage, at their nominal places.

        Yields
        ------
        trace : WallTrace
            `arc_start_m` corrected; flagged `NO_OVERLAP` when it could not be matched to the one before.
        match : Match or None
            What the overlap said; None for the first stretch.
        """
        error, variance = 0.0, 0.0
        before: WallTrace | None = None
        for trace in traces:
            match = None
            if before is not None:
                match = self._match_traces(before, trace)
                error, variance = self._update(error, variance, match)
            lost = match is not None and np.isnan(match.error_m)
            flags = trace.flags | np.uint16(Quality.NO_OVERLAP) if lost else trace.flags
            yield replace(trace, arc_start_m=trace.arc_start_m + error, flags=flags), match
            before = trace

    def _match_traces(self, before: WallTrace, trace: WallTrace) -> Match:
        if before.tail is None or trace.head is None:
            return Match(float("nan"), 0.0)
        return self.match(before.tail, trace.head)

    def _update(self, error: float, variance: float, match: Match) -> tuple[float, float]:
        """One step of the filter: the overlap predicts, the encoder corrects."""
        if np.isnan(match.error_m):
            predicted, spread = 0.0, self.encoder_sigma_m**2
        else:
            predicted, spread = error + match.error_m, variance + self.match_sigma_m**2
        gain = spread / (spread + self.encoder_sigma_m**2)
        return predicted * (1 - gain), spread * (1 - gain)
