"""Jobs on other processes or machines through Dask `distributed`: the same engine locally and on a cluster.

Measured settings: no task is retried on another worker (`allowed-failures` 0, the driver decides), one thread per
worker, no dashboard, memory limited so that a hog is ended and not the machine. A local scheduler listens on 127.0.0.1
only, and speaks TLS with a key that is made for it and kept in memory, so that nobody else on the machine can hand it
code. Dask never notices a hang, so each job carries a watchdog (`worker`); a hang thus becomes a death like any other.

A job is sent to one worker by name, and a worker has one job at a time. So a worker's death is its own job's, and
trouble of the environment on one worker sets that worker aside and sends the job to another.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import wait
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, Generic

from skillframe.campaign.crew import Crew, SchedulerError
from skillframe.campaign.driver import Answer, Died, Raised
from skillframe.campaign.identity import Identity
from skillframe.campaign.rows import Row
from skillframe.campaign.trouble import is_trouble, said
from skillframe.campaign.work import WorkT
from skillframe.campaign.worker import guarded, share_file
from skillframe.errors import InputError

THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CONNECT_S = 30.0
SOON_S, LOOK_S, TELL_S = 0.01, 0.1, 1.0
GONE_S = 5.0
"""Wall time after which a job whose worker is gone is given up, should Dask not say so itself."""
TRIES = 3
"""Workers on which a job meets trouble of the environment before the campaign stops."""
_MEMORY_LOGGER = "distributed.nanny.memory"
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.worker.profile.enabled": False,  # a hundred looks a second at what a worker runs, which nobody reads
    "distributed.admin.tick.interval": "1s",  # as often it is looked how late an event loop is
}


class _MemoryDeaths(logging.Handler):
    """Remembers which workers Dask ended for their memory, from what it logs."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self._messages.append(record.getMessage())

    def has(self, address: str) -> bool:
        return any(f"{address} " in message for message in self._messages)


@dataclass(slots=True, kw_only=True)
class _Task(Generic[WorkT]):
    """A job on its way: the workers it met trouble on, and where it runs now."""

    job: WorkT
    tried: set[str] = field(default_factory=set)
    worker: str = ""
    watch: Path = Path()
    gone_since: float | None = None


