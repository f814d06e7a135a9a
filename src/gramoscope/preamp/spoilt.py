"""From samples that are spoilt to sound without them, block by block.

Whatever finds spoilt samples does so in windows (`gramoscope.preamp.pieces.windows`) that overlap, and two windows need not
agree. So that no click is half repaired, each run of spoilt samples belongs to the block in which it begins, and is repaired
whole, by the process of that block.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.preamp.click_removal import under_clicks
from gramoscope.preamp.click_search import Process
from gramoscope.preamp.pieces import Window, without_nan
from gramoscope.quality import FlagArray, Quality
from gramoscope.signal_path import Audio


@dataclass(frozen=True, eq=False)
class Findings:
    """What is spoilt in a block.

    Attributes
    ----------
    window : Window
    process : Process or None
        Of the sound in the window; None where there was too little of it.
    runs : list of range
        Spoilt samples that begin in the block, by their numbers.
    """

    window: Window
    process: Process | None
    runs: list[range]


def findings(window: Window, process: Process, spoilt: BoolArray, *, longest: int) -> Findings:
    """Return the runs of spoilt samples that begin in a block and are no longer than `longest`."""
    ours = [run for run in runs_of(spoilt) if len(run) <= longest and window.start <= run.start < window.stop]
    return Findings(window, process, [_moved(run, window.audio.start_sample) for run in ours])


def repaired(found: Iterable[Findings], *, flag: Quality, history_line: str) -> Iterator[Audio]:
    """Yield block after block with its spoilt samples replaced.

    Parameters
    ----------
    found : iterable of Findings
        Of blocks that follow each other.
    flag : Quality
        For the samples that are replaced.
    history_line : str

    Yields
    ------
    Audio
        One for each block, a block late. What is replaced has the standard error of what replaces it.
    """
    earlier = _Patch.empty()
    for before, here, after in _neighbours(found):
        patch = _patch(here, (before, here, after))
        block = _patched(here.window.block, earlier, patch, flag=flag)
        yield replace(block, history=(*here.window.audio.history, history_line))
        earlier = patch


def with_gaps(piece: Audio) -> Audio:
    """Return the piece with 0 of unknown error, flagged `INTERPOLATED`, for NaN samples."""
    return replace(without_nan(piece), sigma=np.where(np.isnan(piece.samples), np.nan, piece.sigma))


def flagged(flags: FlagArray, which: Quality) -> BoolArray:
    """Return where any of some flags is set."""
    return np.asarray((flags & np.uint16(which)) != 0)


def runs_of(marks: BoolArray) -> list[range]:
    """Return the runs of marked samples."""
    edges = np.flatnonzero(np.diff(np.pad(marks.astype(np.int8), 1)))
    return [range(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def marks_of(runs: Iterable[range], count: int) -> BoolArray:
    """Mark runs among so many samples, what lies outside left out."""
    marks = np.zeros(count, np.bool_)
    for run in runs:
        marks[max(run.start, 0) : max(run.stop, 0)] = True
    return marks


@dataclass(frozen=True, eq=False)
class _Patch:
    """New values and standard errors of samples, by their numbers."""

    numbers: IntArray
    samples: FloatArray
    sigma: FloatArray

    @classmethod
    def empty(cls) -> _Patch:
        return cls(np.empty(0, np.int64), np.empty(0), np.empty(0))


def _neighbours(found: Iterable[Findings]) -> Iterator[tuple[Findings | None, Findings, Findings | None]]:
    before: Findings | None = None
    here: Findings | None = None
    for after in found:
        if here is not None:
            yield before, here, after
        before, here = here, after
    if here is not None:
        yield before, here, None


def _patch(here: Findings, around: Iterable[Findings | None]) -> _Patch:
    """Return what replaces the runs that begin in a block; those of its neighbours are unknown to it as well."""
    audio, process = here.window.audio, here.process
    if process is None or not here.runs:
        return _Patch.empty()
    every = [_moved(run, -audio.start_sample) for each in around if each for run in each.runs]
    spoilt = marks_of(every, audio.samples.size)
    unknown = np.flatnonzero(spoilt)
    seen = np.isfinite(audio.sigma[unknown])
    mean, error = under_clicks(process, audio.samples, unknown, seen=seen, rate_hz=audio.rate_hz)
    ours = [run for run in runs_of(spoilt) if here.window.start <= run.start < here.window.stop]
    kept = marks_of(ours, audio.samples.size)[unknown]
    return _Patch(unknown[kept] + audio.start_sample, mean[kept], error[kept])


def _patched(block: Audio, *patches: _Patch, flag: Quality) -> Audio:
    samples, sigma, flags = block.samples.copy(), block.sigma.copy(), block.flags.copy()
    for patch in patches:
        at = patch.numbers - block.start_sample
        inside = (at >= 0) & (at < samples.size)
        samples[at[inside]] = patch.samples[inside]
        sigma[at[inside]] = patch.sigma[inside]
        flags[at[inside]] |= np.uint16(flag)
    return replace(block, samples=samples, sigma=sigma, flags=flags)


def _moved(run: range, by: int) -> range:
    return range(run.start + by, run.stop + by)
