"""Runs what is missing of a prepared campaign. The first run and a resume are the same.

Rows are stored when a chunk ends, so a kill loses only the chunks in flight. However the run ends, results.csv and
summary.json are written. Finally some trials of each skill run again to record traces.

A replay runs one trial again, alone: the same row to the last bit, and its trace.
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

from skillframe.campaign.driver import (
    CampaignError,
    Driver,
    Evaluate,
    InProcess,
    Keeper,
    Note,
    Pool,
    Raised,
    Tell,
    attempt,
    chunk_size,
)
from skillframe.campaign.folder import CAMPAIGN, COPIES, FolderLock, campaign_hash, load, sweep
from skillframe.campaign.partial_results import LOST, ran_again, remarks, said_again
from skillframe.campaign.provenance import (
    environment,
    environment_differences,
    file_hash,
    file_hashes,
    identity,
    needed_plugins,
)
from skillframe.campaign.race import StopRule
from skillframe.campaign.rows import TRACE, ChunkJob, Row, dead_row, differences, trials_of
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import nearest_to_median
from skillframe.campaign.store import RESULTS, RowLog, ordered, read_content, write_results
from skillframe.campaign.summary import summarize, write_summary
from skillframe.errors import InputError, UnknownName
from skillframe.files import write_whole
from skillframe.robot.spec import load_robot
from skillframe.robot.tables import collisions_note

CHUNK = 64
"""Largest number of trials per job: larger batches are hardly faster, and a kill would lose more."""
WATCH = "watch"
"""Folder in a campaign's folder for the files of running workers."""


class Progress(NamedTuple):
    """Progress of a campaign.

    Attributes:
        done, total: rows stored and planned.
        note: a sentence, or "".
        under_way: rows' worth of the chunks in flight; `done + under_way` never falls.
        usual: whether `--quiet` leaves the note out.
    """

    done: int
    total: int
    note: str = ""
    under_way: float = 0.0
    usual: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a campaign runs, without effect on its rows.

    Attributes:
        workers: local processes; None runs in this one.
        scheduler: address of a Dask scheduler to use instead.
        chunk: largest number of trials per job.
        time_limit_s: wall time that a job may take without progress in simulated time.
        memory_bytes: limit per local worker; None divides the machine's.
        keeper: of workers that outlast the campaign, or None.
        traces: trials per skill that leave a trace: the first two, the success nearest to the median duration,
            then the first failures.
    """

    workers: int | None = None
    scheduler: str | None = None
    chunk: int = CHUNK
    time_limit_s: float = 120.0
    memory_bytes: int | None = None
    keeper: Keeper | None = None
    traces: int = 8


def run_campaign(
    folder: Path, evaluate: Evaluate, options: Options | None = None, notify: Callable[[Progress], None] | None = None,
    params: type | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Run what is missing of a prepared campaign.

    Args:
        folder: made by `folder.prepare`.
        evaluate: runs a chunk; worker processes must be able to import it.
        options: how to run.
        notify: called after every chunk, and now and then in between.
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
    except OSError as error:  # of this session's files; errors within a trial were handled there
        raise CampaignError(
            f"{error.filename or folder}: {error.strerror or error}; finished rows are kept, put it right, then "
            f"type: skillframe campaign resume {folder}"
        ) from error


class _Session:
    """The work of one process on a campaign."""

    def __init__(self, spec: CampaignSpec, log: RowLog, options: Options, notify: Callable[[Progress], None]) -> None:
        self.spec, self.log, self.options, self.notify = spec, log, options, notify
        self.rule = StopRule(spec)
        self.rule.add(log.done.values())
        self.furthest = 0.0
        self._plain, self._folder = spec.plain(), str(spec.folder.resolve())

    def run(self, evaluate: Evaluate) -> dict[str, Any]:
        """Run and store. Write the tables in any case."""
        start = time.perf_counter()
        self._tell()
        if self.log.unchecked:
            rows, log = list(self.log.done.values()), self.log
            for text in remarks(
                self.spec.folder, rows, unchecked=log.unchecked, environments=log.environments, summary=None
            ):
                self._tell(text)
        try:
            if not self._complete() or self._untraced():
                with closing(self._pool(evaluate)) as pool:
                    self.log.note({"environment": environment(), "workers": pool.size, "started": time.time()})
                    self._driver(pool, lambda rows: self._keep(rows, pool.ran_on)).run(self._jobs(pool.size))
                    jobs = self._untraced()
                    if jobs:
                        self._tell(
                            f"{sum(len(job.trials) for job in jobs)} of them run again, to leave traces", usual=True
                        )
                    self._driver(pool, self._keep_traces, traces=True).run(jobs)
        except BaseException:
            with suppress(OSError):  # the first error matters more than one of writing
                self._conclude(start)
            raise
        summary = self._conclude(start)
        if "ran_again" in summary:
            self._tell(summary["ran_again"])
        return summary

    def _conclude(self, start: float) -> dict[str, Any]:
        """Store the wall time and write the tables, unless the folder has gone."""
        self._check_in_place()
        self.log.note({"wall_s": time.perf_counter() - start})
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
        counts = Counter(self.log.done.ran_on((row["trial"], row["skill"])) for row in rows)
        noted = enumerate(self.log.environments)
        summary["environments"] = [
            {"rows": counts[n], "versions": dict(environment)} for n, environment in noted if counts[n]
        ]
        robot = load_robot(str(folder / self.spec.robot))
        if text := collisions_note(robot.name, robot.collisions):
            summary["unwatched"] = text
        if again := ran_again(self.log.sessions, self.log.done):
            summary["ran_again"] = said_again(again)
        write_summary(folder, summary)
        return summary

    def _check_in_place(self) -> None:
        folder = self.spec.folder
        if not (folder / CAMPAIGN).is_file() or not self.log.in_place():
            raise CampaignError(
                f"{folder}: the campaign's folder was moved or deleted while it ran; finished rows are in it where it "
                f"is now, go on there with skillframe campaign resume"
            )

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
            pool=pool, keep=keep, enough=lambda: not traces and self.rule.after is not None,
            lost=lambda job, reason: dead_row(self.spec, job.skill, job.trials[0], reason),
            wanted=lambda job: traces or any(self.rule.wants(self.spec.labels[job.skill], each) for each in job.trials),
            words=lambda job: trials_of(job, self.spec), tell=self._tell,
            noted=(lambda job, why: None) if traces else self._note_lost,  # a job for traces decides no row
            fix=f"type: skillframe campaign resume {self.spec.folder}",
        )  # fmt: skip

    @property
    def total(self) -> int:
        """Expected number of rows. A race needs fewer than planned."""
        return self.rule.total(len(self.log.done))

    def _note_lost(self, job: ChunkJob, why: str) -> None:
        """Store that trials ran without leaving rows, so that their next run is not taken for the first."""
        lost = {"skill": self.spec.labels[job.skill], "trials": list(job.trials), "why": why}
        with suppress(OSError):  # the job's error matters more than one of writing
            self.log.note({LOST: lost})

    def _jobs(self, workers: int) -> Iterator[ChunkJob]:
        """Chunks of missing trials, skills interleaved so that the first trials are complete early."""
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
        if len(self.log.done) < self.total:
            self._tell(under_way=under_way)

    def _complete(self) -> bool:
        return self.rule.after is not None or len(self.log.done) == self.total

    def _untraced(self) -> list[ChunkJob]:
        jobs: list[ChunkJob] = []
        if not self.options.traces:
            return jobs
        ran_by = defaultdict[str, list[tuple[int, float, bool]]](list)
        for row in self._rows():
            if row["duration_s"] == row["duration_s"]:
                ran_by[row["skill"]].append((row["trial"], row["duration_s"], row["success"]))
        for skill, label in enumerate(self.spec.labels):
            ran = ran_by[label]
            picked = [trial for trial, _, _ in ran[: min(2, self.options.traces)]]
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


def trace_path(folder: Path, trial: int, label: str) -> Path:
    """Path of a trial's trace."""
    return folder / "traces" / f"{trial:05d}_{re.sub(r'[^A-Za-z0-9.-]+', '_', label)}.npz"


