"""Records side effects of a plug-in's code: output, files, programs."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from skillframe.files import cache_base

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGING = {
    "os.mkdir": "makes the folder",
    "os.remove": "removes",
    "os.rename": "renames",
    "os.rmdir": "removes the folder",
    "os.system": "runs the program",
    "socket.connect": "connects to",
    "subprocess.Popen": "runs the program",
}
"""Audit events of the interpreter, in words; `open` depends on its mode."""


@dataclass(slots=True)
class Seen:
    """Recorded side effects.

    Attributes:
        out: text on standard output and standard error.
        deeds: effects on files, programs and connections, each once and in order.
        read: absolute paths of files read, each once and in order.
    """

    out: io.StringIO = field(default_factory=io.StringIO)
    deeds: list[str] = field(default_factory=list)
    read: list[str] = field(default_factory=list)


_WATCHING: list[Seen] = []


def printed(seen: Seen) -> Iterator[str]:
    """Output as a sentence."""
    if text := seen.out.getvalue().strip():
        yield f"prints {text.splitlines()[0][:60]!r}, which gets into what a command prints; leave it out"


def left_behind(seen: Seen) -> Iterator[str]:
    """All side effects as sentences."""
    yield from printed(seen)
    for deed in seen.deeds[:3]:
        yield f"{deed}; a plug-in owns no files and no programs, so leave it out"


def read_elsewhere(seen: Seen, folder: Path) -> Iterator[str]:
    """Sentences on files read outside a folder and the places of code and settings.

    These are the module path, the interpreter's and the system's folders, and the user's `.cache` and `.config`, unless
    they contain the folder itself.
    """
    here, home = os.path.realpath(folder), os.path.expanduser("~")
    code = [sys.prefix, sys.base_prefix, *(entry for entry in sys.path if entry)]
    system = ["/usr", "/lib", "/proc", "/sys", "/dev", "/etc/fonts", f"{home}/.cache", f"{home}/.config"]
    places = [os.path.realpath(place) for place in (*code, *system) if os.path.realpath(place) != os.sep]
    known = [here, *(place for place in places if not here.startswith(place + os.sep))]
    for path in seen.read:
        real = os.path.realpath(path)
        if not any(real == place or real.startswith(place + os.sep) for place in known):
            yield f"reads {os.path.basename(path)!r}, which is none of the files it was given; use those alone"


@contextlib.contextmanager
def watched() -> Iterator[Seen]:
    """Capture output, and record files, programs and connections."""
    _hook()
    seen = Seen()
    _WATCHING.append(seen)
    try:
        with contextlib.redirect_stdout(seen.out), contextlib.redirect_stderr(seen.out):
            yield seen
    finally:
        _WATCHING.remove(seen)


@cache
def _hook() -> None:
    """Install the audit hook, once per process because it cannot be removed."""
    sys.addaudithook(_told)


def _told(event: str, arguments: tuple[Any, ...]) -> None:
    if not _WATCHING:
        return
    if event == "open":
        path, _, flags = arguments
        if isinstance(path, str | bytes | os.PathLike) and not (isinstance(flags, int) and flags & WRITING):
            absolute = os.path.abspath(os.fsdecode(path))
            for seen in _WATCHING:
                if absolute not in seen.read:
                    seen.read.append(absolute)
    if not (deed := _deed(event, arguments)):
        return
    for seen in _WATCHING:
        if deed not in seen.deeds:
            seen.deeds.append(deed)


def _deed(event: str, arguments: tuple[Any, ...]) -> str:
    if event == "open":
        path, _, flags = arguments
        writes = isinstance(flags, int) and flags & WRITING and not _own(path)
        return f"opens the file {_name(path)} for writing" if writes else ""
    if event not in CHANGING:
        return ""
    what = arguments[1] if event == "socket.connect" else arguments[0]
    return "" if _own(what) else f"{CHANGING[event]} {_name(what)}"


def _own(path: Any) -> bool:
    """Writes by imports, to the cache and to the null device.

    A number is a file that was opened by its path before.
    """
    if isinstance(path, int) or path == os.devnull or "__pycache__" in str(path):
        return True
    return isinstance(path, str | os.PathLike) and Path(path).is_relative_to(cache_base())


def _name(path: Any) -> str:
    return repr(os.path.basename(os.fsdecode(path))) if isinstance(path, str | bytes | os.PathLike) else repr(path)
