"""What the core itself registers, as an ordinary plug-in: worlds and demonstration readers."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import Lazy, ReaderType, WorldType


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The worlds that ship with the core."""
    from skillframe.extend.worlds import world_types

    return world_types()


@hookimpl
def skillframe_readers() -> Iterable[ReaderType]:
    """The demonstration formats that ship with the core."""
    from skillframe.extend.readers import reader_types

    return reader_types(Lazy("skillframe.robot.recorded:tool_poses"))  # its library is loaded for joint states only
