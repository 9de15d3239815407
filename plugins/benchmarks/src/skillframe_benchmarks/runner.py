"""Many assemblies in a campaign's pool of workers, whose failures stay separate."""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing, redirect_stdout
from pathlib import Path
from typing import Any

from skillframe.campaign import WHY, ClusterPool, Died, FolderLock, Raised, identity
from skillframe_benchmarks import assembly
from skillframe_benchmarks.assembly import DONE, AssemblyJob

Tell = Callable[[str], None]
WATCH = "watch"


def run(jobs: Sequence[AssemblyJob], out: Path, workers: int, tell: Tell) -> list[str]:
    """Run what is missing, keeping finished results.

    Args:
        jobs: the assemblies.
        out: folder of the whole benchmark.
        workers: assemblies at a time.
        tell: called with messages.

    Returns:
        sentences about assemblies that ended in an internal error.

    Raises:
        InputError: another process runs the same benchmark.
        SchedulerError: no workers.
        KeyboardInterrupt: Ctrl-C; the workers are ended.
    """
    out.mkdir(parents=True, exist_ok=True)
    with FolderLock(out):
        waiting = deque(job for job in jobs if not (job.folder / DONE).exists())
        if len(waiting) < len(jobs):
            tell(f"{len(jobs) - len(waiting)} of {len(jobs)} assemblies are there already in {out}")
        if not waiting:
            return []
        pool = ClusterPool(
            compute, math.inf, workers=min(workers, len(waiting)), watch=out / WATCH, ours=identity(plugins=False),
            needed=set(), tell=lambda share: None, note=tell,
        )  # fmt: skip
        with closing(pool):
            return _work_off(pool, waiting, tell)


def _work_off(pool: Any, waiting: deque[AssemblyJob], tell: Tell) -> list[str]:
    broken: list[str] = []
    flying, left = 0, len(waiting)
    while waiting or flying:
        while waiting and flying < pool.size:
            pool.submit(waiting.popleft())
            flying += 1
        job, answer = pool.next()
        flying, left = flying - 1, left - 1
        if isinstance(answer, Died | Raised):
            why = f"its process {WHY[answer.cause]}" if isinstance(answer, Died) else answer.text
            broken.append(f"{job.pair.name}: {why}")
            tell(broken[-1])
        else:
            for text in answer:
                tell(text["text"])
        tell(f"{left} assemblies to go")
    return broken


def compute(job: AssemblyJob) -> list[dict[str, Any]]:
    """Run one assembly in a worker.

    Returns:
        messages, a `text` each.
    """
    told: list[dict[str, Any]] = []
    with redirect_stdout(sys.stderr):
        assembly.run(job, lambda text: told.append({"text": text}))
    return told
