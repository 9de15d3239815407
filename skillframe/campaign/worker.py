"""What runs inside a worker process: a job under a watchdog, a file that says how far it is, no ear for Ctrl-C.

A slow job is not a hung one: the watchdog is wound again whenever the job says that it has come further, so it ends
what makes no progress, however long the whole takes. It is `faulthandler`'s C thread, which a job that holds the
interpreter's lock cannot stop.

A terminal sends Ctrl-C to all processes at once; it is the client that answers it, by ending the workers. Dask imports
this module in every worker it starts (`preload`) and calls `dask_setup`.
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

from skillframe.campaign.chunk_progress import Listener, listening
from skillframe.campaign.rows import Row
from skillframe.campaign.trouble import Raised, attempt
from skillframe.campaign.work import WorkT

PULSE_S = 0.5


def dask_setup(worker: object) -> None:
    """Called by Dask in the main thread of a worker process as it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def guarded(evaluate: Callable[[WorkT], list[Row]], job: WorkT, seconds: float, watch: str) -> list[Row] | Raised:
    """Run a job. Once it makes no progress any more, the process is ended and what it was doing is written to a file.

    Args:
        evaluate: the work.
        job: its argument.
        seconds: wall time without progress after which the worker ends itself; infinite: never.
        watch: path of the file, removed if the job ends in time.
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
    """Begin the watchdog's time again."""
    if math.isfinite(seconds):
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)


def share_file(watch: Path) -> Path:
    """Where a job says how far it is, beside its watchdog's file."""
    return watch.with_suffix(".share")


def _writing_to(path: Path, seconds: float, file: TextIO) -> Listener:
    """Winds the watchdog and writes how far the job is, now and then. A failed write does not stop it."""
    every = min(PULSE_S, seconds / 4.0)
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
