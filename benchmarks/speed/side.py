"""A long passage through the store: does time grow with its length, memory not, and what do processes and Dask cost?

    python -m benchmarks.speed.side [--groups 512,1024,2048,4096] [--rounds 5] [--table benchmarks/speed/side.md]

Films 64 groups (12 frames of 1280 × 512) and strings them together over and over by links; every line is a process of its own,
recipe `best`. The two short lengths are played by threads, processes and Dask in turn, several rounds of it, so that a busy
minute of the machine touches all three: what processes and Dask cost is the median of the rounds' own ratios. Times on the
clock are of playing, without learning (done before, and kept in the store) and without the start of workers. Processor time,
of client and workers together, does not depend on what else the machine does: what a group costs is the difference of two
lengths.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.speed.passage import FILMED, strung_together
from benchmarks.speed.reading import filmed_capture
from gramoscope.apparatus.capture import open_capture
from gramoscope.player.executors import Executor, Processes
from gramoscope.player.kept_reading import STORE, Work
from gramoscope.player.play import Settings, play
from gramoscope.player.reading_store import open_store
from gramoscope.player.recipe import load_recipe

WORKERS = 2
EXECUTORS = ("threads", "processes", "dask")


@dataclass(frozen=True)
class Line:
    """How one passage went."""

    groups: int
    executor: str
    playing_s: float
    client_s: float
    all_s: float
    peak_mib: float
    store_mb: float
    sound: bytes


def _executor(name: str) -> Executor | None:
    if name == "dask":
        from gramoscope.player.cluster import Cluster

        return Cluster(None, WORKERS, lambda words: None)
    return Processes(WORKERS) if name == "processes" else None


class _EnoughError(Exception):
    """The passage has been learned, and a little of it read."""


def learned(folder: Path, out: Path) -> None:
    """Learn a passage, and keep what was learned in the store of its transfer."""

    def enough(done: int, total: int, what: str) -> None:
        if what.startswith("Playing") and done:
            raise _EnoughError

    with suppress(_EnoughError):
        play(open_capture(folder), load_recipe("best"), out, Settings(workers=WORKERS), progress=enough)


def played(folder: Path, out: Path, executor: str) -> Line:
    """Play a capture that was learned, forgetting what was read of it; meant to run in a process of its own."""
    capture = open_capture(folder)
    store = open_store(out / STORE)
    assert store is not None
    for piece in store.pieces:
        store.forget(piece)
    before_s, moments = _cpu_s(), list[tuple[float, float]]()

    def noted(done: int, total: int, what: str) -> None:
        # the first piece waits for workers to start: that is once a side, and told apart
        if what.startswith("Playing") and done > total // 8:
            moments.append((time.perf_counter(), _cpu_s()))

    work = Work(_executor(executor), keep_reading=True)
    play(capture, load_recipe("best"), out, Settings(workers=WORKERS), progress=noted, work=work)
    (first, cpu_first), (last, cpu_last) = moments[0], moments[-1]
    scale = capture.group_count / (len(moments) - 1)
    size = sum(path.stat().st_size for path in (out / STORE).rglob("*") if path.is_file())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    data = (out / "flat.wav").read_bytes()
    samples = data[data.index(b"data") :]
    client_s, all_s = (cpu_last - cpu_first) * scale, _cpu_s() - before_s + _cpu_s(resource.RUSAGE_CHILDREN)
    return Line(capture.group_count, executor, (last - first) * scale, client_s, all_s, peak, size / 1e6, samples)


def _cpu_s(whose: int = resource.RUSAGE_SELF) -> float:
    """Processor time of this process, or of the workers that it had and that have ended."""
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def page(rounds: dict[tuple[int, str], list[Line]]) -> str:
    """Return the table, of all the times that each length was played by each executor."""
    rows = [
        "# A side",
        "",
        "    python -m benchmarks.speed.side --table benchmarks/speed/side.md",
        "",
        f"`play` with `best`, {WORKERS} workers on {os.cpu_count()} processors, 12 frames of 1280 × 512 a group from "
        "uncompressed TIFF, 64 groups linked over and over. *Playing* is on the clock of a machine that others use too, taken "
        "between an eighth of the passage and its end and scaled to all of it: the median of the rounds (and their extremes). "
        "*Against threads*: playing, divided by that of threads in the same round, the median (and the extremes) of the "
        "rounds. *Further group* is processor time of client and workers together, by the difference to half the length: what "
        "a group costs. The client's processor time has the reading in it for threads only. *Same bits*: samples of "
        "`flat.wav` against those of threads.",
        "",
        "| groups | who reads | rounds | playing s | against threads | further group, ms | client, ms a group "
        "| client's peak memory MiB | store MB | KB a group | same bits |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    shorter: dict[str, tuple[int, float]] = {}
    for (groups, executor), lines in rounds.items():
        threads = rounds[groups, EXECUTORS[0]]
        playing = [line.playing_s for line in lines]
        ratios = [line.playing_s / beside.playing_s for line, beside in zip(lines, threads, strict=True)]
        all_s, client_s = median(line.all_s for line in lines), median(line.client_s for line in lines)
        before, further = shorter.get(executor), "–"
        if before is not None:
            further = f"{(all_s - before[1]) / (groups - before[0]) * 1e3:.1f}"
        shorter[executor] = groups, all_s
        store_mb = lines[0].store_mb
        rows.append(
            f"| {groups} | {executor} | {len(lines)} | {_spread(playing, '.1f')} "
            f"| {_spread(ratios, '.2f') if executor != EXECUTORS[0] else '1'} | {further} | {client_s / groups * 1e3:.1f} "
            f"| {max(line.peak_mib for line in lines):.0f} | {store_mb:.0f} | {store_mb / groups * 1e3:.0f} "
            f"| {'yes' if all(line.sound == threads[0].sound for line in lines) else 'NO'} |"
        )
    return "\n".join([*rows, ""])


def _spread(values: list[float], style: str) -> str:
    """Return the median of some values and, where there are several, their extremes."""
    middle = format(median(values), style)
    return middle if len(values) == 1 else f"{middle} ({min(values):{style}} … {max(values):{style}})"


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", default="512,1024,2048,4096", help="lengths; all executors play the first two")
    parser.add_argument("--table", type=Path, help="page to write")
    parser.add_argument("--rounds", type=int, default=5, help="times that each executor plays the first two, in turn")
    given = parser.parse_args()
    lengths = [int(n) for n in given.groups.split(",")]
    rounds: dict[tuple[int, str], list[Line]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        filmed_capture(folder / "film", FILMED)
        for number, groups in enumerate(lengths):
            capture = strung_together(folder / "film", folder / str(groups), groups)
            _apart(learned, capture, folder / "out")
            turns = EXECUTORS * given.rounds if number < 2 else EXECUTORS[:1]
            for executor in turns:
                line = _apart(played, capture, folder / "out", executor)
                rounds.setdefault((groups, executor), []).append(line)
                print(groups, executor, f"{line.playing_s:.2f} {line.all_s:.2f} s, {line.peak_mib:.0f} MiB", flush=True)
    if given.table:
        given.table.write_text(page(rounds), "utf-8")
    print(page(rounds))
    return 0


def _apart(work: Callable[..., Line | None], *given: Any) -> Any:
    """Return what a process of its own answers."""
    # a plain process: one of a pool may have no children
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager:
        answer = manager.dict()
        process = context.Process(target=_answered, args=(answer, work, *given))
        process.start()
        process.join()
        return answer["is"]


def _answered(answer: dict[str, Any], work: Callable[..., Line | None], *given: Any) -> None:
    answer["is"] = work(*given)


if __name__ == "__main__":
    raise SystemExit(main())
