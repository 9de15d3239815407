"""What the core itself registers, as an ordinary plug-in: worlds, readers, exporters and robots."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.contract import CONTRACT
from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import ExporterType, Lazy, ReaderType, RobotType, WorldType

skillframe_contract = CONTRACT


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


@hookimpl
def skillframe_exporters() -> Iterable[ExporterType]:
    """The formats of other controllers that ship with the core."""
    from skillframe.extend.exporters import exporter_types

    return exporter_types()


@hookimpl
def skillframe_robots() -> Iterable[RobotType]:
    """The robots that ship with the core."""
    from skillframe.extend.robots import robot_types

    return robot_types()
