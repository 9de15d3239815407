"""Atomic writing of files, and the places of skillframe's data and caches.

A file is written under a random name, synced, then renamed. The temporary file is in the target's folder, because
renames are atomic within a file system only. Data are in the wheel's `_data`, or in folders beside the package in a
checkout.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from skillframe.errors import InputError

RANDOM_BYTES = 8
_TEMPORARY = re.compile(rf"\..+\.[0-9a-f]{{{2 * RANDOM_BYTES}}}")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically, with its folder. An existing file or link is replaced.

    Raises:
        InputError: the place cannot be written to, or is full.
    """
    with writing_whole(path) as temporary, temporary.open("r+b") as file:
        file.write(content)


@contextmanager
def writing_whole(path: Path) -> Iterator[Path]:
    """Yield an empty temporary file that replaces the target if the block succeeds.

    Raises:
        InputError: the place cannot be written to, or is full.
    """
    try:
        if path.is_dir():
            raise InputError(path, "cannot be written (it is a folder)", "give the name of a file")
        if path.exists() and not path.is_file():
            raise InputError(path, "cannot be written (it is a device or a pipe)", "give the name of a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        # `tempfile.mkstemp` ignores the umask
        beginning = path.name[:40]  # file systems allow names of 255 bytes
        temporary = path.with_name(f".{beginning}.{os.urandom(RANDOM_BYTES).hex()}")
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise not_written(path, error) from None
    try:
        yield temporary
        _sync(temporary, os.O_RDWR)  # Windows cannot sync read-only files
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder, where the file system can."""
    with suppress(OSError):
        _sync(folder, os.O_RDONLY)


def remove_temporary(folder: Path) -> None:
    """Remove temporary files of killed processes from a folder without writers."""
    for path in folder.glob(".*"):
        if _TEMPORARY.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def not_written(path: Path, error: OSError) -> InputError:
    """Error for a file that could not be written."""
    said = error.strerror or str(error) or type(error).__name__
    return InputError(path, f"cannot be written ({said})", "make room there, or choose another place for the output")


def _sync(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


_PACKAGE = Path(__file__).resolve().parents[1]
OFFERS: dict[str, Callable[[str | None], Mapping[str, Path]]] = {}
"""By kind of data, a function that returns the folders of plug-ins by name: all of them, or the named one.

`skillframe/__init__.py` fills it, since this package lies below the registry.
"""


WRITES_OUT: list[Callable[[dict[str, Any], Path], dict[str, Any]]] = []
"""Functions that return the content of a robot.toml with short tables of plug-ins as the core's, filled likewise."""


def data_dirs(kind: str) -> list[Path]:
    """Folders that hold data of a kind ("robots", "fmus"), the user's own first.

    Folders in the environment variable `SKILLFRAME_PATH` precede the shipped ones; each should have a sub-folder of
    that kind.
    """
    own = [Path(p) for p in os.environ.get("SKILLFRAME_PATH", "").split(os.pathsep) if p]
    return [*(folder / kind for folder in own if (folder / kind).is_dir()), *shipped_dirs(kind)]


def shipped_dirs(kind: str) -> list[Path]:
    """Folders of skillframe's own data of a kind."""
    return [folder / kind for folder in (_PACKAGE / "_data", _PACKAGE.parent) if (folder / kind).is_dir()]


def checkout() -> Path | None:
    """Folder of the source code that this package runs from, or None for an installed wheel."""
    folder = _PACKAGE.parent
    return folder if (folder / "plugins" / "all.txt").is_file() else None


def cache_base() -> Path:
    """`$XDG_CACHE_HOME/skillframe`, which may not exist."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "skillframe"


def cache_dir(kind: str) -> Path:
    """A cache folder, created if absent: `$XDG_CACHE_HOME/skillframe/<kind>`."""
    folder = cache_base() / kind
    folder.mkdir(parents=True, exist_ok=True)
    return folder