class Replayed(NamedTuple):
    """A trial then and now.

    Attributes:
        then, now: the campaign's row, and that of the trial run alone.
        changed: both values of each column that is not bit-identical.
        environment: one line per entry that differs.
        trace: content of the trace file.
    """

    then: Row
    now: Row
    changed: dict[str, tuple[Any, Any]]
    environment: list[str]
    trace: bytes | None


def replay_trial(
    folder: Path, trial: int, evaluate: Evaluate, skill: str | None = None, params: type | None = None
) -> Replayed:
    """Run a trial again.

    Raises:
        InputError: no such folder, rows of another campaign, or a trial without a row.
        UnknownName: no such skill.
        CampaignError: the trial cannot run here.
    """
    spec = load(folder, params)
    label = pick_label(spec.labels, skill)
    found = read_content(folder, campaign_hash(spec), spec)
    done = found.done
    if (trial, label) not in done:
        numbers = sorted(t for t, name in done if name == label)
        have = f"it has {len(numbers)} trials" + (f", {numbers[0]} to {numbers[-1]}" if numbers else "")
        raise InputError(folder, f"trial {trial} of {label} has no row ({have})", "choose another trial, or resume")
    job = ChunkJob(
        spec=spec.plain(), folder=str(folder.resolve()), skill=spec.labels.index(label), trials=(trial,), traces=True
    )
    answer = attempt(evaluate, job)
    if isinstance(answer, Raised) and answer.trouble:
        raise CampaignError(f"trial {trial} of {label} cannot run here: {answer.text}")
    now = dead_row(spec, job.skill, trial, f"error: {answer.text}") if isinstance(answer, Raised) else answer[0]
    trace = now.pop(TRACE, None)
    number = done.ran_on((trial, label))
    if number is not None and number < len(found.environments):
        ran_on: Mapping[str, str] = found.environments[number]
    else:
        noted = [session["environment"] for session in found.sessions if "environment" in session]
        ran_on = noted[-1] if noted else {}
    changes = environment_differences(ran_on, environment()) if ran_on else []
    then = done[trial, label]
    return Replayed(then, now, differences(then, now), changes, trace)


def pick_label(labels: Sequence[str], skill: str | None) -> str:
    """The label that equals a name or is the only one to begin with it.

    Raises:
        UnknownName: none or several.
    """
    if skill is None or skill in labels:
        return skill or labels[0]
    meant = [label for label in labels if label.startswith(skill)]
    if len(meant) != 1:
        raise UnknownName("skill", skill, labels)
    return meant[0]
