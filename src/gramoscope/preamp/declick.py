"""Declicking: what lies under a click is recovered from its surroundings.

Clicks are found as `gramoscope.preamp.click_search` says, with what the pickup saw as a witness: where its flags say that
something was wrong with the picture, much less is needed to make a click. The spoilt samples are replaced by the mean that
their surroundings leave them (`gramoscope.preamp.click_removal`), and their new `sigma` is its standard deviation. A strong
click hides what it stands on, and the mean is that of least-squares interpolation; a weak one does not, and what was read still
counts, by how weak the click is.

Do it before equalising: de-emphasis turns a tick into a thump.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from gramoscope.errors import require
from gramoscope.preamp.click_search import find_clicks
from gramoscope.preamp.pieces import Window, windows
from gramoscope.preamp.spoilt import Findings, findings, flagged, marks_of, repaired, runs_of, with_gaps
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio

WITNESSES = (
    Quality.INTERPOLATED
    | Quality.FRAME_LOST
    | Quality.DARK
    | Quality.SATURATED
    | Quality.NO_STRIPE
    | Quality.SPARSE
    | Quality.OUTLIER
)
"""Flags that speak of damage; the others speak of where the reading begins and ends, or of earlier repairs."""


@dataclass(frozen=True)
class Declicker:
    """Finds clicks and replaces them.

    Parameters
    ----------
    threshold : float
        A pulse that stands so many standard errors above what its surroundings predict is a click. Music would bear 6; it is a
        voice's own pulses that ask for 10 (docs/decisions/0012).
    flagged_threshold : float
        The same where the pickup's flags speak of damage (`WITNESSES`).
    longest_s : float
        Longer disturbances are left as they are: what fills them would be invented.
    order : int
        Of the autoregressive process, in samples.
    block_s : float
        The process is learned anew for every block of this length, from the block and half a block on either side.
    passes : int
        So many times at the most clicks are looked for, each time with those found so far out of the way.
    """

    threshold: float = 10.0
    flagged_threshold: float = 4.0
    longest_s: float = 0.003
    order: int = 32
    block_s: float = 0.02
    passes: int = 12

    def __post_init__(self) -> None:
        require(
            0 < self.flagged_threshold <= self.threshold,
            f"thresholds of {self.threshold:g} and, where flagged, {self.flagged_threshold:g} standard errors",
            "positive ones, the second no higher than the first",
        )
        require(self.longest_s > 0, f"a longest click of {self.longest_s:g} s", "a positive time")
        require(self.order >= 1, f"an order of {self.order}", "at least one sample")
        require(
            self.block_s >= 4 * self.longest_s,
            f"blocks of {self.block_s:g} s for clicks of up to {self.longest_s:g} s",
            "blocks at least four times as long as the longest click",
        )
        require(self.passes >= 1, f"{self.passes} passes", "at least one")

    def declick(self, pieces: Iterable[Audio]) -> Iterator[Audio]:
        """Return the pieces with their clicks replaced.

        Parameters
        ----------
        pieces : iterable of Audio
            Following each other without gap, at one rate. A NaN counts as a sample that nobody measured: it is filled in
            like a click, or becomes 0 where the gap is longer than `longest_s`, and is flagged `INTERPOLATED`.

        Yields
        ------
        Audio
            The same samples, whatever the pieces they came in; at the most two blocks are held back. What is replaced is
            flagged `DECLICKED` and has the standard error of what replaces it; everything else is passed on bit for bit.
            What was interpolated while reading stays, unless its `sigma` is not known: the tonearm bridges better than this
            does (docs/decisions/0012). A passage of fewer samples than four times the order is passed on as it is.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it or has another rate, or if blocks are too short for the order.
        """
        found = map(self._search, self._windows(pieces))
        yield from repaired(found, flag=Quality.DECLICKED, history_line=self.history_line)

    @property
    def history_line(self) -> str:
        """What the declicker did, in words for the archive."""
        return (
            f"clicks of up to {self.longest_s * 1e3:g} ms that stand {self.threshold:g} standard errors out "
            f"({self.flagged_threshold:g} where the pickup saw damage) replaced by what their surroundings predict"
        )

    def _windows(self, pieces: Iterable[Audio]) -> Iterator[Window]:
        first = next(pieces := iter(pieces), None)
        if first is None:
            return
        block, longest = round(self.block_s * first.rate_hz), self._longest(first.rate_hz)
        require(
            block // 2 >= longest + 3 * self.order,
            f"blocks of {block} samples at {first.rate_hz:g} Hz for an order of {self.order}",
            f"at least {2 * (longest + 3 * self.order)} samples",
            "longer blocks or a lower order",
        )
        yield from windows(map(with_gaps, chain([first], pieces)), block=block, margin=block // 2)

    def _longest(self, rate_hz: float) -> int:
        return max(1, round(self.longest_s * rate_hz))

    def _search(self, window: Window) -> Findings:
        audio = window.audio
        if audio.samples.size < 4 * self.order:
            return Findings(window, None, [])
        longest = self._longest(audio.rate_hz)
        unseen = flagged(audio.flags, Quality.INTERPOLATED) & np.isnan(audio.sigma)
        gaps = [run for run in runs_of(unseen) if len(run) <= longest]
        damaged = flagged(audio.flags, WITNESSES)
        spoilt, process = find_clicks(
            audio.samples,
            audio.sigma,
            unknown=marks_of(gaps, audio.samples.size),
            threshold=np.where(damaged, self.flagged_threshold, self.threshold),
            order=self.order,
            passes=self.passes,
        )
        return findings(window, process, spoilt, longest=longest)
