"""Listings of registered names, and details of one, read from its dataclass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from skillframe.config import settings_of
from skillframe.errors import InputError, UnknownName

if TYPE_CHECKING:
    from skillframe.extend.registry import Registry


def by_kind(provides: Sequence[str]) -> dict[str, list[str]]:
    """Names of a plug-in by kind, {"worlds": ["free", ...]}, from "world:free" and so on."""
    kinds: dict[str, list[str]] = {}
    for each in provides:
        kind, name = each.split(":", 1)
        kinds.setdefault(f"{kind}s", []).append(name)
    return kinds


def found(registry: Registry, name: str) -> dict[str, Any]:
    """Details of a name, "peg_in_hole" or "world:peg_in_hole", as JSON values.

    Raises:
        UnknownName: nothing has it.
        InputError: several kinds do.
    """
    known = [each for plugin in registry.plugins for each in plugin.provides]
    full = [each for each in known if name in (each, each.split(":", 1)[1])]
    if len(full) > 1:
        raise InputError(name, f"is the name of {' and of '.join(full)}", f"type one of them, {full[0]}")
    if not full:
        raise UnknownName("name", name, [each.split(":", 1)[1] for each in known if not each.startswith("row:")])
    kind, short = full[0].split(":", 1)
    record, plugin = registry.record(kind, short), registry.provider(kind, short)
    given = getattr(record, "settings", None)
    settings = record.params if kind == "world" else given() if callable(given) else None
    return {
        "name": short, "kind": kind, "summary": record.summary, "distribution": plugin.distribution,
        "version": plugin.version, "settings": list(settings_of(settings)) if isinstance(settings, type) else None,
        "facts": {what: str(getattr(record, field)) for field, what in FACTS.items() if getattr(record, field, None)},
    }  # fmt: skip


FACTS = {
    "contract": "written for contract", "unit": "unit", "axes": "axes", "checked": "checked against",
    "folder": "folder", "title": "heading",
}  # fmt: skip
"""Fields of records that describe one, and their headings."""


def rows_of(registry: Registry, kind: str) -> list[dict[str, Any]]:
    """A row per record of a kind, by name: `name`, `kind`, `summary`, `distribution`, `version`."""
    rows = []
    for record in registry.records(kind):
        plugin = registry.provider(kind, record.name)
        rows.append({
            "name": record.name, "kind": kind, "summary": record.summary, "distribution": plugin.distribution,
            "version": plugin.version,
        })  # fmt: skip
    return rows
