"""Worlds of a user's own parts, named by their fixture file: "path/fixture.toml"."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from skillframe.errors import InputError
from skillframe.extend.records import WorldType

FILE_ENDING = ".toml"


def world_of_file(name: str) -> WorldType:
    """The record of a fixture file's world. Its meshes are read when a scene is built.

    Raises:
        InputError: the file is missing, or something in it cannot be used.
    """
    from skillframe.parts.declared import read_fixture
    from skillframe.parts.load import name_of
    from skillframe.parts.world import build_world, params_of

    path = Path(name)
    summary = read_fixture(path).summary or "two parts from mesh files"
    return WorldType(name=name_of(path), summary=summary, params=params_of(path), build=partial(build_world, path))


def refuse_part(name: str) -> None:
    """Refuse a part's file where a world is named.

    Raises:
        InputError: says how it becomes one.
    """
    ending = Path(name).suffix.lower()
    if not ending:
        return
    from skillframe.parts.scenes import ENDINGS
    from skillframe.parts.solid import FORMATS

    if ending in (*FORMATS, *ENDINGS):
        fix = "make one of two parts, skillframe worlds new PLUG SOCKET, and name its fixture.toml"
        raise InputError(name, "is a part, not a world", fix)
