"""What a dataclass says of its own fields: default, meaning and unit, read off its docstring."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any

from skillframe.config.units import unit_of

ENTRY = re.compile(r"    (\w[\w, ]*): (.*)")


def settings_of(kind: type) -> Iterator[dict[str, Any]]:
    """Fields of a dataclass: `name`, `default` (None if there is none), `about`, and `unit` (SI, "" if none)."""
    said = texts(kind)
    for field in dataclasses.fields(kind):
        factory = field.default_factory
        default = factory() if factory is not dataclasses.MISSING else field.default
        required, about = default is dataclasses.MISSING, said.get(field.name, "")
        yield {
            "name": field.name, "default": None if required else default, "about": about, "unit": unit_of(about),
        }  # fmt: skip


def texts(kind: type) -> dict[str, str]:
    """Entries under "Attributes:" in the docstrings of a dataclass and its bases. Several names may share one."""
    said: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        names: list[str] = []
        for line in inspect.cleandoc(each.__doc__ or "").partition("Attributes:\n")[2].splitlines():
            entry = ENTRY.fullmatch(line)
            names = entry[1].split(", ") if entry else names
            said |= {n: entry[2] if entry else f"{said.get(n, '')} {line.strip()}".strip() for n in names}
    return said
