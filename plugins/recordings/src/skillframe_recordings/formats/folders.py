"""Which folders are recordings. Called for every file, so imports stay light."""

from __future__ import annotations

from pathlib import Path

from skillframe.errors import InputError

BAG_FACTS = "metadata.yaml"
"""Metadata file in the folder of a ROS 2 bag."""
PACKED_BAGS = (".db3.zstd", ".mcap.zstd")


def is_bag(path: Path) -> bool:
    """Return whether a path is the folder of a ROS 2 bag.

    Raises:
        InputError: it is a packed part of one.
    """
    if (path / BAG_FACTS).is_file():
        return True
    if path.name.lower().endswith(PACKED_BAGS):
        raise InputError(path, "is a packed part of a ROS bag", f"give the bag's folder, {path.parent}")
    return False


def is_data_set(path: Path) -> bool:
    """Return whether a path is the folder of a LeRobot data set."""
    return (path / "meta" / "info.json").is_file()
