"""Jobs on other processes or machines through Dask `distributed`: the same engine locally and on a cluster.

Measured settings: no task is retried on another worker (`allowed-failures` 0, the driver decides), one thread per
worker, no dashboard, everything bound to 127.0.0.1, memory limited so that a hog is ended and not the machine. Dask
never notices a hang, so each job carries a watchdog, `faulthandler`'s C thread, that ends the worker even while a trial
holds the interpreter's lock; a hang thus becomes a death like any other.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any

from skillframe.campaign.driver import Answer, Died, Evaluate, Raised
from skillframe.campaign.rows import ChunkJob, Row
from skillframe.campaign.worker import guarded, share_file
from skillframe.errors import SkillframeError

THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CONNECT_S = 30.0
LOOK_S, TELL_S = 0.01, 1.0
_MEMORY_LOGGER = "distributed.nanny.memory"


class SchedulerError(SkillframeError):
    """A cluster that cannot be used; says why."""


class _MemoryDeaths(logging.Handler):
    """Remembers which workers Dask ended for their memory, from what it logs."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self._messages.append(record.getMessage())

    def has(self, address: str) -> bool:
        return any(f"{address} " in message for message in self._messages)


class ClusterPool:
    """A pool of Dask workers, one job each.

    Args:
        evaluate: importable in the workers.
        seconds: wall time a job may take.
        workers: number of local processes, where no scheduler is given.
        scheduler: address of a running scheduler, whose workers see the campaign's folder under the same path.
        memory_bytes: limit per local worker; None shares the machine's memory between them and this process.
        watch: folder for the workers' files, seen by all of them: made anew, and removed at the end.
        tell: told now and then how many trials' worth of the jobs in flight is done.

    Raises:
        SchedulerError: the scheduler does not answer, has no workers, or has workers of several threads.
    """

    def __init__(
        self, evaluate: Evaluate, seconds: Callable[[ChunkJob], float], *, watch: Path, tell: Callable[[float], None],
        workers: int = 1, scheduler: str | None = None, memory_bytes: int | None = None,
    ) -> None:  # fmt: skip
        import dask
        from distributed import as_completed

        self._evaluate, self._seconds, self._watch, self._tell = evaluate, seconds, watch, tell
        self._stack = ExitStack()
        try:
            self._make_room()
            self._memory = self._listen()
            self._stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            self._client = self._connect(scheduler) if scheduler else self._start(workers, memory_bytes)
            self.size = len(self._client.nthreads())
            self._completed: Any = as_completed(loop=self._client.loop)
        except BaseException:
            self._stack.close()
            raise
        self._jobs: dict[Any, tuple[ChunkJob, Path]] = {}
        self._number = count()

    def _make_room(self) -> None:
        """An empty folder for the workers' files; what a killed session left there goes."""
        shutil.rmtree(self._watch, ignore_errors=True)
        self._watch.mkdir(parents=True, exist_ok=True)
        self._stack.callback(shutil.rmtree, self._watch, ignore_errors=True)

    def _listen(self) -> _MemoryDeaths:
        handler, logger = _MemoryDeaths(), logging.getLogger(_MEMORY_LOGGER)
        before = logger.level, logger.propagate
        logger.addHandler(handler)
        logger.setLevel(logging.WARNING)
        logger.propagate = False

        def restore() -> None:
            logger.removeHandler(handler)
            logger.setLevel(before[0])
            logger.propagate = before[1]

        self._stack.callback(restore)
        return handler

    def _start(self, workers: int, memory_bytes: int | None) -> Any:
        from distributed import Client, LocalCluster
        from distributed.system import MEMORY_LIMIT

        # even without a dashboard the scheduler listens for health checks, on port 8787 unless told otherwise
        cluster = LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1",
            silence_logs=logging.CRITICAL, memory_limit=memory_bytes or MEMORY_LIMIT // (workers + 1), env=THREADS,
            preload=["skillframe.campaign.worker"], scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        )  # fmt: skip
        self._stack.enter_context(cluster)
        return self._stack.enter_context(Client(cluster, set_as_default=False))

    def _connect(self, address: str) -> Any:
        from distributed import Client

        try:
            client = self._stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
            client.wait_for_workers(1, timeout=CONNECT_S)
        except (OSError, ValueError, TimeoutError) as error:
            text = f"{type(error).__name__}: {error}"
            raise SchedulerError(
                f"scheduler {address} cannot be used ({text}); check that it and its workers run"
            ) from None
        several = [worker for worker, threads in client.nthreads().items() if threads != 1]
        if several:
            raise SchedulerError(f"worker {several[0]} runs several threads; start it with --nthreads 1")
        return client

    def submit(self, job: ChunkJob) -> None:
        """Send a job to whichever worker is free."""
        watch = self._watch / f"job-{next(self._number)}.txt"
        future = self._client.submit(guarded, self._evaluate, job, self._seconds(job), str(watch), pure=False)
        self._jobs[future] = job, watch
        self._completed.add(future)

    def next(self) -> tuple[ChunkJob, Answer]:
        """Wait for the next job to end."""
        self._wait()
        future = next(self._completed)
        job, watch = self._jobs.pop(future)
        try:
            return job, self._answer(future, watch)
        finally:
            future.release()
            for path in (watch, share_file(watch)):
                path.unlink(missing_ok=True)

    def _wait(self) -> None:
        """Until a job has ended; meanwhile tell how far those in flight are."""
        due = time.monotonic() + TELL_S
        while not self._completed.has_ready():
            time.sleep(LOOK_S)
            if time.monotonic() >= due:
                self._tell(sum(_share(watch) * len(job.trials) for job, watch in self._jobs.values()))
                due = time.monotonic() + TELL_S

    def _answer(self, future: Any, watch: Path) -> Answer:
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        # not future.result(): interrupted there, Dask cancels half a gather and logs what its other half then raises
        gathered = asyncio.run_coroutine_threadsafe(
            self._client.gather(future, asynchronous=True), self._client.loop.asyncio_loop
        )
        try:
            rows: list[Row] = gathered.result()
            return rows
        except KilledWorker as error:
            return Died(self._cause(error.last_worker.address, watch))
        except FutureCancelledError as error:  # the scheduler itself is gone
            raise SchedulerError(f"the scheduler was lost ({error}); finished rows are kept, resume to go on") from None
        except Exception as error:  # whatever a trial raised
            return Raised(error)

    def _cause(self, address: str, watch: Path) -> str:
        if watch.exists() and "Timeout (" in watch.read_text(encoding="utf-8", errors="replace"):
            return "time limit"
        return "memory" if self._memory.has(address) else "killed"

    def close(self) -> None:
        """End all jobs and, where they are ours, the workers."""
        for future in list(self._jobs):
            future.cancel()
        self._stack.close()


def _share(watch: Path) -> float:
    """How far a job says that it is; nothing said yet, or half a number, is no progress."""
    try:
        return float(share_file(watch).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return 0.0
