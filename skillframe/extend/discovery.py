"""Finding installed plug-ins: distributions with an entry point in the group, damaged ones included."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.metadata import Distribution, EntryPoint, distributions

from skillframe.extend.contract import GROUP
from skillframe.extend.plugin import BadPlugin, Plugin


def installed() -> list[tuple[Plugin, Callable[[], object]]]:
    """Installed plug-ins with what loads them, by name. A damaged distribution is kept with what it raises.

    Only distributions whose entry points mention the group are parsed, so that an unrelated damaged one does no harm.
    """
    found: dict[tuple[str, str], tuple[Plugin, Callable[[], object]]] = {}
    seen: set[str] = set()
    for distribution in distributions():
        text = distribution.read_text("entry_points.txt") or ""
        if not re.search(rf"^\[{GROUP}\]", text, re.MULTILINE):
            continue
        name, version = _identity(distribution)
        if name.lower() in seen:  # the first on the path is the one that imports
            continue
        seen.add(name.lower())
        for entry, load in _entries(distribution, name):
            found[entry, name] = (
                Plugin(name=entry, distribution=name, version=version, requires=_requires(distribution)), load,
            )  # fmt: skip
    return [found[key] for key in sorted(found)]


def _identity(distribution: Distribution) -> tuple[str, str]:
    """Name and version. From the folder's name where the metadata is damaged."""
    try:
        name, version = distribution.metadata["Name"], distribution.metadata["Version"]
    except Exception:  # metadata is foreign text; whatever it raises, the folder's name remains
        name, version = None, None
    folder = getattr(getattr(distribution, "_path", None), "stem", "unknown")
    stem, _, rest = folder.partition("-")
    return str(name or stem), str(version or rest or "?")


def _requires(distribution: Distribution) -> tuple[str, ...]:
    try:
        return tuple(distribution.requires or ())
    except Exception:  # see `_identity`; what is damaged is said by `_entries`
        return ()


def _entries(distribution: Distribution, name: str) -> list[tuple[str, Callable[[], object]]]:
    try:
        points = [point for point in distribution.entry_points if point.group == GROUP]
    except Exception as error:  # a damaged entry_points.txt
        return [(name, _raiser(BadPlugin(f"entry_points.txt of {name} cannot be read ({error}); install it again")))]
    return [(point.name, _loader(point)) for point in points]


def _loader(point: EntryPoint) -> Callable[[], object]:
    return lambda: point.load()


def _raiser(error: Exception) -> Callable[[], object]:
    def load() -> object:
        raise error

    return load
