"""Jobs on local or remote workers through Dask `distributed`.

Dask retries no task (`allowed-failures` 0; the driver decides). A worker has one thread and one job at a time, sent to
it by name, so its death is that of its job. A local scheduler listens on 127.0.0.1 with a temporary TLS key, since it
executes code. Dask does not notice a hang: a watchdog (`worker`) ends the worker.
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
from skillframe.campaign.driver import Answer, Died, Raised, is_trouble, said
from skillframe.campaign.jobs import WorkT
from skillframe.campaign.provenance import Identity
from skillframe.campaign.rows import Row
from skillframe.campaign.worker import guarded, share_file
from skillframe.errors import InputError

THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CONNECT_S = 30.0
LOOK_S, TELL_S = 0.1, 1.0
GONE_S = 5.0
"""Wall time after which a job whose worker is gone is given up."""
_MEMORY_LOGGER = "distributed.nanny.memory"


class _MemoryDeaths(logging.Handler):
    """Remembers from Dask's log which workers were ended for their memory."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self._messages.append(record.getMessage())

    def has(self, address: str) -> bool:
        return any(f"{address} " in message for message in self._messages)


@dataclass(slots=True, kw_only=True)
class _Task(Generic[WorkT]):
    """A job, the workers that it had trouble on, and where it runs now."""

    job: WorkT
    tried: set[str] = field(default_factory=set)
    worker: str = ""
    watch: Path = Path()
    gone_since: float | None = None


class ClusterPool(Generic[WorkT]):
    """A pool of Dask workers, one job each.

    Args:
        evaluate: function that the workers can import.
        seconds: wall time that a job may take without progress; may be infinite.
        workers: number of local processes, without `scheduler`.
        scheduler: address of a running scheduler, whose workers see `watch` under the same path.
        memory_bytes: limit per local worker; None divides the machine's.
        watch: folder for the workers' files; created here, removed at the end.
        ours: identity that workers must match.
        needed: distributions of plug-ins that workers must have.
        tell: receives how many rows' worth of the jobs in flight is done.
        note: receives a sentence about each refused worker.

    Raises:
        SchedulerError: the scheduler does not answer or has no worker.
        InputError: `watch` is not a folder of workers.
    """

    def __init__(
        self, evaluate: Callable[[WorkT], list[Row]], seconds: float, *, watch: Path, ours: Identity, needed: set[str],
        tell: Callable[[float], None], note: Callable[[str], None], workers: int = 1, scheduler: str | None = None,
        memory_bytes: int | None = None,
    ) -> None:  # fmt: skip
        import dask
        import distributed  # noqa: F401  its defaults must exist before one is overridden and restored

        self._evaluate, self._seconds, self._watch, self._tell = evaluate, seconds, watch, tell
        self.ran_on: Mapping[str, str] = ours.environment
        self._stack = ExitStack()
        try:
            if not self._watch.is_symlink():
                shutil.rmtree(self._watch, ignore_errors=True)
            try:
                self._watch.mkdir(mode=0o700)
            except FileExistsError:
                raise InputError(self._watch, "is not a folder of workers", "delete it") from None
            self._stack.callback(shutil.rmtree, self._watch, ignore_errors=True)
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
            self._memory = handler
            settings = {
                "distributed.scheduler.allowed-failures": 0,
                "distributed.worker.profile.enabled": False,  # stacks, sampled at 100 Hz, which nobody reads
                "distributed.admin.tick.interval": "1s",  # interval of measuring the event loop's delay
            }
            self._stack.enter_context(dask.config.set(settings))
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
        """How many jobs may be in flight."""
        return self._crew.size if self._crew.present else max(1, self._planned)

    def _start(self, workers: int, memory_bytes: int | None) -> Any:
        from distributed import Client, LocalCluster
        from distributed.security import Security
        from distributed.system import MEMORY_LIMIT

        # without an address the scheduler's health checks would listen on port 8787
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
        """Queue a job for the next free worker."""
        self._waiting.append(_Task(job=job))
        self._assign()

    def _assign(self) -> None:
        busy = {task.worker for task in self._flying.values()}
        for address in [a for a in self._crew.usable if a not in busy]:
            open_to = (t for t in self._waiting if address not in t.tried or not self._crew.others(t.tried))
            task = next(open_to, None)
            if task is not None:
                self._waiting.remove(task)
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
        due = time.monotonic() + TELL_S
        while True:
            self._ended.clear()
            ended = next((f for f, task in self._flying.items() if f.done() or self._is_gone(task)), None)
            if ended is not None:
                return ended
            self._crew.look()
            self._assign()
            self._ended.wait(LOOK_S if self._flying else 0.01)
            if time.monotonic() >= due:
                self._tell(sum(_share(task.watch) * task.job.size for task in self._flying.values()))
                due = time.monotonic() + TELL_S

    def _is_gone(self, task: _Task[WorkT]) -> bool:
        """Whether a job's worker has been gone for `GONE_S`. Dask would wait for it to return."""
        if task.worker in self._crew.present:
            task.gone_since = None
            return False
        task.gone_since = task.gone_since or time.monotonic()
        return time.monotonic() - task.gone_since > GONE_S

    def _answer(self, future: Any, task: _Task[WorkT]) -> Answer | None:
        """The answer of a job. None if its worker left before it began, or before its rows were fetched."""
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        if not future.done():
            future.cancel()
            self._crew.lost(task.worker)
            return Died("killed") if task.watch.exists() else None
        # future.result(), when interrupted, makes Dask cancel half a gather and log the errors of the other half
        gathered = asyncio.run_coroutine_threadsafe(
            self._client.gather(future, asynchronous=True), self._client.loop.asyncio_loop
        )
        try:
            while not wait([gathered], timeout=LOOK_S).done:
                self._crew.look()
                if self._is_gone(task):  # no other worker may compute the rows again
                    gathered.cancel()
                    future.cancel()
                    return None
            answer: list[Row] | Raised = gathered.result()
        except KilledWorker as error:
            self._crew.lost(task.worker)
            if task.watch.exists() and "Timeout (" in task.watch.read_text(encoding="utf-8", errors="replace"):
                return Died("time limit")
            return Died("memory" if self._memory.has(error.last_worker.address) else "killed")
        except FutureCancelledError as error:  # the scheduler is gone
            raise SchedulerError(f"the scheduler was lost ({error}); finished rows are kept, resume to go on") from None
        except Exception as error:  # outside a trial: the worker cannot import the job, or a row cannot be sent
            return Raised(f"{said(error)} (worker {task.worker})", trouble=is_trouble(error))
        self.ran_on = self._crew.usable.get(task.worker, self.ran_on)
        if isinstance(answer, Raised) and answer.trouble:
            return answer._replace(text=f"{answer.text} (worker {task.worker})")
        return answer

    def _goes_elsewhere(self, task: _Task[WorkT], answer: Answer) -> bool:
        """Whether a job with trouble of the environment goes to another worker. Its worker is set aside."""
        if not isinstance(answer, Raised) or not answer.trouble or (answer.memory and task.job.size > 1):
            return False
        task.tried.add(task.worker)
        if len(task.tried) >= 3 or not self._crew.others(task.tried):
            return False
        self._crew.set_aside(task.worker, answer.text)
        return True

    def close(self) -> None:
        """Cancel all jobs, and end the workers that this process started."""
        for future in list(self._flying):
            future.cancel()
        self._crew.close()
        self._stack.close()


def _share(watch: Path) -> float:
    try:
        return float(share_file(watch).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return 0.0
