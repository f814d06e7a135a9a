"""How many workers are worth having when all read from the same storage, and what stops them?

    python -m benchmarks.speed.scaling [--group-ms 20 --client-ms 4.4] [--table benchmarks/speed/scaling.md]

A calculation, not a measurement: nobody had 256 workers. A worker takes its own time for a group (`--group-ms`), and waits for
what all share: the storage, for frames and for the reading that goes to disk and comes back, and the client, which splices and
smooths what was read, in order. That is a closed network of queues, solved exactly by mean value analysis (M. Reiser and
S. S. Lavenberg, J. ACM 27, 1980): with n workers, a visit to a shared place of demand D lasts D (1 + Q(n−1)), Q being the mean
queue there with one worker less. Times for a group are those of `benchmarks/speed/side.md`, of one machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
STORAGES = {"a disk or gigabit, 110 MB/s": 110e6, "a lab server, 1 GB/s": 1e9, "a parallel file system, 10 GB/s": 10e9}
GROUP_BYTES = 12 * 1280 * 512
SIDE_GROUPS = 250_000


def throughput(own_s: float, shared_s: Sequence[float], workers: int) -> float:
    """Return tasks a second of a closed network of queues.

    Parameters
    ----------
    own_s : float
        What a task takes that nobody else needs.
    shared_s : sequence of float
        What it takes at each shared place.
    workers : int
    """
    demand, queue, rate = np.asarray(shared_s, np.float64), np.zeros(len(shared_s)), 0.0
    for n in range(1, workers + 1):
        stay = demand * (1 + queue)
        rate = n / (own_s + float(stay.sum()))
        queue = rate * stay
    return rate


def shared_times(storage_bytes_s: float, store_bytes: float, client_s: float) -> dict[str, float]:
    """Return what a group takes at each shared place, seconds; the reading is written once and read once."""
    return {"storage": (GROUP_BYTES + 2 * store_bytes) / storage_bytes_s, "client": client_s}


def page(group_s: float, client_s: float, store_bytes: float) -> str:
    """Return the table."""
    lines = [
        "# Many workers, one storage",
        "",
        "    python -m benchmarks.speed.scaling --table benchmarks/speed/scaling.md",
        "",
        f"A calculation (how: see the program): {group_s * 1e3:.0f} ms of a worker and {client_s * 1e3:.1f} ms of the client, "
        f"{GROUP_BYTES / 1e6:.1f} MB of frames (12 of 1280 × 512) and {store_bytes / 1e6:.2f} MB of reading a group, as in",
        "[side.md](side.md). Speed-up against one worker, and how long a side of 250 000 groups takes.",
        "",
        "| workers | " + " | ".join(STORAGES) + " |",
        "|---|" + "---|" * len(STORAGES),
    ]
    alone = {name: throughput(group_s, _demands(b, store_bytes, client_s), 1) for name, b in STORAGES.items()}
    for workers in WORKERS:
        cells = []
        for name, bytes_s in STORAGES.items():
            rate = throughput(group_s, _demands(bytes_s, store_bytes, client_s), workers)
            cells.append(f"{rate / alone[name]:.1f} ×, {SIDE_GROUPS / rate / 3600:.1f} h")
        lines.append(f"| {workers} | " + " | ".join(cells) + " |")
    lines += ["", *(_why(name, group_s, b, store_bytes, client_s) for name, b in STORAGES.items()), ""]
    return "\n".join(lines)


def _demands(storage_bytes_s: float, store_bytes: float, client_s: float) -> list[float]:
    return list(shared_times(storage_bytes_s, store_bytes, client_s).values())


def _why(name: str, group_s: float, storage_bytes_s: float, store_bytes: float, client_s: float) -> str:
    shared = shared_times(storage_bytes_s, store_bytes, client_s)
    slowest = max(shared, key=lambda place: shared[place])
    knee = (group_s + sum(shared.values())) / shared[slowest]
    return (
        f"- {name}: the {slowest} stops it, at {1 / shared[slowest]:.0f} groups a second; more than {knee:.0f} workers "
        "mostly wait."
    )


def main() -> int:
    """Calculate."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--group-ms", type=float, default=20.0, help="a worker's own time for a group")
    parser.add_argument("--client-ms", type=float, default=4.4, help="the client's time for a group")
    parser.add_argument("--store-kb", type=float, default=425.0, help="what is kept of a group")
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    text = page(given.group_ms / 1e3, given.client_ms / 1e3, given.store_kb * 1e3)
    if given.table:
        given.table.write_text(text, "utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
