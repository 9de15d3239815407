"""What is registered, for people: names by kind, and one of them with what can be set, read off its dataclass."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from skillframe.errors import UnknownName

if TYPE_CHECKING:
    from skillframe.registry import Registry

ENTRY = re.compile(r"    (\w[\w, ]*): (.*)")


def by_kind(provides: Sequence[str]) -> dict[str, list[str]]:
    """Names by kind, {"worlds": ["free", ...]}, of what a plug-in provides, "world:free" and so on."""
    kinds: dict[str, list[str]] = {}
    for each in provides:
        kind, name = each.split(":", 1)
        kinds.setdefault(f"{kind}s", []).append(name)
    return kinds


def found(registry: Registry, name: str) -> dict[str, Any]:
    """What goes by a name, "peg_in_hole" or "world:peg_in_hole", as plain JSON values.

    Raises:
        UnknownName: nothing does, or several kinds do.
    """
    known = [each for plugin in registry.plugins for each in plugin.provides]
    full = [each for each in known if name in (each, each.split(":", 1)[1])]
    if len(full) != 1:
        raise UnknownName(
            "name", name, full or [each.split(":", 1)[1] for each in known if not each.startswith("row:")]
        )
    kind, short = full[0].split(":", 1)
    record, plugin = getattr(registry, kind)(short), registry.provider(kind, short)
    given = getattr(record, "settings", None)
    settings = record.params if kind == "world" else given() if callable(given) else None
    return {
        "name": short, "kind": kind, "summary": record.summary, "distribution": plugin.distribution,
        "version": plugin.version, "settings": list(settings_of(settings)) if isinstance(settings, type) else None,
    }  # fmt: skip


def settings_of(kind: type) -> Iterator[dict[str, Any]]:
    """Fields of a dataclass with their defaults and what its docstring says of them."""
    texts = _texts(kind)
    for field in dataclasses.fields(kind):
        factory = field.default_factory
        default = factory() if factory is not dataclasses.MISSING else field.default
        required = default is dataclasses.MISSING
        yield {"name": field.name, "default": None if required else default, "about": texts.get(field.name, "")}


def _texts(kind: type) -> dict[str, str]:
    """Entries under "Attributes:" in the docstrings of a dataclass and its bases; several names may share one."""
    texts: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        names: list[str] = []
        for line in inspect.cleandoc(each.__doc__ or "").partition("Attributes:\n")[2].splitlines():
            entry = ENTRY.fullmatch(line)
            names = entry[1].split(", ") if entry else names
            texts |= {n: entry[2] if entry else f"{texts.get(n, '')} {line.strip()}".strip() for n in names}
    return texts
