"""Does twice the passage take twice the time, in the same memory, from files to files?

    python -m benchmarks.speed.passage [--groups 512,1024,…,16384] [--table benchmarks/speed/passage.md]

Films 64 groups (12 frames of 1280 × 512) and strings them together over and over by links, so that a long passage needs no more
disk than a short one; each length is then played by the recipe `best`, every time in a process of its own. The joints make
no music, but neither time nor memory depends on that.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import re
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.speed.reading import filmed_capture
from gramoscope.apparatus.capture import open_capture
from gramoscope.player.executors import MANY_GROUPS, usual_executor
from gramoscope.player.kept_reading import Work
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe

FILMED = 64
WORKERS = 2


@dataclass(frozen=True)
class Played:
    """How one passage went; memory is the most that the client had by half of the passage, by all of it, and in the end."""

    groups: int
    learning_s: float
    playing_s: float
    half_mib: float
    played_mib: float
    peak_mib: float
    real_time_factor: float


def strung_together(film: Path, folder: Path, groups: int) -> Path:
    """Make a capture of so many groups out of links to the frames of a shorter one."""
    (folder / "frames").mkdir(parents=True)
    for number in range(groups):
        os.link(film / "frames" / f"g{number % FILMED:06d}.tif", folder / "frames" / f"g{number:06d}.tif")
    manifest = (film / "capture.toml").read_text("utf-8")
    manifest = re.sub(r"^groups = \d+$", f"groups = {groups}", manifest, flags=re.MULTILINE)
    # places are nominal: the log is of the short film
    manifest = re.sub(r"^log = .*\n", "", manifest, flags=re.MULTILINE)
    (folder / "capture.toml").write_text(manifest, "utf-8")
    return folder


def played(folder: Path, out: Path) -> Played:
    """Play a capture; meant to run in a process of its own."""
    capture = open_capture(folder)
    learned: list[float] = []
    memory_mib: dict[int, float] = {}

    def noted(done: int, total: int, what: str) -> None:
        if what == "Learning":
            learned.append(time.perf_counter())
        elif done in (total // 2, total):
            memory_mib[done] = peak_mib()

    started = time.perf_counter()
    work = Work(usual_executor(WORKERS, capture.group_count))
    play(capture, load_recipe("best"), out, Settings(workers=WORKERS), progress=noted, work=work)
    playing = learned[-1]
    playing_s = time.perf_counter() - playing
    sounding_s = float(capture.bench.rotation.time_of_arc_s(capture.bench.passage_length_m))
    return Played(
        capture.group_count,
        playing - started,
        playing_s,
        memory_mib[capture.group_count // 2],
        memory_mib[capture.group_count],
        peak_mib(),
        sounding_s / playing_s,
    )


def peak_mib() -> float:
    """Return the most memory that this process has had so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def page(rows: list[Played]) -> str:
    """Return the table."""
    lines = [
        "# Passages, short and long",
        "",
        "    python -m benchmarks.speed.passage --table benchmarks/speed/passage.md",
        "",
        f"`play` with `best` and {WORKERS} workers, threads or (from {MANY_GROUPS} groups on) processes, as the command "
        "does, from uncompressed TIFF (12 frames of 1280 × 512 a group) to sound files, report and picture; learning takes "
        "its 64 groups however long the passage is.",
        "*× the one before*: the passage is twice as long, so this should be 2.00, but for what is done once (processes "
        "started, compiled code loaded, the tonearm's first lesson, report and picture): some four seconds. "
        "*Memory*: the most that the client had by half of the passage, by all of it, and with report and picture.",
        "",
        "| groups | learning s | playing s | × the one before | ms a group | ms each further group "
        "| client's memory MiB: half way | all played | in the end "
        "| real-time factor of playing |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for before, row in zip([None, *rows], rows, strict=False):
        times, further = "–", "–"
        if before:
            times = f"{row.playing_s / before.playing_s:.2f}"
            further = f"{(row.playing_s - before.playing_s) / (row.groups - before.groups) * 1e3:.1f}"
        lines.append(
            f"| {row.groups} | {row.learning_s:.1f} | {row.playing_s:.2f} | {times} | {row.playing_s / row.groups * 1e3:.1f} "
            f"| {further} | {row.half_mib:.0f} | {row.played_mib:.0f} | {row.peak_mib:.0f} | {row.real_time_factor:.4f} |"
        )
    return "\n".join([*lines, ""])


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", default="512,1024,2048,4096,8192,16384", help="lengths, each twice the one before")
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        filmed_capture(folder / "film", FILMED)
        for groups in (int(n) for n in given.groups.split(",")):
            capture = strung_together(folder / "film", folder / str(groups), groups)
            # a plain process: one of a pool may have no children
            context = multiprocessing.get_context("spawn")
            with context.Manager() as manager:
                answer = manager.dict()
                process = context.Process(target=_answered, args=(answer, capture, folder / f"out{groups}"))
                process.start()
                process.join()
                rows.append(answer["played"])
            print(rows[-1], flush=True)
    if given.table:
        given.table.write_text(page(rows), "utf-8")
    print(page(rows))
    return 0


def _answered(answer: dict[str, Played], capture: Path, out: Path) -> None:
    answer["played"] = played(capture, out)


if __name__ == "__main__":
    raise SystemExit(main())
