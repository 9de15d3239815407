"""Gets each trial's row from workers that may die.

A chunk whose worker died is halved. A single trial whose worker died runs again at the end, alone, since the cause may
lie outside; a second death is its result. A trial that raises gets a row at once, except for trouble of the environment
(`trouble`), which stops the campaign.

Workers reused by several short campaigns, since starting workers takes as long as such a campaign.

Distinguishes errors of a skill from trouble of the environment, of which no row is written.

Trouble of the environment is

  MemoryError, OSError, ImportError                       wherever raised, also in a plug-in's step
  UnknownName, MissingDependency, plug-in load errors,    wherever raised: a name that existed when the campaign was
  CompilerFailed                                          prepared is missing in this process
  InputError of files                                     raised while an FMU is found, unpacked or built
  ScoreFailed                                             a score is no part of the skill
  anything                                                raised while the robot, the skill or the world is loaded
                                                          (`needed`), which succeeded before the campaign began

Any other error becomes the trial's row: a ValueError in a skill's step, a start out of reach, a sample that the world
refuses, an FMU that crashes, `sys.exit` in a skill. The driver judges a worker that dies.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from traceback import walk_tb
from typing import Generic, NamedTuple, Protocol

from skillframe.campaign.jobs import WorkT, listening
from skillframe.campaign.provenance import environment
from skillframe.campaign.rows import ChunkJob, Row
from skillframe.errors import InputError, MissingDependency, SkillframeError, UnknownName, missing_extra
from skillframe.execution.trace import ScoreFailed
from skillframe.extend.registry import BadPlugin, PluginConflict

__all__ = ["Answer", "CampaignError", "Died", "Driver", "Evaluate", "InProcess", "Pool", "Raised", "chunk_size"]

#: how a worker died, in words
WHY = {"killed": "was killed", "time limit": "made no progress for too long", "memory": "went over its memory limit"}


class Died(NamedTuple):
    """The worker died. Cause: "killed", "time limit" (no progress) or "memory"."""

    cause: str


class Pool(Protocol[WorkT]):
    """Runs jobs."""

    @property
    def size(self) -> int:
        """How many jobs may be in flight."""

    @property
    def ran_on(self) -> Mapping[str, str]:
        """Environment of the process that gave the last answer."""

    def submit(self, job: WorkT) -> None:
        """Start a job."""

    def next(self) -> tuple[WorkT, Answer]:
        """Wait for the next job to end. Returns trouble of the environment only once no other worker is left to try."""

    def close(self) -> None:
        """End all jobs."""


@dataclass(slots=True, kw_only=True)
class Driver:
    """Runs chunks through a pool.

    Attributes:
        pool: runs the jobs.
        keep: stores rows.
        lost: makes the row of a trial that left none, from its job and the reason.
        enough: True starts no more chunks.
        wanted: False skips a chunk.
        words: describes a job.
        noted: called first with each job that left no rows, and why.
        tell: receives a sentence about each replaced worker.
        fix: command to type after trouble of the environment.
    """

    pool: Pool[ChunkJob]
    keep: Callable[[list[Row]], None]
    lost: Callable[[ChunkJob, str], Row]
    enough: Callable[[], bool]
    wanted: Callable[[ChunkJob], bool]
    words: Callable[[ChunkJob], str]
    noted: Callable[[ChunkJob, str], None]
    tell: Callable[[str], None]
    fix: str
    _good: bool = False
    _losses: int = 0

    def run(self, jobs: Iterable[ChunkJob]) -> None:
        """Run all jobs.

        Raises:
            CampaignError: only losses from the start, or trouble of the environment.
        """
        source, queue, suspects, flying = iter(jobs), deque[ChunkJob](), list[ChunkJob](), 0
        while True:
            while flying < self.pool.size and not self.enough():
                job = queue.popleft() if queue else next(source, None)
                if job is None:
                    break
                if self.wanted(job):
                    self.pool.submit(job)
                    flying += 1
            if not flying:
                break
            ended, answer = self.pool.next()
            flying -= 1
            self._handle(ended, answer, queue, suspects)
        for job in suspects:
            if self.wanted(job) and not self.enough():
                self.pool.submit(job)
                last, answer = self.pool.next()
                if isinstance(answer, list):
                    self._store(answer)
                    continue
                reason = reason_of(answer)
                self.noted(last, reason)
                if isinstance(answer, Raised) and answer.trouble:
                    raise self._stopped(last, answer)
                self.tell(f"{self.words(last)} ran again alone, and this is its row now: {reason}")
                self.keep([self.lost(last, reason)])

    def _handle(self, job: ChunkJob, answer: Answer, queue: deque[ChunkJob], suspects: list[ChunkJob]) -> None:
        if isinstance(answer, list):
            self._store(answer)
            return
        self.noted(job, reason_of(answer))
        several = len(job.trials) > 1
        if isinstance(answer, Died):
            again = "they run again, in halves" if several else "it runs again at the end, alone"
            self.tell(f"a worker was replaced: it {WHY[answer.cause]} while on {self.words(job)}; {again}")
        elif answer.trouble and not (answer.memory and several):
            raise self._stopped(job, answer)
        self._losses += 1
        if not self._good and self._losses >= 20:  # the set-up is broken
            raise CampaignError(f"no trial ran, {self._losses} chunks were lost: {reason_of(answer)}")
        if several:
            queue.extendleft(reversed(halves(job)))
        elif isinstance(answer, Died):
            suspects.append(job)
        else:
            self.keep([self.lost(job, reason_of(answer))])

    def _store(self, rows: list[Row]) -> None:
        self._good = True
        self.keep(rows)

    def _stopped(self, job: ChunkJob, answer: Raised) -> CampaignError:
        return CampaignError(
            f"stopped, while on {self.words(job)}: {answer.text}; this says nothing about the skill, so no row was "
            f"written; put it right, then {self.fix}"
        )


def reason_of(answer: Died | Raised) -> str:
    """Text of the `failure` column of a trial without outcome."""
    return f"worker died ({answer.cause})" if isinstance(answer, Died) else f"error: {answer.text}"


def halves(job: ChunkJob) -> list[ChunkJob]:
    """The two halves of a chunk."""
    middle = len(job.trials) // 2
    return [replace(job, trials=part) for part in (job.trials[:middle], job.trials[middle:])]


def chunk_size(trials: int, workers: int, largest: int) -> int:
    """Trials per chunk, at most `largest`. If possible, the number of chunks is a multiple of the workers."""
    rounds = math.ceil(trials / (largest * workers))
    return max(1, math.ceil(trials / (rounds * workers)))


class InProcess(Generic[WorkT]):
    """Runs jobs in this process. A trial that kills it ends the campaign, which can be resumed."""

    size = 1

    def __init__(self, evaluate: Callable[[WorkT], list[Row]], tell: Callable[[float], None]) -> None:
        self._evaluate, self._tell = evaluate, tell
        self._jobs: deque[WorkT] = deque()
        self.ran_on: Mapping[str, str] = environment()

    def submit(self, job: WorkT) -> None:
        """Queue a job."""
        self._jobs.append(job)

    def next(self) -> tuple[WorkT, Answer]:
        """Run the next job now."""
        job = self._jobs.popleft()
        with listening(lambda share: self._tell(share * job.size)):
            return job, attempt(self._evaluate, job)

    def close(self) -> None:
        """Do nothing."""


Tell = Callable[[float], None]
Note = Callable[[str], None]


@dataclass(slots=True)
class Keeper:
    """Context manager that keeps one pool for several campaigns in turn.

    Attributes:
        watch: folder for the files of the running workers.
        tell: progress callback of the present campaign.
        note: message callback of the present campaign.
    """

    watch: Path
    tell: Tell = field(default=lambda share: None)
    note: Note = field(default=lambda text: None)
    _pool: Pool[ChunkJob] | None = None

    def lend(self, make: Callable[[Tell, Note], Pool[ChunkJob]], tell: Tell, note: Note) -> Lent:
        """The pool, made at first use, reporting to this campaign's `tell` and `note`."""
        self.tell, self.note = tell, note
        if self._pool is None:
            self._pool = make(lambda share: self.tell(share), lambda text: self.note(text))
        return Lent(self._pool)

    def __enter__(self) -> Keeper:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.close()
            self._pool = None


