"""What a pool runs: a job of known size that gives rows.

Progress of the chunk that this process simulates, as a share of simulated time.

The watchdog (`worker`) relies on it: the share stands still where the simulation hangs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar


class Work(Protocol):
    """A job. It is pickled for workers."""

    @property
    def size(self) -> int:
        """Number of its rows, the unit of progress."""


WorkT = TypeVar("WorkT", bound=Work)


Listener = Callable[[float], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """While open, calls `listener` with the share of the chunk, 0 to 1, that is done."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def report_progress(share: float) -> None:
    """Pass on the share of the chunk that is done."""
    listener = _listener.get()
    if listener is not None:
        listener(share)
