"""Repair that can be undone: what was asked for, in order, and a list of every span that was touched.

Clicks first, then crackle, then rumble; all of it before equalising. The sound that came in goes out beside the repaired one,
so that what was taken off is their difference and nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import tee

import numpy as np

from gramoscope.conventions import BoolArray
from gramoscope.preamp.declick import Declicker
from gramoscope.preamp.decrackle import Decrackler
from gramoscope.preamp.pieces import side_by_side
from gramoscope.preamp.rumble import RumbleFilter
from gramoscope.preamp.spoilt import flagged, runs_of
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio, Cue

Pairs = Iterator[tuple[Audio, Audio]]
Note = Callable[[Cue], None]
Step = tuple[str, Callable[[Iterable[Audio]], Iterator[Audio]], Callable[[Audio, Audio], BoolArray]]


@dataclass(frozen=True)
class Repair:
    """What is to be repaired.

    Parameters
    ----------
    declick : Declicker or None
    decrackle : Decrackler or None
    rumble : RumbleFilter or None
        None leaves it out.
    """

    declick: Declicker | None = None
    decrackle: Decrackler | None = None
    rumble: RumbleFilter | None = None

    @property
    def asked(self) -> bool:
        """Whether there is anything to do."""
        return bool(self._steps)

    @property
    def history(self) -> tuple[str, ...]:
        """What is done, in words for the archive."""
        parts = (self.declick, self.decrackle, self.rumble)
        return tuple(part.history_line for part in parts if part is not None)

    def repair(self, pieces: Iterable[Audio], note: Note) -> Pairs:
        """Return the sound as it came and as it is after repair.

        Parameters
        ----------
        pieces : iterable of Audio
            Following each other without gap, at one rate.
        note : callable
            Told every span that is touched once it has ended, by each kind of repair in order of time, and every span that
            was interpolated while reading and left so. Rumble touches everything, and is one span.

        Yields
        ------
        raw, repaired : Audio
            The same samples, whatever the pieces they came in.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it, or has another rate.
        """
        raw, current = tee(pieces)
        for kind, done, touched in self._steps:
            before, given = tee(current)
            current = (after for _, after in _noted(side_by_side(before, done(given)), kind, touched, note))
        return _noted(side_by_side(raw, current), "interpolated", _left_interpolated, note)

    @property
    def _steps(self) -> list[Step]:
        steps: list[Step] = []
        if self.declick is not None:
            steps.append(("declick", self.declick.declick, _newly(Quality.DECLICKED)))
        if self.decrackle is not None:
            steps.append(("decrackle", self.decrackle.decrackle, _newly(Quality.DECRACKLED)))
        if self.rumble is not None:
            steps.append(("rumble", self.rumble.take_off, _everything))
        return steps


@dataclass(frozen=True)
class _Span:
    """Sums over touched samples; spans that meet are added."""

    start: int
    stop: int
    rate_hz: float
    peak: float
    squares: float
    squares_before: float
    deviates: float
    flags: int

    @classmethod
    def of(cls, before: Audio, after: Audio, run: range) -> _Span:
        part = slice(run.start, run.stop)
        # a NaN counts as 0, as everywhere in the preamp
        was = np.nan_to_num(before.samples[part])
        change, sigma = was - after.samples[part], after.sigma[part]
        known = sigma > 0
        return cls(
            before.start_sample + run.start,
            before.start_sample + run.stop,
            before.rate_hz,
            float(np.max(np.abs(change))),
            float(np.sum(change**2)),
            float(np.sum(was**2)),
            float(np.max(np.abs(change[known]) / sigma[known], initial=0.0)),
            int(np.bitwise_or.reduce(before.flags[part])),
        )

    def joined(self, other: _Span) -> _Span:
        return _Span(
            self.start,
            other.stop,
            self.rate_hz,
            max(self.peak, other.peak),
            self.squares + other.squares,
            self.squares_before + other.squares_before,
            max(self.deviates, other.deviates),
            self.flags | other.flags,
        )

    def cue(self, kind: str) -> Cue:
        ratio = self.squares / self.squares_before if self.squares_before > 0 else float("nan")
        return Cue(
            kind,
            self.start,
            self.stop,
            self.rate_hz,
            self.peak,
            float(np.sqrt(self.squares / (self.stop - self.start))),
            float(10 * np.log10(ratio)) if ratio > 0 else float("nan"),
            self._reason(kind),
        )

    def _reason(self, kind: str) -> str:
        if kind == "rumble":
            return "asked for"
        names = [str(flag.name).lower() for flag in Quality if self.flags & flag]
        words = [f"{self.deviates:.1f} standard errors"] if self.deviates > 0 else []
        return ", ".join([*words, *(f"flagged {name}" for name in names)])


def _noted(pairs: Pairs, kind: str, touched: Callable[[Audio, Audio], BoolArray], note: Note) -> Pairs:
    """Pass the pairs on, and tell of the touched spans."""
    waiting: _Span | None = None
    for before, after in pairs:
        for run in runs_of(touched(before, after)):
            span = _Span.of(before, after, run)
            if waiting is not None and waiting.stop == span.start:
                span = waiting.joined(span)
            elif waiting is not None:
                note(waiting.cue(kind))
            waiting = span
        yield before, after
    if waiting is not None:
        note(waiting.cue(kind))


def _newly(flag: Quality) -> Callable[[Audio, Audio], BoolArray]:
    return lambda before, after: np.asarray(flagged(after.flags, flag) & ~flagged(before.flags, flag))


def _everything(before: Audio, after: Audio) -> BoolArray:
    return np.ones(after.samples.size, np.bool_)


def _left_interpolated(before: Audio, after: Audio) -> BoolArray:
    return np.asarray(flagged(after.flags, Quality.INTERPOLATED) & ~flagged(after.flags, Quality.DECLICKED))
