"""A transfer under way: who reads, how far it is, how good it is so far, and what is kept when it is stopped."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gramoscope.apparatus.capture import Capture
from gramoscope.cli.terminal import Terminal
from gramoscope.listening.whole_file import temporary_sibling
from gramoscope.player.executors import Executor, Processes, usual_executor
from gramoscope.player.following import Following
from gramoscope.player.kept_reading import Work
from gramoscope.player.live_meter import LiveMeter
from gramoscope.player.monitor import Monitor
from gramoscope.player.reading import AnyCapture
from gramoscope.player.reading_store import STORE
from gramoscope.signal_path import WallTrace

EVERY_S = 1.0
"""Machines are told so often."""
Shown = Callable[..., None]


@contextmanager
def at_work(
    terminal: Terminal,
    out: Path,
    executor: str,
    scheduler: str | None,
    workers: int,
    *,
    groups: int,
    json_progress: bool,
    **how: Any,
) -> Iterator[tuple[Shown | None, Work]]:
    """Show a transfer while the block runs; yields what to call with progress, and how to work.

    Parameters
    ----------
    terminal : Terminal
    out : Path
        The transfer's folder.
    executor : {"auto", "threads", "processes", "dask"}
    scheduler : str or None
    workers : int
    groups : int
        Of film that wait to be read on the processor; 0 where processes would be of no use.
    json_progress : bool
        In lines of JSON.
    how
        Further choices, see `Work`.
    """
    quiet = Terminal(quiet=terminal.quiet or json_progress, json=terminal.json)
    following: Following | None = how.get("following")
    watch = Watch(None if following is None else LiveMeter(following.capture.bench))

    def told(words: str) -> None:
        if json_progress:
            _say({"note": words})
        else:
            terminal.say(f"[yellow]Note:[/] {words}")

    def looked(monitor: Monitor, trace: WallTrace) -> None:
        for warning in watch.look(monitor, trace):
            told(warning)

    if following is not None:
        told(f"the sound grows in {temporary_sibling(out / 'flat.wav')}")
    waiting = groups if following is None else 0
    work = Work(_executor(executor, scheduler, workers, waiting, told), told=told, watched=looked, **how)
    try:
        with quiet.progress("Playing") as shown:
            yield watch.shown(_say_now_and_then() if json_progress else shown), work
    except BaseException:
        if (out / STORE).is_dir() and not terminal.quiet:
            sys.stderr.write(f"\nWhat was read is kept in {out / STORE}: the same command goes on from there.\n")
        raise


class Watch:
    """Looks on, and adds what is known so far to the progress: signal to noise, and with a meter the last group's figures."""

    def __init__(self, meter: LiveMeter | None = None) -> None:
        self._monitor: Monitor | None = None
        self._meter, self._live = meter, ""

    def look(self, monitor: Monitor, trace: WallTrace) -> list[str]:
        """Take note of a transfer's monitor and a stretch; return new warnings."""
        self._monitor = monitor
        if self._meter is None:
            return []
        figures, warnings = self._meter.look(trace)
        self._live = figures.words()
        return warnings

    def shown(self, show: Shown | None) -> Shown | None:
        """Return what to call with (done, of how many, of what), which shows that and what is known so far."""
        if show is None:
            return None

        def said(done: int, total: int, what: str) -> None:
            below_db = math.nan if self._monitor is None else self._monitor.snr_db
            known = ["" if math.isnan(below_db) else f"{below_db:.1f} dB", self._live]
            show(done, total, ", ".join([what, *filter(None, known)]))

        return said


def _say_now_and_then() -> Shown:
    """Return what tells machines how far things are: rate and time left are those of this command, since it began."""
    began: dict[str, tuple[float, int]] = {}
    last = -math.inf

    def say(done: int, total: int, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        name, *known = what.split(", ")
        below = next((float(one.removesuffix(" dB")) for one in known if one.endswith(" dB")), None)
        since, first = began.setdefault(name, (now, done))
        if now - last < EVERY_S and done not in (first, total):
            return
        last = now
        rate = (done - first) / (now - since) if now > since else math.nan
        _say(
            {
                "what": name,
                "done": done,
                "total": total,
                "groups_per_s": _finite(rate),
                "left_s": _finite((total - done) / rate if rate > 0 else math.nan),
                "signal_to_noise_db": below,
                **({"group": ", ".join(one for one in known if not one.endswith(" dB"))} if len(known) > 1 else {}),
            }
        )

    return say


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None


def _say(values: dict[str, Any]) -> None:
    sys.stderr.write(json.dumps(values) + "\n")
    sys.stderr.flush()


def groups_of(capture: AnyCapture) -> int:
    """Return how many groups of film a capture has; 0 for photographs."""
    return capture.group_count if isinstance(capture, Capture) else 0


def _executor(
    name: str, scheduler: str | None, workers: int, groups: int, told: Callable[[str], None]
) -> Executor | None:
    if scheduler is not None or name == "dask":
        from gramoscope.player.cluster import Cluster

        return Cluster(scheduler, workers, told)
    if name == "auto" and groups:
        return usual_executor(workers, groups)
    return Processes(workers) if name == "processes" else None
