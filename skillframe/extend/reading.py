"""Reading and writing demonstrations by file name: the ending chooses the format among those that are registered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skillframe.demonstration.bagfile import BAG_FACTS
from skillframe.errors import InputError, SkillframeError
from skillframe.extend.records import ReaderType

if TYPE_CHECKING:
    from skillframe.demonstration.proposal.propose import Proposal
    from skillframe.demonstration.record import Demonstration
    from skillframe.demonstration.table import Table

AUTO = "auto"
"""Value of `columns` that asks for a proposal."""

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
    if options.get("columns") == AUTO:
        raise InputError(
            "--columns auto", "proposes columns and reads nothing",
            f"type skillframe demonstration check {path} --columns auto, and then the line that it prints",
        )  # fmt: skip
    return _format_of(path, reading=True, named_columns=options.get("columns") is not None).read(path, options)


def propose_reading(path: Path | str, **options: Any) -> Proposal:
    """The settings that read a foreign table, proposed with reasons (`demonstration.proposal`), and whether they do.

    Args:
        path: the file.
        **options: settings that are known, as `read_demonstration` takes them; they are kept.

    Raises:
        InputError: no table, or nothing of a demonstration in it.
    """
    from skillframe.demonstration.proposal.propose import propose

    given = {name: value for name, value in options.items() if name != "columns" and value is not None}
    wrench = given.get("wrench")
    found = propose(_table(Path(path), given), None if wrench is None else _table(Path(wrench), given), given)
    if not found.whole:
        return found
    settings = {name: value or True for name, value in found.settings.items()}
    try:
        read_demonstration(path, **{**settings, **given})
    except SkillframeError as error:
        return replace(found, error=str(error))
    return found


def _table(path: Path, options: dict[str, Any]) -> Table:
    form = _format_of(path, reading=True, named_columns=True)
    if form.table is None:
        raise InputError(path, f"is no table but a {form.name}", "leave --columns away")
    return form.table(path, options)


def write_demonstration(demonstration: Demonstration, path: Path | str) -> None:
    """Write a demonstration. The file appears complete or not at all.

    Raises:
        InputError: an ending that no format writes, or a place that cannot be written to.
    """
    path = Path(path)
    if is_data_set(path):
        return write_data_set([demonstration], path)
    write = _format_of(path, reading=False).write
    assert write is not None
    write(demonstration, path)


def is_data_set(path: Path) -> bool:
    """Whether a name to write to is that of a data set of LeRobot: one without an ending."""
    return not path.suffix


def write_data_set(demonstrations: Sequence[Demonstration], path: Path | str) -> None:
    """Write demonstrations as a data set of LeRobot, version 3.0. The folder appears complete or not at all.

    Raises:
        InputError: the folder is there, or the demonstrations do not go together.
    """
    from skillframe.demonstration.lerobot import write_lerobot

    write_lerobot(demonstrations, Path(path))


def check_writable(path: Path | str) -> None:
    """Refuse a file name that no format writes, before the work that fills the file.

    Raises:
        InputError: with the endings there are, or a data set's folder that holds something.
    """
    if is_data_set(Path(path)):
        from skillframe.demonstration.lerobot import check_new

        return check_new(Path(path))
    _format_of(Path(path), reading=False)


def _format_of(path: Path, *, reading: bool, named_columns: bool = False) -> ReaderType:
    """The format of the longest matching ending. Any ending is delimited text once its columns are named."""
    from skillframe.extend.registry import registry

    records: list[ReaderType] = [r for r in registry().records("reader") if reading or r.write is not None]
    if reading and (path / BAG_FACTS).is_file():
        return registry().reader("rosbag")
    if reading and (path / "meta" / "info.json").is_file():
        return registry().reader("parquet")
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
