"""Reads and writes demonstrations. The file's ending chooses the registered format."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from skillframe.demonstration.options import read_layout
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.homes import READERS
from skillframe.extend.records import ReaderType
from skillframe.files.documents import refuse_other

AUTO = "auto"
"""Value of `layout` that requests a proposal."""

PICKLES = (".pkl", ".pickle")
BAG_OPTIONS = ("pose_topic", "pose_frames", "wrench_topic", "robot")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recording(Sequence[Demonstration]):
    """A sequence of demonstrations, with the reasons of failed attempts."""

    demonstrations: list[Demonstration]
    rejected: list[str]

    def __len__(self) -> int:
        """Number of demonstrations."""
        return len(self.demonstrations)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> list[Demonstration]: ...
    def __getitem__(self, index: int | slice) -> Demonstration | list[Demonstration]:
        """One demonstration, or a slice."""
        return self.demonstrations[index]

    def __repr__(self) -> str:
        seconds = ", ".join(f"{d.duration:.2f} s" for d in self)
        where = f" of {self[0].meta.get('task')}" if self else ""
        return f"Recording({len(self)}{where}: {seconds}; {len(self.rejected)} redrawn)"

    def save(self, path: Path | str) -> list[Path]:
        """Write each demonstration to a file in the format of its suffix, and return the files.

        Several demonstrations get the names NAME1, NAME2, ... A path without a suffix is that of a new LeRobot data
        set, of which each is an episode; its folder is returned.

        Raises:
            InputError: an unknown suffix, or a place that cannot be written to.
        """
        path, count = Path(path), len(self)
        if is_data_set(path):
            write_data_set(self.demonstrations, path)
            return [path]
        files = [path] if count == 1 else [path.with_name(f"{path.stem}{i + 1}{path.suffix}") for i in range(count)]
        for file, demonstration in zip(files, self, strict=True):
            write_demonstration(demonstration, file)
        return files


def read_demonstration(path: Path | str, layout: Path | str | None = None, **options: Any) -> Demonstration:
    """Read a demonstration from a file of any registered format.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        layout: a layout file with settings, which `options` override.
        **options: settings of the format; the core's readers take the fields of `options.ReadOptions`.

    Raises:
        InputError: an unknown ending, or anything wrong with the file.
    """
    path = Path(path)
    refuse_other(path, "demonstration")
    if layout == Path(AUTO) or layout == AUTO:
        raise InputError(
            "--layout auto", "proposes settings and reads nothing",
            f"type skillframe check {path} --layout auto, and then the line that it prints",
        )  # fmt: skip
    if layout is not None:
        options = {**read_layout(Path(layout)), **options}
    form = format_of(path, reading=True, named_columns=options.get("columns") is not None)
    for name in () if form.topics else BAG_OPTIONS:
        if options.get(name) is not None:
            raise InputError(path, "is no ROS bag", f"leave {name.replace('_', '-')} out")
    return form.read(path, options)


def write_demonstration(demonstration: Demonstration, path: Path | str) -> None:
    """Write a demonstration as a whole.

    Raises:
        InputError: an ending that no format writes, or a path that cannot be written.
    """
    path = Path(path)
    if is_data_set(path):
        return write_data_set([demonstration], path)
    write = format_of(path, reading=False).write
    assert write is not None
    write(demonstration, path)


def is_data_set(path: Path) -> bool:
    """Whether a path to write is that of a data set: one without an ending."""
    return not path.suffix


def write_data_set(demonstrations: Sequence[Demonstration], path: Path | str) -> None:
    """Write demonstrations as one data set, a folder, as a whole.

    Raises:
        InputError: the folder exists, the demonstrations differ in kind, or no format writes data sets.
    """
    write = _format_of_sets(Path(path)).write_set
    assert write is not None
    write(demonstrations, Path(path))


def check_writable(path: Path | str) -> None:
    """Refuse a file name that no format writes, before the work for it.

    Raises:
        InputError: with the known endings, or for a data set's folder that is not empty.
    """
    if not is_data_set(Path(path)):
        format_of(Path(path), reading=False)
    elif (check := _format_of_sets(Path(path)).check_set) is not None:
        check(Path(path))


def _format_of_sets(path: Path) -> ReaderType:
    from skillframe.extend.registry import registry

    for record in registry().records("reader"):
        if record.write_set is not None:
            found: ReaderType = record
            return found
    missing = registry().absence("reader", "parquet")
    raise InputError(path, "has no ending, and nothing here writes data sets", missing or "write .npz")


def format_of(path: Path, *, reading: bool, named_columns: bool = False) -> ReaderType:
    """The format that claims a file, otherwise that of the longest matching ending.

    Args:
        path: the file, or a folder.
        reading: whether to read or to write it.
        named_columns: whether its columns are named, so that an unknown ending is delimited text.

    Raises:
        InputError: no format reads or writes it.
    """
    from skillframe.extend.registry import registry

    records: list[ReaderType] = [r for r in registry().records("reader") if reading or r.write is not None]
    for record in records if reading else ():
        if record.claims is not None and record.claims(path):
            return record
    matches = [(len(s), r) for r in records for s in r.suffixes if path.name.lower().endswith(s)]
    if matches:
        found = max(matches, key=lambda match: match[0])[1]
        if found.name != "npz" or not (reading and named_columns and _lacks_metadata(path)):
            return found
        if missing := registry().absence("reader", "arrays"):
            raise InputError(path, "holds no meta, and nothing here reads other arrays", missing)
        return registry().reader("arrays")
    missing = registry().absence("reader", READERS.get(path.suffix.lower(), ""))
    if reading and not missing and (named_columns or path.suffix.lower() in PICKLES):
        return registry().reader("delimited")  # which explains pickles
    if reading and path.is_dir():
        if missing := registry().absence("reader", "rosbag"):
            raise InputError(path, "is a folder, and nothing here reads one", missing)
        raise InputError(path, "is a folder", "give a file")
    if reading and not path.exists():
        raise InputError(path, "no such file", "check the path")
    endings = ", ".join(sorted(s for r in records for s in r.suffixes))
    advice = f"use one of {endings}" + (", or name the columns with --set columns" if reading else "")
    problem = f"no format {'reads' if reading else 'writes'} files ending in {path.suffix!r}"
    raise InputError(path, problem, missing or advice)


def _lacks_metadata(path: Path) -> bool:
    """Whether an npz file holds arrays only, as other tools write them."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "meta.npy" not in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return False  # the reader says what is wrong
