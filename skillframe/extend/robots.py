"""Robots that ship with skillframe and with plug-ins."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from skillframe.config import read_toml
from skillframe.extend.contract import CONTRACT
from skillframe.extend.records import RobotType
from skillframe.extend.registry import registry
from skillframe.paths import shipped_dirs


def robot_types() -> Iterable[RobotType]:
    """Records of the robots that ship with skillframe, with the summaries of their files."""
    for folder in shipped_dirs("robots"):
        for file in sorted(folder.glob("*/robot.toml")):
            summary = str(read_toml(file).get("summary", ""))
            yield RobotType(name=file.parent.name, summary=summary, contract=CONTRACT, folder=file.parent)


def folders(name: str | None = None) -> dict[str, Path]:
    """Folder by name of every registered robot, or of one.

    Raises:
        UnknownName: there is none of that name; `PluginConflict` if two plug-ins have it.
    """
    records = registry().records("robot") if name is None else [registry().robot(name)]
    return {record.name: Path(record.folder) for record in records}
