"""Reading and writing demonstrations by file name: the ending chooses the format among those that are registered."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from skillframe.demonstration.bagfile import BAG_FACTS
from skillframe.errors import InputError
from skillframe.extend.records import ReaderType

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration


PACKED_BAGS = (".db3.zstd", ".mcap.zstd")


def read_demonstration(path: Path | str, **options: Any) -> Demonstration:
    """A demonstration from a file of any registered format.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        **options: settings of the format; the core's readers take the fields of `options.ReadOptions`.

    Raises:
        InputError: an ending that no format has, or anything wrong with the file.
    """
    path = Path(path)
    return _format_of(path, reading=True, named_columns=options.get("columns") is not None).read(path, options)


def write_demonstration(demonstration: Demonstration, path: Path | str) -> None:
    """Write a demonstration. The file appears complete or not at all.

    Raises:
        InputError: an ending that no format writes, or a place that cannot be written to.
    """
    path = Path(path)
    write = _format_of(path, reading=False).write
    assert write is not None
    write(demonstration, path)


def check_writable(path: Path | str) -> None:
    """Refuse a file name that no format writes, before the work that fills the file.

    Raises:
        InputError: with the endings there are.
    """
    _format_of(Path(path), reading=False)


def _format_of(path: Path, *, reading: bool, named_columns: bool = False) -> ReaderType:
    """The format of the longest matching ending. Any ending is delimited text once its columns are named."""
    from skillframe.extend.registry import registry

    records: list[ReaderType] = [r for r in registry().records("reader") if reading or r.write is not None]
    if reading and (path / BAG_FACTS).is_file():
        return registry().reader("rosbag")
    if reading and path.name.lower().endswith(PACKED_BAGS):
        raise InputError(path, "is a packed part of a ROS bag", f"give the bag's folder, {path.parent}")
    matches = [(len(s), r) for r in records for s in r.suffixes if path.name.lower().endswith(s)]
    if matches:
        return max(matches, key=lambda match: match[0])[1]
    if reading and named_columns:
        return registry().reader("delimited")
    if reading and path.is_dir():
        raise InputError(path, "is a folder", "give a file")
    if reading and not path.exists():
        raise InputError(path, "no such file", "check the path")
    endings = ", ".join(sorted(s for r in records for s in r.suffixes))
    advice = f"use one of {endings}" + (", or name the columns with --columns" if reading else "")
    raise InputError(path, f"no format {'reads' if reading else 'writes'} files ending in {path.suffix!r}", advice)
