"""Runs a prepared campaign to its end, from wherever it stands: the first run and a resume are the same thing.

Rows are stored the moment a chunk ends; a kill loses the chunks in flight and nothing else. However it ends - done,
early, interrupted, failed - results.csv and summary.json are written from the rows that are there. Last, the first
trials and the first failures of each skill run once more to leave their traces; because a trial's row does not depend
on what runs beside it, that costs a few trials instead of traces of all.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.driver import Driver, Evaluate, InProcess, Pool, chunk_size
from skillframe.campaign.folder import COPIES, campaign_hash, load
from skillframe.campaign.lock import FolderLock
from skillframe.campaign.provenance import environment, file_hash, file_hashes
from skillframe.campaign.rows import TRACE, ChunkJob, Row, dead_row, differences
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.stopping import StopRule
from skillframe.campaign.store import RESULTS, RowLog, ordered, write_bytes, write_results
from skillframe.campaign.summary import summarize, write_summary

CHUNK = 64
"""Largest number of trials per job: batching has paid off by then, and a kill loses little."""
TRACES = 8
SAMPLE = 2
WATCH = "watch"
"""Folder in a campaign's folder for the files of the workers that run now."""


class Progress(NamedTuple):
    """How far a campaign is.

    Attributes:
        done: rows stored.
        total: rows planned.
        note: a sentence if there is something to say.
        under_way: how many rows' worth of the chunks in flight is done.
    """

    done: int
    total: int
    note: str = ""
    under_way: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a campaign runs; none of this changes its rows.

    Attributes:
        workers: local processes; None runs in this one.
        scheduler: address of a Dask scheduler to use instead.
        chunk: largest number of trials per job.
        time_limit_s: wall time a job may take; None is a minute plus a quarter second per simulated second and trial,
            several times what any world was measured to take.
        memory_bytes: limit per local worker; None shares the machine's.
        traces: how many trials per skill leave a trace: the first `SAMPLE`, then the first failures.
    """

    workers: int | None = None
    scheduler: str | None = None
    chunk: int = CHUNK
    time_limit_s: float | None = None
    memory_bytes: int | None = None
    traces: int = TRACES


def run_campaign(
    folder: Path, evaluate: Evaluate, options: Options | None = None, notify: Callable[[Progress], None] | None = None,
    params: type | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Run what is missing of a prepared campaign.

    Args:
        folder: made by `folder.prepare`.
        evaluate: runs a chunk; a function that worker processes can import.
        options: how to run.
        notify: told after every chunk, and now and then while chunks run.
        params: the world's parameter dataclass; None looks it up.

    Returns:
        the summary, as in summary.json.

    Raises:
        InputError: not a campaign's folder, one that another process is writing, or rows of another campaign.
        CampaignError: nothing ran at all.
        KeyboardInterrupt: after the rows so far were written out.
    """
    spec = load(folder, params)
    with FolderLock(folder), RowLog(folder, campaign_hash(spec)) as log:
        return _Session(spec, log, options or Options(), notify or (lambda progress: None)).run(evaluate)