class Lent:
    """A pool that stays open when its campaign closes it."""

    def __init__(self, pool: Pool[ChunkJob]) -> None:
        self._pool = pool

    @property
    def size(self) -> int:
        """How many jobs may be in flight."""
        return self._pool.size

    @property
    def ran_on(self) -> Mapping[str, str]:
        """Environment of the job that ended last."""
        return self._pool.ran_on

    def submit(self, job: ChunkJob) -> None:
        """Send a job."""
        self._pool.submit(job)

    def next(self) -> tuple[ChunkJob, Answer]:
        """Wait for the next job to end."""
        return self._pool.next()

    def close(self) -> None:
        """Do nothing. `Keeper` closes the pool."""


Evaluate = Callable[[ChunkJob], list[Row]]  #: runs the trials of a chunk
FILES = frozenset(f"skillframe.fmu.{name}" for name in ("allow", "build", "extract", "foreign", "library"))
"""Modules that turn an FMU file into something that runs; they do not depend on samples."""
OLD_SIGNS = (
    "no such file", "cannot be read", "MemoryError", "ImportError", "ModuleNotFoundError", "OSError", "PermissionError",
    "FileNotFoundError", "unknown skill", "unknown world", "unknown coordinator", "is not installed",
)  # fmt: skip
"""Texts by which rows of version 0.1 indicate trouble of the environment."""


