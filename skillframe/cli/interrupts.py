"""SIGTERM as Ctrl-C, for commands that keep what they have finished however they are ended."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

INTERRUPTED, TERMINATED = 130, 143
"""128 and the signal's number, as shells have it."""


@contextmanager
def terminable() -> Iterator[Callable[[], int]]:
    """Within this, SIGTERM (of Slurm, systemd, a shutdown) interrupts as Ctrl-C does. Gives the exit code due."""
    codes = [INTERRUPTED]

    def answer(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the tables are being written
        codes.append(TERMINATED)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # Python answers signals in the main thread only
        yield lambda: codes[-1]
        return
    before = signal.signal(signal.SIGTERM, answer)
    try:
        yield lambda: codes[-1]
    finally:
        signal.signal(signal.SIGTERM, before)
