"""What runs inside a worker process: a job under a watchdog, a file that says how far it is, no ear for Ctrl-C.

A terminal sends Ctrl-C to all processes at once; it is the client that answers it, by ending the workers. Dask imports
this module in every worker it starts (`preload`) and calls `dask_setup`.
"""

from __future__ import annotations

import faulthandler
import signal
import time
from contextlib import suppress
from pathlib import Path

from skillframe.campaign.driver import Evaluate
from skillframe.campaign.pulse import Listener, heard
from skillframe.campaign.rows import ChunkJob, Row

PULSE_S = 0.5


def dask_setup(worker: object) -> None:
    """Called by Dask in the main thread of a worker process as it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def guarded(evaluate: Evaluate, job: ChunkJob, seconds: float, watch: str) -> list[Row]:
    """Run a job; after some seconds the process is ended and what it was doing is written to a file.

    Args:
        evaluate: the work.
        job: its argument.
        seconds: wall time after which the worker ends itself.
        watch: path of the file, removed if the job ends in time.
    """
    path, share = Path(watch), share_file(Path(watch))
    with path.open("w", encoding="utf-8") as file:
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)
        try:
            with heard(_pulse(share)):
                return evaluate(job)
        finally:
            faulthandler.cancel_dump_traceback_later()
            path.unlink(missing_ok=True)
            share.unlink(missing_ok=True)


def share_file(watch: Path) -> Path:
    """Where a job says how far it is, beside its watchdog's file."""
    return watch.with_suffix(".share")


def _pulse(path: Path) -> Listener:
    """Writes how far the job is, now and then; that it cannot is no reason to stop."""
    due = time.monotonic() + PULSE_S

    def write(share: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due:
            due = now + PULSE_S
            with suppress(OSError):
                path.write_text(f"{share:.4f}", encoding="utf-8")

    return write
