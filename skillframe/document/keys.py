"""Keys that a document must hold, and what may stand under them."""

from __future__ import annotations

from typing import Any

from skillframe.errors import InputError

_WORDS = {str: "text", int: "a whole number", dict: "an object", list: "a list"}


def at(where: str, key: str) -> str:
    """A place for messages: the key, after the file's name if there is one."""
    return f"{where}: {key}" if where else key


def demand(values: Any, key: str, kind: type, where: str, inside: str = "") -> None:
    """Refuse an object without a key, or with something else under it.

    Args:
        values: the object.
        key: what it must hold.
        kind: `str`, `int`, `dict` or `list`.
        where: the document, for messages; "" if it has no name.
        inside: where the object stands in the document, such as "frame".

    Raises:
        InputError: names the key.
    """
    name = f"{inside}.{key}" if inside else key
    if not isinstance(values, dict) or key not in values:
        raise InputError(where or "document", f"lacks the key {name!r}", "add it, or learn the skill again")
    if not isinstance(values[key], kind) or isinstance(values[key], bool):
        raise InputError(at(where, name), f"should be {_WORDS[kind]}", "mend it, or learn the skill again")
