"""A folder's four commands over a closed-form skill, as a process that a test may kill at any moment."""

import os
import signal
import sys
import threading
from pathlib import Path

from skillframe_certify import procedure
from skillframe_certify.engine import Engine
from skillframe_certify.searches import find_break, map_border, rank
from test_certify import ENGINE, through

from skillframe.campaign.runner import Options

STATED = ("rows.jsonl", "summary.json", "lock")
"""Files that tell of times and processes."""


def everything(out: Path, engine: Engine = ENGINE) -> None:
    map_border(out, engine, lambda text: None)
    find_break(out, engine, lambda text: None)
    rank(out, engine, lambda text: None)
    through(out, engine)


def content(folder: Path):
    """All that does not tell of times and machines."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in STATED
    }


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def die_writing(number: int) -> None:
    """Be killed when something is to be synced to the disk for the n-th time."""
    left, synced = [number], os.fsync

    def fsync(descriptor: int) -> None:
        left[0] -= 1
        if left[0] == 0:
            die()
        synced(descriptor)

    os.fsync = fsync


if __name__ == "__main__":  # FOLDER SECONDS [WRITES [WORKERS]]: killed after so long, or in its n-th write (0: in none)
    timer = threading.Timer(min(float(sys.argv[2]), threading.TIMEOUT_MAX), die)
    timer.daemon = True
    timer.start()
    if len(sys.argv) > 3:
        die_writing(int(sys.argv[3]))
    if len(sys.argv) > 4:
        ENGINE = ENGINE._replace(options=Options(traces=0, workers=int(sys.argv[4])))
    procedure.look(Path(sys.argv[1]), ENGINE)
    everything(Path(sys.argv[1]), ENGINE)
