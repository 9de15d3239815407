"""What runs inside a worker process: a job under a watchdog, and no ear for Ctrl-C.

A terminal sends Ctrl-C to all processes at once; it is the client that answers it, by ending the workers. Dask imports
this module in every worker it starts (`preload`) and calls `dask_setup`.
"""

from __future__ import annotations

import faulthandler
import signal
from pathlib import Path

from skillframe.campaign.driver import Evaluate
from skillframe.campaign.rows import ChunkJob, Row


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
    path = Path(watch)
    with path.open("w", encoding="utf-8") as file:
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)
        try:
            return evaluate(job)
        finally:
            faulthandler.cancel_dump_traceback_later()
            path.unlink(missing_ok=True)