class ClusterPool(Generic[WorkT]):
    """A pool of Dask workers, one job each.

    Args:
        evaluate: importable in the workers.
        seconds: wall time that a job may take without progress; infinite: for ever.
        workers: number of local processes, where no scheduler is given.
        scheduler: address of a running scheduler, whose workers see `watch` under the same path.
        memory_bytes: limit per local worker; None shares the machine's memory between them and this process.
        watch: folder for the workers' files, seen by all of them: made here, and removed at the end.
        ours: what this process is; workers must be the same.
        needed: distributions of plug-ins that the workers must have.
        tell: told now and then how many rows' worth of the jobs in flight is done.
        note: told, in a sentence, of workers that get no work.

    Raises:
        SchedulerError: the scheduler does not answer or has no worker.
        InputError: something else lies where the workers' files belong.
    """

    def __init__(
        self, evaluate: Callable[[WorkT], list[Row]], seconds: float, *, watch: Path, ours: Identity, needed: set[str],
        tell: Callable[[float], None], note: Callable[[str], None], workers: int = 1, scheduler: str | None = None,
        memory_bytes: int | None = None,
    ) -> None:  # fmt: skip
        import dask
        import distributed  # noqa: F401  its defaults must be there before one of them is set, and set back

        self._evaluate, self._seconds, self._watch, self._tell = evaluate, seconds, watch, tell
        self.ran_on: Mapping[str, str] = ours.environment
        self._stack = ExitStack()
        try:
            self._make_room()
            self._memory = self._listen()
            self._stack.enter_context(dask.config.set(_SETTINGS))
            self._client = self._connect(scheduler) if scheduler else self._start(workers, memory_bytes)
        except BaseException:
            self._stack.close()
            raise
        self._crew = Crew(self._client, ours, needed, note, own=scheduler is None)
        self._planned = len(self._client.nthreads())
        self._waiting: deque[_Task[WorkT]] = deque()
        self._flying: dict[Any, _Task[WorkT]] = {}
        self._ended = threading.Event()
        self._number = count()

    @property
    def size(self) -> int:
        """How many jobs may be in flight. Before the first look, as many as there are workers."""
        return self._crew.size if self._crew.present else max(1, self._planned)

    def _make_room(self) -> None:
        """An empty folder for the workers' files. What a killed session left there goes, and no link is followed."""
        if not self._watch.is_symlink():
            shutil.rmtree(self._watch, ignore_errors=True)
        try:
            self._watch.mkdir(mode=0o700)
        except FileExistsError:
            raise InputError(self._watch, "is not a folder of workers", "delete it") from None
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
        from distributed.security import Security
        from distributed.system import MEMORY_LIMIT

        # even without a dashboard the scheduler listens for health checks, on port 8787 unless told otherwise
        try:
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1",
                silence_logs=logging.CRITICAL, memory_limit=memory_bytes or MEMORY_LIMIT // (workers + 1), env=THREADS,
                preload=["skillframe.campaign.worker"], scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                security=Security.temporary(), protocol="tls://",
            )  # fmt: skip
            self._stack.enter_context(cluster)
            return self._stack.enter_context(Client(cluster, set_as_default=False))
        except (OSError, RuntimeError, ValueError, TimeoutError) as error:
            raise SchedulerError(
                f"the {workers} workers could not be started ({said(error)}); try again, with fewer workers, or without"
            ) from None

    def _connect(self, address: str) -> Any:
        from distributed import Client

        try:
            client = self._stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
            client.wait_for_workers(1, timeout=CONNECT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise SchedulerError(
                f"scheduler {address} cannot be used ({type(error).__name__}: {error}); check that it and its workers "
                "run"
            ) from None
        return client

    def submit(self, job: WorkT) -> None:
        """Send a job to a worker that is free, as soon as there is one."""
        self._waiting.append(_Task(job=job))
        self._assign()

    def _assign(self) -> None:
        """Hand waiting jobs to free workers."""
        busy = {task.worker for task in self._flying.values()}
        for address in [a for a in self._crew.usable if a not in busy]:
            open_to = (t for t in self._waiting if address not in t.tried or not self._crew.others(t.tried))
            task = next(open_to, None)
            if task is not None:
                self._waiting.remove(task)
                self._send(task, address)

    def _send(self, task: _Task[WorkT], address: str) -> None:
        task.worker, task.gone_since = address, None
        task.watch = self._watch / f"job-{next(self._number)}.txt"
        future = self._client.submit(
            guarded, self._evaluate, task.job, self._seconds, str(task.watch), pure=False, workers=[address],
            allow_other_workers=False,
        )  # fmt: skip
        self._flying[future] = task
        future.add_done_callback(lambda _: self._ended.set())

    def next(self) -> tuple[WorkT, Answer]:
        """Wait for the next job to end."""
        while True:
            future = self._wait()
            task = self._flying.pop(future)
            try:
                answer = self._answer(future, task)
            finally:
                future.release()
                for path in (task.watch, share_file(task.watch)):
                    with suppress(OSError):
                        path.unlink(missing_ok=True)
            if answer is None or self._goes_elsewhere(task, answer):
                self._waiting.appendleft(task)
            else:
                return task.job, answer

    def _wait(self) -> Any:
        """A job's future that has ended. Meanwhile look after the workers, and tell how far those in flight are."""
        due = time.monotonic() + TELL_S
        while True:
            self._ended.clear()
            ended = next((f for f, task in self._flying.items() if f.done() or self._is_gone(task)), None)
            if ended is not None:
                return ended
            self._crew.look()
            self._assign()
            self._ended.wait(LOOK_S if self._flying else SOON_S)
            if time.monotonic() >= due:
                self._tell(sum(_share(task.watch) * task.job.size for task in self._flying.values()))
                due = time.monotonic() + TELL_S

    def _is_gone(self, task: _Task[WorkT]) -> bool:
        """Whether a job's worker left some time ago and Dask, told to use no other, waits for it to come back."""
        if task.worker in self._crew.present:
            task.gone_since = None
            return False
        task.gone_since = task.gone_since or time.monotonic()
        return time.monotonic() - task.gone_since > GONE_S

    def _answer(self, future: Any, task: _Task[WorkT]) -> Answer | None:
        """What became of a job. None if its worker left before it began, or with the rows before they were fetched."""
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        if not future.done():
            future.cancel()
            self._crew.lost(task.worker)
            return Died("killed") if task.watch.exists() else None
        # not future.result(): interrupted there, Dask cancels half a gather and logs what its other half then raises
        gathered = asyncio.run_coroutine_threadsafe(
            self._client.gather(future, asynchronous=True), self._client.loop.asyncio_loop
        )
        try:
            if not self._fetched(gathered, task):
                gathered.cancel()
                future.cancel()
                return None
            answer: list[Row] | Raised = gathered.result()
        except KilledWorker as error:
            self._crew.lost(task.worker)
            return Died(self._cause(error.last_worker.address, task.watch))
        except FutureCancelledError as error:  # the scheduler itself is gone
            raise SchedulerError(f"the scheduler was lost ({error}); finished rows are kept, resume to go on") from None
        except Exception as error:  # outside a trial: the worker cannot import what it was sent, a row cannot be sent
            return Raised(f"{said(error)} (worker {task.worker})", trouble=is_trouble(error))
        self.ran_on = self._crew.usable.get(task.worker, self.ran_on)
        if isinstance(answer, Raised) and answer.trouble:
            return answer._replace(text=f"{answer.text} (worker {task.worker})")
        return answer

    def _fetched(self, gathered: Any, task: _Task[WorkT]) -> bool:
        """Wait for rows on their way. False if their worker died with them, for no other worker may make them again."""
        while not wait([gathered], timeout=LOOK_S).done:
            self._crew.look()
            if self._is_gone(task):
                return False
        return True

    def _goes_elsewhere(self, task: _Task[WorkT], answer: Answer) -> bool:
        """Whether trouble of the environment sends a job to another worker. The one that had it gets no more work."""
        if not isinstance(answer, Raised) or not answer.trouble or (answer.memory and task.job.size > 1):
            return False
        task.tried.add(task.worker)
        if len(task.tried) >= TRIES or not self._crew.others(task.tried):
            return False
        self._crew.set_aside(task.worker, answer.text)
        return True

    def _cause(self, address: str, watch: Path) -> str:
        if watch.exists() and "Timeout (" in watch.read_text(encoding="utf-8", errors="replace"):
            return "time limit"
        return "memory" if self._memory.has(address) else "killed"

    def close(self) -> None:
        """End all jobs and, where they are ours, the workers."""
        for future in list(self._flying):
            future.cancel()
        self._crew.close()
        self._stack.close()


def _share(watch: Path) -> float:
    """How far a job says that it is. Nothing said yet, or half a number, is no progress."""
    try:
        return float(share_file(watch).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return 0.0
