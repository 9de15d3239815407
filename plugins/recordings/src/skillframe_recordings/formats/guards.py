"""Guards for foreign files: size limits, and one sentence for library errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from skillframe.errors import InputError, SkillframeError

Arrays = dict[str, NDArray[Any]]


@contextmanager
def foreign(path: Path, kind: str) -> Iterator[None]:
    """Convert library errors on foreign bytes into an `InputError`."""
    try:
        yield
    except (SkillframeError, MemoryError, ImportError):
        raise
    except Exception as error:  # foreign code on foreign bytes: ValueError, TypeError, struct.error, OSError ...
        said = " ".join(str(error).split())[:120]
        problem = f"cannot be read as {kind} ({type(error).__name__}{f': {said}' if said else ''})"
        raise InputError(path, problem, "it may be damaged, or of another kind: check what wrote it") from None


def refuse_no_file(path: Path) -> None:
    """Refuse a file that is missing, empty, too large, or a folder."""
    try:
        size = path.stat().st_size
    except OSError:
        raise InputError(path, "no such file", "check the path") from None
    if path.is_dir():
        raise InputError(path, "is a folder", "give a file")
    if not size:
        raise InputError(path, "is empty", "record it again")
    if size > 1e9:
        raise InputError(path, f"has {size / 1e9:.1f} GB, and 1 GB is read as a whole", "cut it, or save it as CSV")
