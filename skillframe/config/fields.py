"""What a dataclass says of its own fields: default, meaning and unit, read off its docstring."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from skillframe.config.ranges import Range, range_of, require_within
from skillframe.config.units import unit_of

ENTRY = re.compile(r"    (\w[\w, ]*): (.*)")


def settings_of(kind: type) -> Iterator[dict[str, Any]]:
    """Fields of a dataclass: `name`, `default` (None if there is none), `about`, `unit` (SI, "" if none), `range`.

    The range is (least, most) in SI, or None where the text about the field states none.
    """
    said = texts(kind)
    for field in dataclasses.fields(kind):
        factory = field.default_factory
        default = factory() if factory is not dataclasses.MISSING else field.default
        required, about = default is dataclasses.MISSING, said.get(field.name, "")
        limits = range_of(about)
        yield {
            "name": field.name, "default": None if required else default, "about": about, "unit": unit_of(about),
            "range": None if limits is None else limits[:2],
        }  # fmt: skip


def require_ranges(given: Any, where: str) -> None:
    """Refuse a dataclass with a number beyond the range that the text about its field states.

    Args:
        given: the dataclass; None has nothing to refuse.
        where: for messages.

    Raises:
        InputError: names the first such field.
    """
    for row in settings_of(type(given)) if given is not None else ():
        value, limits = getattr(given, row["name"]), row["range"]
        require_within(value, value, row["unit"], limits and Range(*limits), f"{where}.{row['name']}")


@lru_cache(maxsize=256)
def texts(kind: type) -> Mapping[str, str]:
    """Entries under "Attributes:" in the docstrings of a dataclass and its bases. Several names may share one."""
    said: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        names: list[str] = []
        for line in inspect.cleandoc(each.__doc__ or "").partition("Attributes:\n")[2].splitlines():
            entry = ENTRY.fullmatch(line)
            names = entry[1].split(", ") if entry else names
            said |= {n: entry[2] if entry else f"{said.get(n, '')} {line.strip()}".strip() for n in names}
    return said
