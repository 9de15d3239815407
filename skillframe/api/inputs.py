"""Demonstrations as the functions of the API take them: objects or files, turned into objects."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

File = str | os.PathLike[str]
Demonstrations = Demonstration | File | Iterable[Demonstration | File]
"""One demonstration or several, each as an object or as a file of any registered format."""


def demonstrations_of(given: Demonstrations) -> list[Demonstration]:
    """A list of demonstrations.

    Raises:
        InputError: none is given, a file cannot be read, or something is no demonstration.
    """
    several = [given] if isinstance(given, Demonstration | str | os.PathLike) else given
    if not isinstance(several, Iterable):
        raise InputError(f"{given!r:.60}", "is no demonstration", "give demonstrations or their files")
    found = [_demonstration(each) for each in several]
    if not found:
        raise InputError("demonstrations", "there are none", "give at least one")
    return found


def _demonstration(given: object) -> Demonstration:
    if isinstance(given, Demonstration):
        return given
    if isinstance(given, str | os.PathLike):
        return read_demonstration(Path(given))
    raise InputError(f"{given!r:.60}", "is no demonstration", "give a Demonstration or a file")
