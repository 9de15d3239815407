"""Compute rows in a campaign's pool of workers, a group each, whose failures stay separate.

A worker writes each finished row to a file, and the next run computes what is missing. Rows report no progress, so
there is no time limit.
"""

from __future__ import annotations

import math
import os
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, NamedTuple

from skillframe.campaign import WHY, Answer, ClusterPool, Died, Pool, identity
from skillframe.errors import SkillframeError
from skillframe.extend import RowRun, registry
from skillframe_papers import store
from skillframe_papers.jobs import Job

Tell = Callable[[str], None]
WATCH = "watch"
"""Folder of the running workers' files, beside the rows."""


class RowFailed(SkillframeError):
    """Rows that could not be computed with their settings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Rows that one worker computes in sequence.

    Attributes:
        jobs: the rows.
        folder: of their files.
    """

    jobs: tuple[Job, ...]
    folder: Path

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.jobs)


class Outcome(NamedTuple):
    """Result of the jobs.

    Attributes:
        entries: finished rows, in the order of the jobs.
        refused: sentences about rows that refused their settings, and about missing workers.
        broken: sentences about rows that ended in an internal error.
        interrupted: Ctrl-C or SIGTERM came before the end.
    """

    entries: list[dict[str, Any]]
    refused: list[str]
    broken: list[str]
    interrupted: bool


def run(jobs: Sequence[Job], folder: Path, *, workers: int, fresh: bool, tell: Tell) -> Outcome:
    """Compute what is missing of some rows.

    Args:
        jobs: the rows.
        folder: of the rows' files; made if absent.
        workers: at a time.
        fresh: compute existing rows, too.
        tell: called with messages.
    """
    missing = [job for job in jobs if fresh or store.kept(folder, job) is None]
    if len(missing) < len(jobs):
        tell(f"{len(jobs) - len(missing)} of {len(jobs)} rows are there already in {folder}")
    session = _Session(tell=tell)
    interrupted = False
    try:
        by_group: dict[str, list[Job]] = {}
        for job in missing:
            by_group.setdefault(job.group, []).append(job)
        session.work_off([Group(jobs=tuple(each), folder=folder.resolve()) for each in by_group.values()], workers)
    except KeyboardInterrupt:
        interrupted = True
    except SkillframeError as error:  # of the pool; a row's own is caught where it is computed
        session.refused.append(str(error))
    found = [entry for job in jobs if (entry := store.kept(folder, job)) is not None]
    return Outcome(found, session.refused, session.broken, interrupted)


@dataclass(slots=True, kw_only=True)
class _Session:
    """One call's work, and rows whose end is not yet reported."""

    tell: Tell
    refused: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    flying: list[Group] = field(default_factory=list)
    told: set[str] = field(default_factory=set)

    def work_off(self, groups: Sequence[Group], workers: int) -> None:
        """Compute all groups, one for each worker at a time.

        Raises:
            SchedulerError: no workers.
            KeyboardInterrupt: the workers are ended; finished rows are kept.
        """
        if not groups:
            return
        groups[0].folder.mkdir(parents=True, exist_ok=True)
        pool = ClusterPool(
            compute, math.inf, workers=min(max(1, workers), len(groups)), watch=groups[0].folder / WATCH,
            ours=identity(plugins=False), needed=set(), tell=lambda share: self._tell_ends(), note=self.tell,
        )  # fmt: skip
        with closing(pool):
            waiting = deque(groups)
            while waiting or self.flying:
                while waiting and len(self.flying) < pool.size:
                    self._begin(pool, waiting.popleft())
                group, answer = pool.next()
                self._tell_ends()
                self.flying.remove(group)
                self._note(group, answer)

    def _begin(self, pool: Pool[Group], group: Group) -> None:
        for job in group.jobs:
            store.path_of(group.folder, job.row).unlink(missing_ok=True)
        rows = [job.row for job in group.jobs]
        self.tell(f"row{'s' if len(rows) > 1 else ''} {', '.join(rows)}: started")
        self.flying.append(group)
        pool.submit(group)

    def _tell_ends(self) -> None:
        for group in self.flying:
            for job in group.jobs:
                entry = None if job.row in self.told else store.kept(group.folder, job)
                if entry is not None:
                    self.told.add(job.row)
                    took = f"{entry['wall_s']:.0f} s ({entry['cpu_s']:.0f} s of processor time)"
                    self.tell(f"row {job.row}: {entry['verdict']} after {took}: {entry['ours']}")

    def _note(self, group: Group, answer: Answer) -> None:
        failed = answer if isinstance(answer, list) else []
        if not isinstance(answer, list):
            text = f"its process {WHY[answer.cause]}" if isinstance(answer, Died) else answer.text
            lost = [job.row for job in group.jobs if job.row not in self.told]
            failed = [{"row": row, "kind": "broken", "text": text} for row in lost]
        for each in failed:
            text = f"row {each['row']}: {each['text']}"
            self.tell(text)
            (self.refused if each["kind"] == "refused" else self.broken).append(text)


def compute(group: Group) -> list[dict[str, Any]]:
    """Compute and store rows in a worker.

    Returns:
        of each row that could not be computed: `row`, `kind` ("refused" its settings, or "broken") and `text`.
    """
    failed = []
    with redirect_stdout(sys.stderr):  # a row's prints must not reach the command's stdout
        for job in group.jobs:
            problem = _compute(job, group.folder)
            if problem is not None:
                failed.append({"row": job.row, "kind": problem[0], "text": problem[1]})
    return failed


def _processor_time() -> float:
    """Processor time of this process and its ended children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _compute(job: Job, folder: Path) -> tuple[Literal["refused", "broken"], str] | None:
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
    return None
