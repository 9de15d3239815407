"""Isolation of plug-ins: whatever one raises becomes its own error, except the user's Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def isolated(error: type[Exception]) -> Iterator[None]:
    """While open, an exception that is no `Exception` becomes one, and Ctrl-C passes through.

    A `KeyboardInterrupt` is the user's if SIGINT came meanwhile, otherwise the plug-in's.

    Args:
        error: raised in place of `SystemExit`, a plug-in's `KeyboardInterrupt` and the like.
    """
    pressed: list[int] = []
    before = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None

    def answer(number: int, frame: FrameType | None) -> None:
        pressed.append(number)
        if callable(before):
            before(number, frame)

    if callable(before):
        signal.signal(signal.SIGINT, answer)
    try:
        yield
    except Exception:
        raise
    except BaseException as raised:
        if pressed:
            raise
        raise error(f"{type(raised).__name__}: {raised}") from raised
    finally:
        if callable(before):
            signal.signal(signal.SIGINT, before)
