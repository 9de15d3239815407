"""Worlds of a user's own parts, named by their fixture file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from skillframe.errors import InputError
from skillframe.extend import WorldType


def world_of_file(path: Path) -> WorldType:
    """The record of a fixture file's world. Its meshes are read when a scene is built.

    Raises:
        InputError: the file is missing or invalid.
    """
    from skillframe_parts.declared import read_fixture
    from skillframe_parts.load import name_of
    from skillframe_parts.world import build_world, params_of

    summary = read_fixture(path).summary or "two parts from mesh files"
    return WorldType(name=name_of(path), summary=summary, params=params_of(path), build=partial(build_world, path))


def refuse_part(name: str) -> None:
    """Refuse a part's file as the name of a world.

    Raises:
        InputError: with the command that makes a world of it.
    """
    ending = Path(name).suffix.lower()
    if not ending:
        return
    from skillframe_parts.scenes import ENDINGS
    from skillframe_parts.solid import FORMATS

    if ending in (*FORMATS, *ENDINGS):
        fix = "make one of two parts, skillframe worlds new PLUG SOCKET, and name its fixture.toml"
        raise InputError(name, "is a part, not a world", fix)
