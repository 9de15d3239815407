"""Workers that outlast a campaign: the rounds of a search are campaigns of some seconds, and workers take as long."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from skillframe.campaign.driver import Answer, Pool
from skillframe.campaign.rows import ChunkJob

Tell = Callable[[float], None]
Note = Callable[[str], None]


@dataclass(slots=True)
class Keeper:
    """Keeps one pool for several campaigns, one after the other. Use it as a context manager.

    Attributes:
        watch: folder for the files of the workers that run now.
        tell: the present campaign's, told how much of the jobs in flight is done.
        note: the present campaign's, told of workers in a sentence.
    """

    watch: Path
    tell: Tell = field(default=lambda share: None)
    note: Note = field(default=lambda text: None)
    _pool: Pool[ChunkJob] | None = None

    def lend(self, make: Callable[[Tell, Note], Pool[ChunkJob]], tell: Tell, note: Note) -> Lent:
        """The pool, made if there is none, for a campaign that hears of it by `tell` and `note`."""
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
        """The environment of the job that ended last."""
        return self._pool.ran_on

    def submit(self, job: ChunkJob) -> None:
        """Send a job."""
        self._pool.submit(job)

    def next(self) -> tuple[ChunkJob, Answer]:
        """Wait for the next job to end."""
        return self._pool.next()

    def close(self) -> None:
        """Nothing: whoever keeps the pool ends it."""
