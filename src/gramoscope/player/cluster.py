"""Pieces read by the workers of Dask distributed: those of a cluster that runs already, or a small one on this machine.

What starts the workers is Dask's affair: SSH, SLURM, Kubernetes, a terminal. They must have Gramoscope in the same version, and
see capture and store under the same paths.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from gramoscope.errors import ArgumentError, WorkerError, require
from gramoscope.player.executors import AHEAD, Answer, Crew, LostWorkerError
from gramoscope.player.pieces import Reader, Task, read_elsewhere

INSTALL = 'pip install "gramoscope[cluster]"'
PATIENCE_S = 30.0
"""A scheduler that does not answer for so long is not there."""
SPAWN = "distributed.nanny.pre-spawn-environ"
TRIM = "MALLOC_TRIM_THRESHOLD_"
"""With it Dask has its workers give memory back at every turn; frames come and go by megabytes, and each page of them would be
asked for anew: a third of the time of a worker that reads."""


@dataclass(frozen=True)
class Cluster:
    """Workers of Dask.

    Parameters
    ----------
    scheduler : str or None
        Address of a scheduler; None starts one on this machine, with so many workers of one thread.
    workers : int
    told : callable
        Told where the dashboard is.
    """

    scheduler: str | None
    workers: int
    told: Callable[[str], None]

    def __post_init__(self) -> None:
        require(self.workers >= 1, f"{self.workers} workers", "at least one")

    def get_ready(self) -> None:
        """Nothing: somebody may still start the scheduler."""

    @contextmanager
    def crew(self, reader: Reader) -> Iterator[Crew]:
        """Give the workers of the cluster; those that join later are used too.

        Raises
        ------
        ArgumentError
            If Dask is not installed.
        WorkerError
            If nobody answers at the address, or has no workers.
        """
        distributed = _distributed()
        with _client(distributed, self.scheduler, self.workers) as client:
            if client.dashboard_link:
                self.told(f"watch the workers at {client.dashboard_link}")
            crew = _ClusterCrew(client, distributed)
            try:
                yield crew
            finally:
                crew.drop()


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise ArgumentError("Dask distributed is not installed", "the extra cluster", INSTALL) from error
    return distributed


@contextmanager
def _client(distributed: Any, scheduler: str | None, workers: int) -> Iterator[Any]:
    if scheduler is None:
        logging.getLogger("distributed").setLevel(logging.ERROR)
        import dask.config

        environ = {name: value for name, value in dask.config.get(SPAWN, {}).items() if name != TRIM}
        with dask.config.set({SPAWN: environ}):
            local = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", memory_limit=0
            )
        with local, distributed.Client(local) as client:
            yield client
        return
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE_S)
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise WorkerError(
            f"no Dask scheduler with workers answers at {scheduler}: {error}",
            "the address that `dask scheduler` prints, and at least one `dask worker`",
            "start them, or leave --scheduler out",
        ) from error
    with client:
        yield client


class _ClusterCrew:
    def __init__(self, client: Any, dask: Any) -> None:
        self._client, self._dask = client, dask
        self._under_way: set[Any] = set()

    @property
    def window(self) -> int:
        """Twice as many as there are threads at the moment: workers come and go."""
        with self._asking():
            return AHEAD * max(int(sum(self._client.nthreads().values())), 1)

    @property
    def dashboard(self) -> str:
        """Where people can watch."""
        return str(self._client.dashboard_link or "")

    def submit(self, task: Task) -> Answer:
        """Send a task; Dask sends it again when its worker is lost."""
        with self._asking():
            future = self._client.submit(read_elsewhere, task, pure=False)
        self._under_way.add(future)
        return _ClusterAnswer(future, self._client, self._dask, self._under_way)

    def drop(self) -> None:
        """Call off what nobody waits for any more."""
        with contextlib.suppress(OSError, self._dask.CancelledError, RuntimeError):
            self._client.cancel(list(self._under_way))

    @contextmanager
    def _asking(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError, self._dask.CancelledError) as error:
            raise _lost_scheduler(error) from error


def _lost_scheduler(error: BaseException) -> WorkerError:
    return WorkerError(
        f"the Dask scheduler was lost: {error!r}",
        "a scheduler that runs as long as the transfer",
        "start it again, and give the same command: what was read is kept",
    )


@dataclass(frozen=True)
class _ClusterAnswer:
    future: Any
    client: Any
    dask: Any
    under_way: set[Any]

    def result(self) -> None:
        """Wait, and let go of the future, so that neither scheduler nor client remembers it."""
        try:
            self.future.result()
        except self.dask.scheduler.KilledWorker as error:
            raise LostWorkerError(str(error)) from error
        except Exception as error:
            if self.client.status != "running" or isinstance(error, self.dask.CancelledError):
                raise _lost_scheduler(error) from error
            raise
        finally:
            self.under_way.discard(self.future)
            self.future.release()
