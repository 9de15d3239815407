"""Computes rows in processes of their own, a group each: what fails or is interrupted costs itself and no other.

A process writes its row's file when it is done, so that whatever ends the run, finished rows are kept, and the next run
computes what is missing.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from skillframe.errors import SkillframeError
from skillframe.extend.records import RowRun
from skillframe.extend.registry import registry
from skillframe_papers import store
from skillframe_papers.ending import Ending, end_all, end_with_parent
from skillframe_papers.jobs import Job

Tell = Callable[[str], None]


class RowFailed(SkillframeError):
    """Rows that could not be computed, because of what they were given; says which and why."""


class Outcome(NamedTuple):
    """What became of the jobs.

    Attributes:
        entries: finished rows, in the order of the jobs.
        refused: sentences about rows that refused their settings.
        broken: sentences about rows that ended in an internal error.
        ended_by: number of the signal that came before the end (Ctrl-C, SIGTERM), 0 if none.
    """

    entries: list[dict[str, Any]]
    refused: list[str]
    broken: list[str]
    ended_by: int


def run(jobs: Sequence[Job], folder: Path, *, workers: int, fresh: bool, tell: Tell) -> Outcome:
    """Compute what is missing of some rows.

    Args:
        jobs: the rows.
        folder: where rows are kept.
        workers: how many at a time.
        fresh: compute those that are there, too.
        tell: is told what happens.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # several processes share the machine
    missing = [job for job in jobs if fresh or store.kept(folder, job) is None]
    if len(missing) < len(jobs):
        tell(f"{len(jobs) - len(missing)} of {len(jobs)} rows are there already in {folder}")
    pool = _Pool(folder, max(1, workers), tell)
    ended_by = pool.work_off(_groups(missing))
    found = [entry for job in jobs if (entry := store.kept(folder, job)) is not None]
    return Outcome(found, pool.refused, pool.broken, ended_by)


def _groups(jobs: Sequence[Job]) -> list[list[Job]]:
    found: dict[str, list[Job]] = {}
    for job in jobs:
        found.setdefault(job.group, []).append(job)
    return list(found.values())


class _Running(NamedTuple):
    """A process that works off the jobs of a group."""

    process: BaseProcess
    receiver: Connection
    open: list[str]  # rows that it has not told the end of


class _Pool:
    """At most so many processes at a time, a group of rows each."""

    def __init__(self, folder: Path, workers: int, tell: Tell) -> None:
        self._folder, self._workers, self._tell = folder, workers, tell
        self._running: list[_Running] = []
        self.refused: list[str] = []
        self.broken: list[str] = []

    def work_off(self, groups: Sequence[Sequence[Job]]) -> int:
        """Do the jobs of all groups; the number of the signal that ended it, or 0."""
        waiting = list(groups)
        with Ending() as ending:
            try:
                while (waiting or self._running) and not ending.signal:
                    while waiting and len(self._running) < self._workers:
                        self._begin(waiting.pop(0))
                    wait([*(each.receiver for each in self._running), ending.wake])
                    self._collect()
            finally:
                end_all([each.process for each in self._running])
        return ending.signal

    def _begin(self, jobs: Sequence[Job]) -> None:
        for job in jobs:
            store.path_of(self._folder, job.row).unlink(missing_ok=True)
        context = multiprocessing.get_context("spawn")
        receiver, sender = context.Pipe(duplex=False)
        described = [store.described(job) for job in jobs]
        process = context.Process(target=_compute_all, args=(described, str(self._folder), sender), daemon=True)
        process.start()
        sender.close()
        rows = [job.row for job in jobs]
        self._tell(f"row{'s' if len(rows) > 1 else ''} {', '.join(rows)}: started")
        self._running.append(_Running(process, receiver, rows))

    def _collect(self) -> None:
        for each in list(self._running):
            try:
                while each.receiver.poll():
                    self._note(each, *each.receiver.recv())
            except EOFError:  # the process has ended
                each.process.join()
                self._running.remove(each)
                for row in list(each.open):
                    self._note(each, row, "broken", f"its process ended with code {each.process.exitcode}")

    def _note(self, running: _Running, row: str, kind: str, text: str) -> None:
        running.open.remove(row)
        self._tell(f"row {row}: {text}")
        if kind != "done":
            (self.refused if kind == "refused" else self.broken).append(f"row {row}: {text}")


def _compute_all(described: Sequence[dict[str, Any]], folder: str, sender: Connection) -> None:
    """Compute rows one after another and keep each; runs in a process of its own."""
    end_with_parent()
    sys.stdout = sys.stderr  # whatever a row prints, stdout is the command's
    for each in described:
        job = Job(**each)
        sender.send((job.row, *_compute(job, Path(folder))))


def _processor_time() -> float:
    """Of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _compute(job: Job, folder: Path) -> tuple[str, str]:
    def tell(text: str) -> None:
        print(f"row {job.row}: {text}", file=sys.stderr, flush=True)

    try:
        row, began, spent = registry().row(job.row), perf_counter(), _processor_time()
        result = row.run(RowRun(settings=job.settings, seed=job.seed, quick=job.quick, tell=tell))
        seconds = perf_counter() - began
        store.keep(folder, store.entry(row, job, result, seconds, _processor_time() - spent))
    except SkillframeError as error:
        return "refused", str(error)
    except Exception as error:  # the other rows go on; the command ends with an internal error
        return "broken", f"{type(error).__name__}: {error}"
    return "done", f"{store.verdict(row, result)} after {seconds:.0f} s: {result.ours}"
