"""What the core itself registers, as an ordinary plug-in: worlds, demonstration readers, rows of the crane."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.records import ReaderType, RowType, WorldType

if TYPE_CHECKING:
    from skillframe.frames import Float, Pose


@hookimpl
def skillframe_worlds() -> Iterable[WorldType]:
    """The worlds that ship with the core."""
    from skillframe.extend.worlds import world_types

    return world_types()


@hookimpl
def skillframe_readers() -> Iterable[ReaderType]:
    """The demonstration formats that ship with the core."""
    from skillframe.extend.readers import reader_types

    return reader_types(_tool_poses)


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """Published results that need no plug-in."""
    from skillframe.reproduce.crane import row_types

    return row_types()


def _tool_poses(robot: str, arm: str | None, names: Sequence[str], positions: Float) -> Pose:
    """Forward kinematics, whose library is loaded when joint states are read."""
    from skillframe.robot.recorded import tool_poses

    return tool_poses(robot, arm, names, positions)
