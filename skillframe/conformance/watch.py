"""Watching what foreign code leaves behind while it runs: words on the terminal, files, other programs."""

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

from skillframe.paths import cache_base

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
"""Audit events of the interpreter, and what each means in words; `open` is looked at for its mode."""


@dataclass(slots=True)
class Seen:
    """What was watched.

    Attributes:
        out: text written to standard output and standard error.
        deeds: what was done to files, programs and connections, each once and in order.
        read: absolute paths of files that were opened for reading, each once and in order.
    """

    out: io.StringIO = field(default_factory=io.StringIO)
    deeds: list[str] = field(default_factory=list)
    read: list[str] = field(default_factory=list)


_WATCHING: list[Seen] = []


def printed(seen: Seen) -> Iterator[str]:
    """What was printed, in words."""
    if text := seen.out.getvalue().strip():
        yield f"prints {text.splitlines()[0][:60]!r}, which gets into what a command prints; leave it out"


def left_behind(seen: Seen) -> Iterator[str]:
    """What was printed and done, in words."""
    yield from printed(seen)
    for deed in seen.deeds[:3]:
        yield f"{deed}; a plug-in owns no files and no programs, so leave it out"


def read_elsewhere(seen: Seen, folder: Path) -> Iterator[str]:
    """Files that were read and lie neither in a folder nor where code and its settings lie, in words.

    Code lies on the path that modules are found on, in the interpreter's folders and the system's; libraries also read
    what they keep in the user's `.cache` and `.config`. A place that the folder itself lies in does not count.
    """
    here = os.path.realpath(folder)
    known = [here, *(place for place in _code_places() if not here.startswith(place + os.sep))]
    for path in seen.read:
        real = os.path.realpath(path)
        if not any(real == place or real.startswith(place + os.sep) for place in known):
            yield f"reads {os.path.basename(path)!r}, which is none of the files it was given; use those alone"


def _code_places() -> list[str]:
    home = os.path.expanduser("~")
    own = [sys.prefix, sys.base_prefix, *(entry for entry in sys.path if entry)]
    system = ["/usr", "/lib", "/proc", "/sys", "/dev", "/etc/fonts", f"{home}/.cache", f"{home}/.config"]
    return [os.path.realpath(place) for place in (*own, *system) if os.path.realpath(place) != os.sep]


@contextlib.contextmanager
def watched() -> Iterator[Seen]:
    """Keep what is printed off the terminal, and note it with what is written, removed, run and connected to."""
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
    """Ask the interpreter to tell. It cannot be asked to stop, so this is done once a process."""
    sys.addaudithook(_told)


def _told(event: str, arguments: tuple[Any, ...]) -> None:
    if not _WATCHING:
        return
    if event == "open":
        _note_read(*arguments)
    if not (deed := _deed(event, arguments)):
        return
    for seen in _WATCHING:
        if deed not in seen.deeds:
            seen.deeds.append(deed)


def _note_read(path: Any, mode: object, flags: Any) -> None:
    if not isinstance(path, str | bytes | os.PathLike) or (isinstance(flags, int) and flags & WRITING):
        return
    absolute = os.path.abspath(os.fsdecode(path))
    for seen in _WATCHING:
        if absolute not in seen.read:
            seen.read.append(absolute)


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
    """What the interpreter writes when it imports, what we cache, and the device that takes everything.

    A number stands for a file that was opened by its path before, and told then.
    """
    if isinstance(path, int) or path == os.devnull or "__pycache__" in str(path):
        return True
    return isinstance(path, str | os.PathLike) and Path(path).is_relative_to(cache_base())


def _name(path: Any) -> str:
    return repr(os.path.basename(os.fsdecode(path))) if isinstance(path, str | bytes | os.PathLike) else repr(path)
