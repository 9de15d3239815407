"""Worlds of a user's own parts: two meshes and a `fixture.toml`.

This module registers them and is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, LazyCommand, WorldFileType

skillframe_contract = "0.2"

new = LazyCommand("Make a world of two meshes.", "skillframe_parts.command:new")


@hookimpl
def skillframe_world_files() -> Iterable[WorldFileType]:
    """Fixture files that name two parts as meshes, or scenes in MJCF or SDFormat."""
    yield WorldFileType(
        name="parts", summary="two parts from mesh files, or scenes in MJCF or SDFormat",
        world=Lazy("skillframe_parts.record:world_of_file"), files=Lazy("skillframe_parts.declared:mesh_files"),
        refuse=Lazy("skillframe_parts.record:refuse_part"), found=Lazy("skillframe_parts.found:found"),
    )  # fmt: skip
