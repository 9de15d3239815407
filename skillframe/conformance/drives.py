"""What can be said of a drive without the loop: that what makes it is there and can be called."""

from __future__ import annotations

from collections.abc import Iterator

from skillframe.conformance.problems import attempt
from skillframe.extend.records import DriveType, Lazy


def check_drive(drive: DriveType) -> list[str]:
    """Problems of a drive's record; empty if it conforms."""
    return attempt("make", lambda: _make(drive))


def _make(drive: DriveType) -> Iterator[str]:
    made = drive.make.load() if isinstance(drive.make, Lazy) else drive.make
    if not callable(made):
        yield f"is {made!r:.60}, which cannot be called; give the function or class that makes the drive"
