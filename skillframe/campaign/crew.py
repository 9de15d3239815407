"""The workers of a Dask scheduler as they come and go: who may work, who is refused, and why.

Every worker of a scheduler that was there before says who it is (`identity`) before it gets work, also one that joins
late or comes back after its death. One of several threads is refused, because a process has only one watchdog. Workers
that this process started run its interpreter in its environment; they are not asked, which would cost them the second
in which plug-ins load.
What is asked of Dask is asked in its own loop and waited for by looking, so that Ctrl-C interrupts nothing halfway.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from skillframe.campaign.identity import Identity, compared, identity
from skillframe.errors import SkillframeError

LOOK_S = 0.25
"""Wall time between two looks at who is there."""
BACK_S = 10.0
"""Wall time after which a worker that died is looked for under its old address."""
LONELY_S = 60.0
"""Wall time without any worker after which the campaign stops; a local worker is replaced in three seconds."""


class SchedulerError(SkillframeError):
    """A cluster cannot be used. The message says why."""


class Crew:
    """The workers of a client's scheduler.

    Attributes:
        usable: address of every worker that may work, with its environment.
        present: every worker that is there.

    Args:
        client: Dask's.
        ours: what this process is.
        own: the workers were started by this process.
        needed: distributions of plug-ins that the campaign needs.
        tell: told of every worker that gets no work, and why.
    """

    def __init__(
        self, client: Any, ours: Identity, needed: set[str], tell: Callable[[str], None], *, own: bool
    ) -> None:  # fmt: skip
        self._client, self._ours, self._needed, self._tell, self._own = client, ours, needed, tell, own
        self.usable: dict[str, Mapping[str, str]] = {}
        self.present: set[str] = set()
        self._asked: dict[str, Future[Any]] = {}
        self._out: dict[str, str] = {}
        self._again: dict[str, float] = {}
        self._looking: Future[Any] | None = None
        self._due, self._last_seen = 0.0, time.monotonic()

    @property
    def size(self) -> int:
        """How many work or may yet."""
        return max(1, len(self.usable) + len(self._asked))

    def look(self) -> None:
        """See who came, who left, and who has answered. Returns at once.

        Raises:
            SchedulerError: there is nobody left to work, or nobody who may.
        """
        if self._looking is not None and self._looking.done():
            if self._looking.exception() is None:
                self._meet(self._looking.result())
            self._looking, self._due = None, time.monotonic() + LOOK_S
        if self._looking is None and time.monotonic() >= self._due:
            self._looking = self._ask(self._client.scheduler.ncores())
        for address in [a for a, future in self._asked.items() if future.done()]:
            self._judge(address, self._asked.pop(address))
        self._check_anyone_left()

    def _ask(self, coroutine: Any) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(coroutine, self._client.loop.asyncio_loop)

    def _meet(self, threads: Mapping[str, int]) -> None:
        """Take note of who is there, each with its number of threads."""
        present = set(threads)
        gone, new = self.present - present, present - self.present
        for address in gone:
            self.usable.pop(address, None)
            self._asked.pop(address, None)
        for address in new:
            self._out.pop(address, None)
        self.present = present
        back = {a for a, due in self._again.items() if time.monotonic() >= due}
        self._again = {a: due for a, due in self._again.items() if a in present - back}
        for address in new | (back & present):
            if self._own:
                self.usable[address] = self._ours.environment
                continue
            if threads[address] != 1:
                self.set_aside(address, f"it runs {threads[address]} threads; start it with --nthreads 1")
                continue
            answer = self._client.run(identity, workers=[address], on_error="return", asynchronous=True)
            self._asked[address] = self._ask(answer)

    def _judge(self, address: str, future: Future[Any]) -> None:
        """Take a worker on, or say why not."""
        error = future.exception()
        answer = future.result().get(address) if error is None else error
        if not isinstance(answer, tuple):
            said = f"{type(answer).__name__}: {answer}" if isinstance(answer, BaseException) else "no answer"
            if address in self.present:  # else it is gone, which is no reason to speak ill of it
                self.set_aside(address, f"it cannot say which versions it runs ({said}); install skillframe there")
            return
        found = compared(self._ours, Identity(*answer), self._needed)
        if found.refused:
            self.set_aside(address, f"{'; '.join(found.refused)}; install the same there and start it again")
            return
        if found.noted:
            self._tell(f"worker {address} works, although it differs in what is not needed: {'; '.join(found.noted)}")
        self.usable[address] = Identity(*answer).environment

    def set_aside(self, address: str, why: str) -> None:
        """Give a worker no work any more."""
        self.usable.pop(address, None)
        self._out[address] = why
        self._tell(f"worker {address} gets no work: {why}")

    def lost(self, address: str) -> None:
        """A worker died: it gets no work unless it is there again, under the same address, a little later."""
        self.usable.pop(address, None)
        self._again[address] = time.monotonic() + BACK_S

    def close(self) -> None:
        """Ask no more."""
        for future in [*self._asked.values(), *([self._looking] if self._looking else [])]:
            future.cancel()

    def others(self, tried: set[str]) -> bool:
        """Whether there is, or may yet be, a worker besides some."""
        return bool((self.usable.keys() | self._asked.keys()) - tried)

    def _check_anyone_left(self) -> None:
        if self.usable or self._asked:
            self._last_seen = time.monotonic()
        elif self.present and self.present <= self._out.keys():
            address, why = next(iter(self._out.items()))
            raise SchedulerError(f"no worker may work, of {len(self.present)}; {address}: {why}")
        elif time.monotonic() - self._last_seen > LONELY_S:
            raise SchedulerError(f"no worker is left since {LONELY_S:g} s; start one, then resume")
