"""Runs a prepared campaign to its end, from wherever it stands: the first run and a resume are the same thing.

Rows are stored the moment a chunk ends; a kill loses the chunks in flight and nothing else. However it ends - done,
early, interrupted, stopped by trouble of the environment (`trouble`) - results.csv and summary.json are written from
the rows that are there. Last, the first trials, the typical success and the first failures of each skill run once more
to leave their traces; because a trial's row does not depend on what runs beside it, that costs a few trials instead of
traces of all.
"""

from __future__ import annotations

import re
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.driver import CampaignError, Driver, Evaluate, InProcess, Pool, chunk_size
from skillframe.campaign.folder import CAMPAIGN, COPIES, campaign_hash, load, sweep
from skillframe.campaign.identity import identity, needed_plugins
from skillframe.campaign.kept import Keeper, Note, Tell
from skillframe.campaign.lock import FolderLock
from skillframe.campaign.provenance import environment, file_hash, file_hashes
from skillframe.campaign.remarks import remarks
from skillframe.campaign.rows import TRACE, ChunkJob, Row, dead_row, differences, trials_of
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.stopping import StopRule
from skillframe.campaign.store import RESULTS, RowLog, ordered, write_results
from skillframe.campaign.summary import summarize, write_summary
from skillframe.campaign.typical import nearest_to_median
from skillframe.files import write_whole
from skillframe.robot.spec import load_robot
from skillframe.robot.surroundings import collisions_note

CHUNK = 64
"""Largest number of trials per job: batching has paid off by then, and a kill loses little."""
TRACES = 8
SAMPLE = 2
WATCH = "watch"
"""Folder in a campaign's folder for the files of the workers that run now."""
STILL_S = 120.0
"""Wall time without progress after which a worker is taken for hung; our choice. Version 0.1 allowed a single trial 60
s besides 0.25 s per simulated second, several times what any world was measured to take. Progress is told every ten
milliseconds of simulated time, so what takes longest without it is to learn a skill on the spot: twice those 60 s."""


class Progress(NamedTuple):
    """How far a campaign is.

    Attributes:
        done: rows stored.
        total: rows planned.
        note: a sentence if there is something to say.
        under_way: how many rows' worth of the chunks in flight is done; `done + under_way` never falls, so after a
            chunk was lost it stands still until the same is done again.
        usual: whether the note belongs to an undisturbed campaign, so that `--quiet` leaves it out.
    """

    done: int
    total: int
    note: str = ""
    under_way: float = 0.0
    usual: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a campaign runs. Nothing here changes its rows.

    Attributes:
        workers: local processes; None runs in this one.
        scheduler: address of a Dask scheduler to use instead.
        chunk: largest number of trials per job.
        time_limit_s: wall time that a job may take without simulated time going on; a slow one may take for ever.
        memory_bytes: limit per local worker; None shares the machine's.
        keeper: of workers that outlast the campaign; None starts its own and ends them.
        traces: how many trials per skill leave a trace: the first `SAMPLE`, the success whose duration is nearest to
            the median of all successes, then the first failures.
    """

    workers: int | None = None
    scheduler: str | None = None
    chunk: int = CHUNK
    time_limit_s: float = STILL_S
    memory_bytes: int | None = None
    keeper: Keeper | None = None
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
        CampaignError: nothing ran at all, or trouble of the environment stopped it.
        KeyboardInterrupt: after the rows so far were written out.
    """
    spec = load(folder, params)
    try:
        with FolderLock(folder), RowLog(folder, campaign_hash(spec), spec) as log:
            sweep(folder)
            return _Session(spec, log, options or Options(), notify or (lambda progress: None)).run(evaluate)
    except OSError as error:  # of our own files: a trial's was judged where it was raised
        raise CampaignError(
            f"{error.filename or folder}: {error.strerror or error}; finished rows are kept, put it right, then "
            f"{_resume(folder)}"
        ) from error