class CampaignError(SkillframeError):
    """A campaign cannot go on."""


class Unusable(SkillframeError):
    """Something that every trial needs cannot be loaded in this process."""


class Raised(NamedTuple):
    """The job raised.

    Attributes:
        text: the error in words, without "error: ".
        trouble: whether it is trouble of the environment.
        memory: whether memory ran out, so that fewer trials at once may work.
    """

    text: str
    trouble: bool = False
    memory: bool = False


Answer = list[Row] | Died | Raised  #: what a worker returns for a chunk: its rows, or how it failed


@contextmanager
def needed(what: str) -> Iterator[None]:
    """While open, any error but MemoryError is trouble of the environment.

    Raises:
        Unusable: in place of that error.
    """
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:  # files and plug-ins may raise anything
        raise Unusable(f"{what} cannot be loaded: {said(error)}") from error


def attempt(evaluate: Callable[[WorkT], list[Row]], job: WorkT) -> list[Row] | Raised:
    """Run a job and classify what it raises, also `sys.exit`. Ctrl-C passes through."""
    try:
        return evaluate(job)
    except KeyboardInterrupt:
        raise
    except SystemExit as error:
        return Raised(f"SystemExit: the skill or the world called sys.exit({error.code!r})")
    except BaseException as error:  # a skill or world may raise anything
        return Raised(said(error), is_trouble(error), isinstance(error, MemoryError))


def said(error: BaseException) -> str:
    """An error in words: the message of a skillframe error, otherwise with its type."""
    if isinstance(error, ModuleNotFoundError) and (missing := missing_extra(error.name or "")):
        error = missing
    text = str(error)
    return text if isinstance(error, SkillframeError) and text else f"{type(error).__name__}: {text}".removesuffix(": ")


def is_trouble(error: BaseException) -> bool:
    """Whether an error is trouble of the environment (see the module)."""
    from skillframe.fmu.build import CompilerFailed

    always = (MemoryError, OSError, ImportError, UnknownName, MissingDependency, BadPlugin, PluginConflict, Unusable)
    if isinstance(error, (*always, ScoreFailed, CompilerFailed)):
        return True
    modules = (str(frame.f_globals.get("__name__")) for frame, _ in walk_tb(error.__traceback__))
    return isinstance(error, InputError) and not FILES.isdisjoint(modules)


def looks_like_trouble(failure: str) -> bool:
    """Whether the failure of a row of version 0.1 may be trouble of the environment."""
    return failure.startswith("error: ") and any(sign in failure for sign in OLD_SIGNS)
