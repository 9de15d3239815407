"""What the core itself registers, as an ordinary plug-in: its worlds and its demonstration readers."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.hookspecs import hookimpl
from skillframe.records import ReaderType, WorldType


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The worlds that ship with the core."""
    from skillframe.world.catalogue import world_types

    return world_types()


@hookimpl
def skillframe_readers() -> Iterable[ReaderType]:
    """The demonstration formats that ship with the core."""
    from skillframe.demonstration.formats import reader_types

    return reader_types()
