"""Workers of a Dask scheduler: who may work, who is refused, and why.

Each worker of an existing scheduler reports its `identity` before it gets work, and must have one thread, as a process
has one watchdog. Workers of this process share its environment and are not asked. Requests to Dask run in its own loop
and are polled, so that Ctrl-C interrupts none halfway.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from skillframe.campaign.provenance import Identity, compared, identity
from skillframe.errors import SkillframeError

BACK_S = 10.0
"""Wall time after which a worker that died is expected at its old address."""


class SchedulerError(SkillframeError):
    """The cluster cannot be used."""


class Crew:
    """The workers of a client's scheduler.

    Attributes:
        usable: address of every worker that may work, with its environment.
        present: addresses of all connected workers.
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
        """Number of workers that work or are being asked, at least 1."""
        return max(1, len(self.usable) + len(self._asked))

    def look(self) -> None:
        """Update the workers from what has arrived. Returns at once.

        Raises:
            SchedulerError: no worker is left, or none may work.
        """
        if self._looking is not None and self._looking.done():
            if self._looking.exception() is None:
                self._meet(self._looking.result())
            self._looking, self._due = None, time.monotonic() + 0.25  # s between looks
        if self._looking is None and time.monotonic() >= self._due:
            self._looking = self._ask(self._client.scheduler.ncores())
        for address in [a for a, future in self._asked.items() if future.done()]:
            future = self._asked.pop(address)
            error = future.exception()
            answer = future.result().get(address) if error is None else error
            if not isinstance(answer, tuple):
                said = f"{type(answer).__name__}: {answer}" if isinstance(answer, BaseException) else "no answer"
                if address in self.present:
                    self.set_aside(address, f"it cannot say which versions it runs ({said}); install skillframe there")
            else:
                found = compared(self._ours, Identity(*answer), self._needed)
                if found.refused:
                    self.set_aside(address, f"{'; '.join(found.refused)}; install the same there and start it again")
                else:
                    if found.noted:
                        noted = "; ".join(found.noted)
                        self._tell(f"worker {address} works, although it differs in what is not needed: {noted}")
                    self.usable[address] = Identity(*answer).environment
        if self.usable or self._asked:
            self._last_seen = time.monotonic()
        elif self.present and self.present <= self._out.keys():
            address, why = next(iter(self._out.items()))
            raise SchedulerError(f"no worker may work, of {len(self.present)}; {address}: {why}")
        elif time.monotonic() - self._last_seen > 60.0:  # Dask replaces a local worker in 3 s
            raise SchedulerError("no worker is left since 60 s; start one, then resume")

    def _ask(self, coroutine: Any) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(coroutine, self._client.loop.asyncio_loop)

    def _meet(self, threads: Mapping[str, int]) -> None:
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

    def set_aside(self, address: str, why: str) -> None:
        """Give a worker no more work."""
        self.usable.pop(address, None)
        self._out[address] = why
        self._tell(f"worker {address} gets no work: {why}")

    def lost(self, address: str) -> None:
        """Record a worker's death. It may work again once it returns under its address after `BACK_S`."""
        self.usable.pop(address, None)
        self._again[address] = time.monotonic() + BACK_S

    def close(self) -> None:
        """Cancel all requests."""
        for future in [*self._asked.values(), *([self._looking] if self._looking else [])]:
            future.cancel()

    def others(self, tried: set[str]) -> bool:
        """Whether a worker other than `tried` may work."""
        return bool((self.usable.keys() | self._asked.keys()) - tried)