class _Session:
    """One process's work on a campaign."""

    def __init__(self, spec: CampaignSpec, log: RowLog, options: Options, notify: Callable[[Progress], None]) -> None:
        self.spec, self.log, self.options, self.notify = spec, log, options, notify
        self.rule = StopRule(spec)
        self.rule.add(log.done.values())
        self.furthest = 0.0
        self._plain, self._folder = spec.plain(), str(spec.folder.resolve())

    def run(self, evaluate: Evaluate) -> dict[str, Any]:
        """Run, store, and write the tables whatever happens."""
        start = time.perf_counter()
        self._tell()
        for text in self._remarks() if self.log.unchecked else ():
            self._tell(text)
        try:
            if not self._complete() or self._untraced():
                with closing(self._pool(evaluate)) as pool:
                    self.log.note({"environment": environment(), "workers": pool.size, "started": time.time()})
                    self._driver(pool, lambda rows: self._keep(rows, pool.ran_on)).run(self._jobs(pool.size))
                    self._again(pool)
        except BaseException:
            with suppress(OSError):  # what stopped it is worth more words than what cannot be written now
                self._conclude(start)
            raise
        return self._conclude(start)

    def _remarks(self) -> list[str]:
        rows, log = list(self.log.done.values()), self.log
        return remarks(self.spec.folder, rows, unchecked=log.unchecked, environments=log.environments, summary=None)

    def _conclude(self, start: float) -> dict[str, Any]:
        """Note the time and write the tables, but never into a folder that has gone."""
        self._check_in_place()
        self.log.note({"wall_s": time.perf_counter() - start})
        return self._write()

    def _check_in_place(self) -> None:
        folder = self.spec.folder
        if not (folder / CAMPAIGN).is_file() or not self.log.in_place():
            raise CampaignError(
                f"{folder}: the campaign's folder was moved or deleted while it ran; finished rows are in it where it "
                f"is now, go on there with skillframe campaign resume"
            )

    def _again(self, pool: Pool[ChunkJob]) -> None:
        """Run once more what is to leave a trace."""
        jobs = self._untraced()
        if jobs:
            self._tell(f"{sum(len(job.trials) for job in jobs)} of them run again, to leave traces", usual=True)
        self._driver(pool, self._keep_traces, traces=True).run(jobs)

    def _pool(self, evaluate: Evaluate) -> Pool[ChunkJob]:
        if self.options.workers is None and self.options.scheduler is None:
            return InProcess(evaluate, self._tell_share)
        keeper = self.options.keeper
        if keeper is not None:
            make = partial(self._workers, evaluate, keeper.watch)
            return keeper.lend(make, self._tell_share, self._tell)
        return self._workers(evaluate, self.spec.folder.resolve() / WATCH, self._tell_share, self._tell)

    def _workers(self, evaluate: Evaluate, watch: Path, tell: Tell, note: Note) -> Pool[ChunkJob]:
        from skillframe.campaign.cluster import ClusterPool

        ours = identity(plugins=self.options.scheduler is not None)
        return ClusterPool(
            evaluate, self.options.time_limit_s, workers=self.options.workers or 1, scheduler=self.options.scheduler,
            memory_bytes=self.options.memory_bytes, watch=watch, tell=tell, ours=ours,
            needed=needed_plugins(self.spec, ours), note=note,
        )  # fmt: skip

    def _driver(self, pool: Pool[ChunkJob], keep: Callable[[list[Row]], None], traces: bool = False) -> Driver:
        return Driver(
            pool=pool, keep=keep, lost=self._lost, enough=lambda: not traces and self.rule.after is not None,
            wanted=lambda job: traces or self._wanted(job),
            words=lambda job: trials_of(job, self.spec), tell=self._tell, fix=_resume(self.spec.folder),
        )  # fmt: skip

    @property
    def total(self) -> int:
        """How many rows there will be, as far as is known: a race needs fewer than were planned."""
        return self.rule.total(len(self.log.done))

    def _wanted(self, job: ChunkJob) -> bool:
        return any(self.rule.wants(self.spec.labels[job.skill], trial) for trial in job.trials)

    def _lost(self, job: ChunkJob, reason: str) -> Row:
        return dead_row(self.spec, job.skill, job.trials[0], reason)

    def _jobs(self, workers: int) -> Iterator[ChunkJob]:
        """Chunks of what is missing, the skills side by side so that a prefix of the trials is complete early."""
        largest = self.options.chunk if self.spec.race is None else min(self.options.chunk, self.spec.race.every)
        size = chunk_size(self.spec.trials, workers, largest)
        for first in range(0, self.spec.trials, size):
            trials = range(first, min(first + size, self.spec.trials))
            for skill, label in enumerate(self.spec.labels):
                missing = tuple(trial for trial in trials if (trial, label) not in self.log.done)
                if missing:
                    yield self._job(skill, missing)

    def _job(self, skill: int, trials: tuple[int, ...], traces: bool = False) -> ChunkJob:
        return ChunkJob(spec=self._plain, folder=self._folder, skill=skill, trials=trials, traces=traces)

    def _keep(self, rows: list[Row], environment: Mapping[str, str]) -> None:
        self.rule.add(self.log.append(rows, environment))
        self._check_in_place()
        self._tell()

    def _tell(self, note: str = "", under_way: float = 0.0, usual: bool = False) -> None:
        done = len(self.log.done)
        self.furthest = min(max(self.furthest, done + under_way), self.total)
        self.notify(Progress(done, self.total, note, self.furthest - done, usual))

    def _tell_share(self, under_way: float) -> None:
        """Between chunks. The traces at the end are no rows."""
        if len(self.log.done) < self.total:
            self._tell(under_way=under_way)

    def _complete(self) -> bool:
        return self.rule.after is not None or len(self.log.done) == self.total

    def _untraced(self) -> list[ChunkJob]:
        """A job per skill for the traces that are wanted and not there yet."""
        jobs: list[ChunkJob] = []
        if not self.options.traces:
            return jobs
        ran_by = defaultdict[str, list[tuple[int, float, bool]]](list)
        for row in self._rows():
            if row["duration_s"] == row["duration_s"]:
                ran_by[row["skill"]].append((row["trial"], row["duration_s"], row["success"]))
        for skill, label in enumerate(self.spec.labels):
            ran = ran_by[label]
            picked = [trial for trial, _, _ in ran[: min(SAMPLE, self.options.traces)]]
            typical = nearest_to_median({trial: seconds for trial, seconds, success in ran if success})
            if typical is not None and typical not in picked and len(picked) < self.options.traces:
                picked.append(typical)
            failed = [trial for trial, _, success in ran if not success and trial not in picked]
            picked += failed[: self.options.traces - len(picked)]
            missing = tuple(t for t in picked if not trace_path(self.spec.folder, t, label).exists())
            if missing:
                jobs.append(self._job(skill, missing, traces=True))
        return jobs

    def _keep_traces(self, rows: list[Row]) -> None:
        for row in rows:
            content = row.pop(TRACE, None)
            if content is not None:
                write_whole(trace_path(self.spec.folder, row["trial"], row["skill"]), content)
            changed = differences(self.log.done[row["trial"], row["skill"]], row)
            if changed:
                self._tell(f"trial {row['trial']} of {row['skill']} came out differently when run again: {changed}")

    def _rows(self) -> Sequence[Row]:
        return ordered(self.spec, self.log.done, self.rule.after, self.rule.left)

    def _environments(self, rows: Sequence[Row]) -> list[dict[str, Any]]:
        """Where rows ran, and how many. Those of skillframe 0.1 do not say."""
        counts = Counter(self.log.done.ran_on((row["trial"], row["skill"])) for row in rows)
        noted = enumerate(self.log.environments)
        return [{"rows": counts[n], "versions": dict(environment)} for n, environment in noted if counts[n]]

    def _write(self) -> dict[str, Any]:
        folder, rows = self.spec.folder, self._rows()
        write_results(folder, self.spec, rows)
        hashes = {
            "campaign": campaign_hash(self.spec),
            "files": file_hashes(folder, COPIES),
            RESULTS: file_hash(folder / RESULTS),
        }
        summary = summarize(
            self.spec,
            rows,
            self.log.sessions,
            complete=self._complete(),
            stop_after=self.rule.after,
            hashes=hashes,
            race=self.rule.race,
        )
        summary["environments"] = self._environments(rows)
        robot = load_robot(str(folder / self.spec.robot))
        if text := collisions_note(robot.name, robot.collisions):
            summary["unwatched"] = text
        write_summary(folder, summary)
        return summary


def _resume(folder: Path) -> str:
    return f"type: skillframe campaign resume {folder}"


def trace_path(folder: Path, trial: int, label: str) -> Path:
    """Where the trace of a trial lies."""
    return folder / "traces" / f"{trial:05d}_{re.sub(r'[^A-Za-z0-9.-]+', '_', label)}.npz"
