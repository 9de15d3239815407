"""Layout files from proposals, one for many recordings of a logger."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skillframe.demonstration import FILES, TYPED, toml_text
from skillframe.errors import InputError
from skillframe.files import write_whole

OF_ONE = ("wrench", "episode", "start", "stop")
"""Settings that choose one recording and do not belong in a layout."""
MAY_BE_OPEN = ("wrench_frame", "wrench_sign", "wrench_includes_tool_weight")
"""Settings that only some recordings may determine."""


def key_of(setting: str) -> str:
    """Return a setting's key in a layout file."""
    return TYPED.get(setting, setting).replace("_", "-")


def typed(setting: str, value: object) -> tuple[str, str]:
    """Return the words of the command line that give a setting."""
    return "--set", f"{key_of(setting)}={str(value).lower() if isinstance(value, bool) else value}"


def write_layout(path: Path, settings: Mapping[str, Any], undecided: Iterable[str], why: str) -> None:
    """Write a layout file. Files that it names are relative to it."""
    own = {k: os.path.relpath(v, path.parent) if k in FILES else v for k, v in settings.items() if k not in OF_ONE}
    comments = [f"# {why}", *(f"# undecided: {text}" for text in undecided)]
    text = "\n".join(comments) + "\n" + toml_text({key_of(name): value for name, value in own.items()})
    write_whole(path, text.encode())


def merged(layouts: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return one layout from the settings of several files.

    Raises:
        InputError: two of them contradict each other.
    """
    (first, result), *others = layouts.items()
    together = dict(result)
    for file, settings in others:
        for name in {**together, **settings}:
            one, other = together.get(name), settings.get(name)
            if one != other and not (name in MAY_BE_OPEN and None in (one, other)):
                raise InputError(
                    file, f"has {_said(name, other)}, and {first} has {_said(name, one)}",
                    "write a layout for each kind of recording",
                )  # fmt: skip
        together = {**settings, **together}
    return together


def _said(name: str, value: object) -> str:
    return f"no {key_of(name)}" if value is None else " ".join(typed(name, value))
