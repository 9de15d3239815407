"""Gets every trial's row out of workers that may die: halve what fails, and never blame the innocent.

A chunk whose worker died is halved. A single trial whose worker died is only a suspect, for whatever killed the worker
may have come from outside; suspects are run again at the end, one by one with nothing else in flight, and one that dies
then is recorded as the reason. A trial that raises is known for certain and recorded at once, unless what it raised is
trouble of the environment (`trouble`): then nothing is recorded, and the campaign stops.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, Protocol

from skillframe.campaign.chunk_progress import listening
from skillframe.campaign.provenance import environment
from skillframe.campaign.rows import ChunkJob, Row
from skillframe.campaign.trouble import CampaignError, Evaluate, Raised, attempt
from skillframe.campaign.work import WorkT

__all__ = ["Answer", "CampaignError", "Died", "Driver", "Evaluate", "InProcess", "Pool", "Raised", "chunk_size"]

HOPELESS = 20
"""Chunks lost in a row from the very start after which a campaign gives up: the set-up is broken, not a trial."""
WHY = {"killed": "was killed", "time limit": "made no progress for too long", "memory": "went over its memory limit"}


class Died(NamedTuple):
    """The worker went away under the job. Cause is "killed", "time limit" (it made no progress) or "memory"."""

    cause: str


Answer = list[Row] | Died | Raised


class Pool(Protocol[WorkT]):
    """Where jobs run."""

    @property
    def size(self) -> int:
        """How many jobs may be in flight."""

    @property
    def ran_on(self) -> Mapping[str, str]:
        """Environment of the process that gave the last answer."""

    def submit(self, job: WorkT) -> None:
        """Start a job."""

    def next(self) -> tuple[WorkT, Answer]:
        """The next job to end, and how. Trouble of the environment only where no other worker is left to try."""

    def close(self) -> None:
        """End everything, including what is in flight."""


@dataclass(slots=True, kw_only=True)
class Driver:
    """Runs chunks through a pool.

    Attributes:
        pool: where.
        keep: what to do with the rows of a chunk that ended.
        lost: the row of a trial that left none, from its job and the reason.
        enough: asked before each chunk; True starts no more.
        wanted: asked of each chunk before it starts; False leaves it out.
        words: a job in words, for sentences.
        tell: told when a worker was replaced, and why.
        fix: what to type once trouble of the environment is over.
    """

    pool: Pool[ChunkJob]
    keep: Callable[[list[Row]], None]
    lost: Callable[[ChunkJob, str], Row]
    enough: Callable[[], bool]
    wanted: Callable[[ChunkJob], bool]
    words: Callable[[ChunkJob], str]
    tell: Callable[[str], None]
    fix: str
    _good: bool = False
    _losses: int = 0

    def run(self, jobs: Iterable[ChunkJob]) -> None:
        """Run all jobs.

        Raises:
            CampaignError: nothing but losses from the start, or trouble of the environment.
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
                self._judge(*self.pool.next())

    def _handle(self, job: ChunkJob, answer: Answer, queue: deque[ChunkJob], suspects: list[ChunkJob]) -> None:
        if isinstance(answer, list):
            self._store(answer)
            return
        several = len(job.trials) > 1
        if isinstance(answer, Died):
            again = "they run again, in halves" if several else "it runs again at the end, alone"
            self.tell(f"a worker was replaced: it {WHY[answer.cause]} while on {self.words(job)}; {again}")
        elif answer.trouble and not (answer.memory and several):
            raise self._stopped(job, answer)
        self._count_loss(answer)
        if several:
            queue.extendleft(reversed(halves(job)))
        elif isinstance(answer, Died):
            suspects.append(job)
        else:
            self.keep([self.lost(job, reason_of(answer))])

    def _judge(self, job: ChunkJob, answer: Answer) -> None:
        """The last word on a suspect that ran alone."""
        if isinstance(answer, list):
            self._store(answer)
            return
        if isinstance(answer, Raised) and answer.trouble:
            raise self._stopped(job, answer)
        reason = reason_of(answer)
        self.tell(f"{self.words(job)} ran again alone, and this is its row now: {reason}")
        self.keep([self.lost(job, reason)])

    def _store(self, rows: list[Row]) -> None:
        self._good = True
        self.keep(rows)

    def _stopped(self, job: ChunkJob, answer: Raised) -> CampaignError:
        return CampaignError(
            f"stopped, while on {self.words(job)}: {answer.text}; this says nothing about the skill, so no row was "
            f"written; put it right, then {self.fix}"
        )

    def _count_loss(self, answer: Died | Raised) -> None:
        self._losses += 1
        if not self._good and self._losses >= HOPELESS:
            raise CampaignError(f"no trial ran, {self._losses} chunks were lost: {reason_of(answer)}")


def reason_of(answer: Died | Raised) -> str:
    """What a row says about a trial that left no outcome."""
    return f"worker died ({answer.cause})" if isinstance(answer, Died) else f"error: {answer.text}"


def halves(job: ChunkJob) -> list[ChunkJob]:
    """The two halves of a chunk."""
    middle = len(job.trials) // 2
    return [replace(job, trials=part) for part in (job.trials[:middle], job.trials[middle:])]


def chunk_size(trials: int, workers: int, largest: int) -> int:
    """Even chunks, at most `largest` trials each and a multiple of the workers in number where that is possible."""
    rounds = math.ceil(trials / (largest * workers))
    return max(1, math.ceil(trials / (rounds * workers)))


class InProcess(Generic[WorkT]):
    """A pool of one: this process. A trial that kills it ends the campaign, which can be resumed.

    Args:
        evaluate: the work.
        tell: told now and then how many rows' worth of the job is done.
    """

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
        """Nothing to end."""
