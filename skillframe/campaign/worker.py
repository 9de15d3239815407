"""Runs a job inside a worker process: with a watchdog, a progress file, and Ctrl-C ignored.

Progress restarts the watchdog, so it ends only jobs that hang. It is `faulthandler`'s C thread, which works also while
a job holds the interpreter's lock. A terminal sends Ctrl-C to all processes; the client answers it by ending the
workers. Dask imports this module in every worker (`preload`) and calls `dask_setup`.
"""

from __future__ import annotations

import faulthandler
import math
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from skillframe.campaign.driver import Raised, attempt
from skillframe.campaign.jobs import Listener, WorkT, listening
from skillframe.campaign.rows import Row


def dask_setup(worker: object) -> None:
    """Called by Dask in the main thread of a starting worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def guarded(evaluate: Callable[[WorkT], list[Row]], job: WorkT, seconds: float, watch: str) -> list[Row] | Raised:
    """Run a job. After `seconds` (wall time, may be infinite) without progress, the process ends itself.

    Args:
        evaluate: the work.
        job: its argument.
        seconds: see above.
        watch: file for the stack of a hanging job, removed if it ends in time.
    """
    path, share = Path(watch), share_file(Path(watch))
    try:
        file = path.open("x", encoding="utf-8")
    except OSError as error:
        return Raised(f"the worker cannot write into {path.parent} ({error})", trouble=True)
    with file:
        _wind(seconds, file)
        try:
            with listening(_writing_to(share, seconds, file)):
                return attempt(evaluate, job)
        finally:
            faulthandler.cancel_dump_traceback_later()
            with suppress(OSError):
                path.unlink(missing_ok=True)
                share.unlink(missing_ok=True)


def _wind(seconds: float, file: TextIO) -> None:
    if math.isfinite(seconds):
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)


def share_file(watch: Path) -> Path:
    """Path of a job's progress file, beside its watchdog's file."""
    return watch.with_suffix(".share")


def _writing_to(path: Path, seconds: float, file: TextIO) -> Listener:
    every = min(0.5, seconds / 4.0)
    due, furthest = time.monotonic() + every, 0.0

    def report_progress(share: float) -> None:
        nonlocal due, furthest
        now = time.monotonic()
        if now >= due and share > furthest:
            due, furthest = now + every, share
            _wind(seconds, file)
            with suppress(OSError):
                path.write_text(f"{share:.4f}", encoding="utf-8")

    return report_progress
