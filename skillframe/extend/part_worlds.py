"""Worlds of a user's own parts, named by their fixture file: "path/fixture.toml"."""

from __future__ import annotations

from functools import partial
from pathlib import Path

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