class _Session:
    """One process's work on a campaign."""

    def __init__(self, spec: CampaignSpec, log: RowLog, options: Options, notify: Callable[[Progress], None]) -> None:
        self.spec, self.log, self.options, self.notify = spec, log, options, notify
        self.rule = StopRule(spec)
        self.rule.add(log.done.values())
        self.total = spec.trials * len(spec.skills)

    def run(self, evaluate: Evaluate) -> dict[str, Any]:
        """Run, store, and write the tables whatever happens."""
        start = time.perf_counter()
        self._tell()
        try:
            if not self._complete() or self._untraced():
                with closing(self._pool(evaluate)) as pool:
                    self.log.note({"environment": environment(), "workers": pool.size, "started": time.time()})
                    self._driver(pool, self._keep).run(self._jobs(pool.size))
                    self._again(pool)
        finally:
            self.log.note({"wall_s": time.perf_counter() - start})
            summary = self._write()
        return summary

    def _again(self, pool: Pool) -> None:
        """Run once more what is to leave a trace."""
        jobs = self._untraced()
        if jobs:
            self._tell(f"{sum(len(job.trials) for job in jobs)} of them run again, to leave traces")
        self._driver(pool, self._keep_traces).run(jobs)

    def _pool(self, evaluate: Evaluate) -> Pool:
        if self.options.workers is None and self.options.scheduler is None:
            return InProcess(evaluate, self._tell_share)
        from skillframe.campaign.cluster import ClusterPool

        return ClusterPool(
            evaluate, self._seconds, workers=self.options.workers or 1, scheduler=self.options.scheduler,
            memory_bytes=self.options.memory_bytes, watch=self.spec.folder.resolve() / WATCH, tell=self._tell_share,
        )  # fmt: skip

    def _seconds(self, job: ChunkJob) -> float:
        return self.options.time_limit_s or 60.0 + 0.25 * self.spec.duration_s * len(job.trials)

    def _driver(self, pool: Pool, keep: Callable[[list[Row]], None]) -> Driver:
        traces = keep == self._keep_traces
        return Driver(pool=pool, keep=keep, lost=self._lost, enough=lambda: not traces and self.rule.after is not None)

    def _lost(self, job: ChunkJob, reason: str) -> Row:
        return dead_row(self.spec, job.skill, job.trials[0], reason)

    def _jobs(self, workers: int) -> Iterator[ChunkJob]:
        """Chunks of what is missing, the skills side by side so that a prefix of the trials is complete early."""
        size = chunk_size(self.spec.trials, workers, self.options.chunk)
        for first in range(0, self.spec.trials, size):
            trials = range(first, min(first + size, self.spec.trials))
            for skill, label in enumerate(self.spec.labels):
                missing = tuple(trial for trial in trials if (trial, label) not in self.log.done)
                if missing:
                    yield self._job(skill, missing)

    def _job(self, skill: int, trials: tuple[int, ...], traces: bool = False) -> ChunkJob:
        folder = str(self.spec.folder.resolve())
        return ChunkJob(spec=self.spec.plain(), folder=folder, skill=skill, trials=trials, traces=traces)

    def _keep(self, rows: list[Row]) -> None:
        self.rule.add(self.log.append(rows))
        self._tell()

    def _tell(self, note: str = "") -> None:
        self.notify(Progress(len(self.log.done), self.total, note))

    def _tell_share(self, under_way: float) -> None:
        """Between chunks; the traces at the end are no rows."""
        if len(self.log.done) < self.total:
            self.notify(Progress(len(self.log.done), self.total, under_way=under_way))

    def _complete(self) -> bool:
        return self.rule.after is not None or len(self.log.done) == self.total

    def _untraced(self) -> list[ChunkJob]:
        """A job per skill for the traces that are wanted and not there yet."""
        jobs = []
        for skill, label in enumerate(self.spec.labels):
            ran = [row for row in self._rows() if row["skill"] == label and row["duration_s"] == row["duration_s"]]
            picked = [row["trial"] for row in ran[: min(SAMPLE, self.options.traces)]]
            failed = [row["trial"] for row in ran if not row["success"] and row["trial"] not in picked]
            picked += failed[: self.options.traces - len(picked)]
            missing = tuple(t for t in picked if not trace_path(self.spec.folder, t, label).exists())
            if missing:
                jobs.append(self._job(skill, missing, traces=True))
        return jobs

    def _keep_traces(self, rows: list[Row]) -> None:
        for row in rows:
            content = row.pop(TRACE, None)
            if content is not None:
                write_bytes(trace_path(self.spec.folder, row["trial"], row["skill"]), content)
            changed = differences(self.log.done[row["trial"], row["skill"]], row)
            if changed:
                self._tell(f"trial {row['trial']} of {row['skill']} came out differently when run again: {changed}")

    def _rows(self) -> list[Row]:
        return ordered(self.spec, self.log.done.values(), self.rule.after)

    def _write(self) -> dict[str, Any]:
        folder, rows = self.spec.folder, self._rows()
        write_results(folder, self.spec, rows)
        hashes = {
            "campaign": campaign_hash(self.spec),
            "files": file_hashes(folder, COPIES),
            RESULTS: file_hash(folder / RESULTS),
        }
        summary = summarize(
            self.spec, rows, self.log.sessions, complete=self._complete(), stop_after=self.rule.after, hashes=hashes
        )
        write_summary(folder, summary)
        return summary


def trace_path(folder: Path, trial: int, label: str) -> Path:
    """Where the trace of a trial lies."""
    return folder / "traces" / f"{trial:05d}_{re.sub(r'[^A-Za-z0-9.-]+', '_', label)}.npz"
