"""A long passage through the store: does time grow with its length, memory not, and what do processes and Dask cost?

    python -m benchmarks.speed.side [--groups 512,1024,2048,4096] [--table benchmarks/speed/side.md]

Films 64 groups (12 frames of 1280 × 512) and strings them together over and over by links; every line is a process of its own,
recipe `best`. Times on the clock are of playing, without learning and without the start of workers. Processor time, of client
and workers together, does not depend on what else the machine does: what a group costs is the difference of two lengths.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.speed.passage import FILMED, strung_together
from benchmarks.speed.reading import filmed_capture
from gramoscope.apparatus.capture import open_capture
from gramoscope.player.executors import Executor, Processes
from gramoscope.player.kept_reading import STORE, Work
from gramoscope.player.play import Settings, play
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


def played(folder: Path, out: Path, executor: str) -> Line:
    """Play a capture; meant to run in a process of its own."""
    capture = open_capture(folder)
    moments: list[tuple[float, float]] = []

    def noted(done: int, total: int, what: str) -> None:
        # the first piece waits for workers to start: that is once a side, and told apart
        if what.startswith("Playing") and done > total // 8:
            moments.append((time.perf_counter(), _cpu_s()))

    work = Work(_executor(executor), keep_reading=True, restart=True)
    play(capture, load_recipe("best"), out, Settings(workers=WORKERS), progress=noted, work=work)
    (first, cpu_first), (last, cpu_last) = moments[0], moments[-1]
    scale = capture.group_count / (len(moments) - 1)
    size = sum(path.stat().st_size for path in (out / STORE).rglob("*") if path.is_file())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    data = (out / "flat.wav").read_bytes()
    samples = data[data.index(b"data") :]
    client_s, all_s = (cpu_last - cpu_first) * scale, _cpu_s() + _cpu_s(resource.RUSAGE_CHILDREN)
    return Line(capture.group_count, executor, (last - first) * scale, client_s, all_s, peak, size / 1e6, samples)


def _cpu_s(whose: int = resource.RUSAGE_SELF) -> float:
    """Processor time of this process, or of the workers that it had and that have ended."""
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def page(lines: list[Line]) -> str:
    """Return the table."""
    rows = [
        "# A side",
        "",
        "    python -m benchmarks.speed.side --table benchmarks/speed/side.md",
        "",
        f"`play` with `best`, {WORKERS} workers on {os.cpu_count()} processors, 12 frames of 1280 × 512 a group from "
        "uncompressed TIFF, 64 groups linked over and over. *Playing* is on the clock of a machine that others use too, taken "
        "between an eighth of the passage and its end and scaled to all of it. *Further group* is processor time of client and "
        "workers together, by the difference to half the length: what a group costs. The client's processor time has the "
        "reading in it for threads only. *Same bits*: samples of `flat.wav` against those of threads.",
        "",
        "| groups | who reads | playing s | further group, ms | client, ms a group | client's peak memory MiB | store MB "
        "| KB a group | same bits |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    model: dict[int, bytes] = {}
    shorter: dict[str, Line] = {}
    for line in lines:
        same = model.setdefault(line.groups, line.sound) == line.sound
        before, further = shorter.get(line.executor), "–"
        if before is not None:
            further = f"{(line.all_s - before.all_s) / (line.groups - before.groups) * 1e3:.1f}"
        shorter[line.executor] = line
        rows.append(
            f"| {line.groups} | {line.executor} | {line.playing_s:.1f} | {further} | {line.client_s / line.groups * 1e3:.1f} "
            f"| {line.peak_mib:.0f} | {line.store_mb:.0f} | {line.store_mb / line.groups * 1e3:.0f} "
            f"| {'yes' if same else 'NO'} |"
        )
    return "\n".join([*rows, ""])


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", default="512,1024,2048,4096", help="lengths; all executors play the first two")
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    lengths, lines = [int(n) for n in given.groups.split(",")], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        filmed_capture(folder / "film", FILMED)
        for number, groups in enumerate(lengths):
            capture = strung_together(folder / "film", folder / str(groups), groups)
            for executor in EXECUTORS if number < 2 else EXECUTORS[:1]:
                # a plain process: one of a pool may have no children
                context = multiprocessing.get_context("spawn")
                with context.Manager() as manager:
                    answer = manager.dict()
                    process = context.Process(target=_answered, args=(answer, capture, folder / "out", executor))
                    process.start()
                    process.join()
                    lines.append(answer["line"])
                print(lines[-1].groups, executor, lines[-1].playing_s, lines[-1].all_s, lines[-1].peak_mib, flush=True)
    if given.table:
        given.table.write_text(page(lines), "utf-8")
    print(page(lines))
    return 0


def _answered(answer: dict[str, Line], capture: Path, out: Path, executor: str) -> None:
    answer["line"] = played(capture, out, executor)


if __name__ == "__main__":
    raise SystemExit(main())
