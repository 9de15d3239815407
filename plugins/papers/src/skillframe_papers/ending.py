"""Ctrl-C and SIGTERM as something to wait for, and processes that do not outlive the one that started them.

A signal that raised could come between the start of a process and the note of it, and leave that process behind.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from types import FrameType, TracebackType
from typing import Any, Self

ENDING = (signal.SIGINT, signal.SIGTERM)
PATIENCE_S = 5.0


class Ending:
    """While it is entered, the signals that end a program only make `wake` readable.

    Outside the main thread, where Python allows no handlers, signals stay as they are.

    Attributes:
        signal: the first that came, 0 if none.
        wake: file descriptor that becomes readable when one comes.
    """

    def __init__(self) -> None:
        self.signal = 0
        self.wake, self._writer = os.pipe()
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._note) for number in ENDING}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        os.close(self.wake)
        os.close(self._writer)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if not self.signal:
            self.signal = int(number)
            os.write(self._writer, b"x")


def end_all(processes: Sequence[BaseProcess]) -> None:
    """End processes and wait until they have ended."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(PATIENCE_S)
        if process.is_alive():
            process.kill()
            process.join()


def end_with_parent() -> None:
    """In a started process: leave Ctrl-C, which a terminal sends to all, to the parent, and end when it has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
