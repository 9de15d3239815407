"""How far the chunk is that this process simulates: said by whoever evaluates it, heard by whoever listens here.

What is said is the share of the simulated time, so it stands still where the simulation does; the watchdog of a worker
(`worker`) goes by that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[float], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Within this, a listener is called with the share of the chunk, 0 to 1, that is done."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def report_progress(share: float) -> None:
    """Say how far the chunk is."""
    listener = _listener.get()
    if listener is not None:
        listener(share)
