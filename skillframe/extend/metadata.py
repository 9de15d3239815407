"""Metadata of installed distributions with a group of entry points, without `importlib.metadata`.

Importing that would dominate the time of `skillframe --help`. It is used only where the path holds more than folders,
such as zip files, or another finder.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib.machinery import PathFinder

Read = Callable[[str], "str | None"]
"""Text of a file of a distribution's metadata by name, or None."""
FOLDERS = (".dist-info", ".egg-info")


EntryPoint = tuple[str, str, str]
"""A line of entry_points.txt: group, name, value."""
Declared = tuple[str, str, list[EntryPoint]]
"""A distribution with a group: its name, version and all entry points."""


def search_path() -> Sequence[str]:
    """Where Python looks for distributions."""
    return sys.path


def declaring(group: str) -> Iterator[Declared]:
    """Distributions whose entry points mention a group, in the order of the path.

    Of several with one name only the first, which is the one that imports; none without a name.
    """
    seen: set[str] = set()
    for read in _distributions():
        text = read("entry_points.txt") or ""
        if f"[{group}]" not in text or not any(line.strip() == f"[{group}]" for line in text.splitlines()):
            continue
        fields = (read("METADATA") or read("PKG-INFO") or "").partition("\n\n")[0].splitlines()
        head = {key.strip().lower(): value.strip() for key, _, value in (line.partition(":") for line in fields)}
        name = head.get("name", "")
        if name and name.lower() not in seen:
            seen.add(name.lower())
            yield name, head.get("version", "?"), list(_points(text))


def _distributions() -> Iterator[Read]:
    path = search_path()
    plain = all(
        (os.path.isdir(place or os.curdir) and not place.endswith(".egg")) or not os.path.exists(place)
        for place in path
    )
    if plain and not any(each is not PathFinder and hasattr(each, "find_distributions") for each in sys.meta_path):
        for place in path:
            yield from _in_folder(place or os.curdir)
        return
    from importlib.metadata import distributions

    yield from (each.read_text for each in distributions(path=list(path)))


def _in_folder(place: str) -> Iterator[Read]:
    with suppress(OSError), os.scandir(place) as entries:
        for entry in entries:
            if entry.name.lower().endswith(FOLDERS):
                yield _reader(entry.path)


def _reader(folder: str) -> Read:
    def read(name: str) -> str | None:
        try:
            with open(f"{folder}/{name}", "rb", buffering=0) as file:  # a third of the cost of text mode
                return file.read().decode("utf-8", "replace").replace("\r\n", "\n")
        except OSError:
            return None

    return read


def _points(text: str) -> Iterator[EntryPoint]:
    group = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("[") and line.endswith("]"):
            group = line[1:-1]
        elif "=" in line and not line.startswith("#"):
            name, _, value = line.partition("=")
            yield group, name.strip(), value.strip()
