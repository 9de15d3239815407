"""Where data that ships with skillframe lies: in the wheel's `_data`, or beside the package in a checkout."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
OFFERS: dict[str, Callable[[str | None], Mapping[str, Path]]] = {}
"""By kind of data, what gives the folders that plug-ins ship, by name: all of them, or the named one.

`skillframe/__init__.py` fills it, because what lies on the ground cannot ask the registry above.
"""


def data_dirs(kind: str) -> list[Path]:
    """Folders that hold data of a kind ("robots", "fmus"), the user's own first.

    Folders listed in the environment variable `SKILLFRAME_PATH` come before the shipped ones; each is expected to hold
    a sub-folder of that kind.
    """
    own = [Path(p) for p in os.environ.get("SKILLFRAME_PATH", "").split(os.pathsep) if p]
    return [*(folder / kind for folder in own if (folder / kind).is_dir()), *shipped_dirs(kind)]


def shipped_dirs(kind: str) -> list[Path]:
    """Folders that hold data of a kind that ships with skillframe."""
    return [folder / kind for folder in (_PACKAGE / "_data", _PACKAGE.parent) if (folder / kind).is_dir()]


def checkout() -> Path | None:
    """The folder of the source code that this package runs from. None where it was installed from a wheel."""
    folder = _PACKAGE.parent
    return folder if (folder / "plugins" / "all.txt").is_file() else None


def cache_base() -> Path:
    """`$XDG_CACHE_HOME/skillframe`, which need not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "skillframe"


def cache_dir(kind: str) -> Path:
    """A folder for things that can be made again (created if absent): `$XDG_CACHE_HOME/skillframe/<kind>`."""
    folder = cache_base() / kind
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def recordings_dir() -> Path | None:
    """Folder with third-party recordings, `$SKILLFRAME_RECORDINGS`, or None where it is not set or absent."""
    folder = os.environ.get("SKILLFRAME_RECORDINGS", "")
    return Path(folder) if folder and Path(folder).is_dir() else None
