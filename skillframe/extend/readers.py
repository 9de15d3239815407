"""The demonstration formats that ship with the core. A reader's module is imported when a file of its kind is read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skillframe.errors import InputError
from skillframe.extend.records import ReaderType

if TYPE_CHECKING:
    from skillframe.demonstration.bags import ToolPoses
    from skillframe.demonstration.record import Demonstration
    from skillframe.demonstration.table import Table

BAG_OPTIONS = ("pose_topic", "pose_frames", "wrench_topic", "robot")


def _reader(module: str, function: str) -> Callable[[Path, Mapping[str, Any]], Demonstration]:
    def read(path: Path, options: Mapping[str, Any]) -> Demonstration:
        for name in BAG_OPTIONS:
            if options.get(name) is not None:
                raise InputError(path, "is no ROS bag", f"leave --{name.replace('_', '-')} away")
        result: Demonstration = getattr(import_module(f"skillframe.demonstration.{module}"), function)(path, options)
        return result

    return read


def _table(module: str, function: str) -> Callable[[Path, Mapping[str, Any]], Table]:
    def table(path: Path, options: Mapping[str, Any]) -> Table:
        result: Table = getattr(import_module(f"skillframe.demonstration.{module}"), function)(path, options)
        return result

    return table


def _writer(module: str, function: str) -> Callable[[Demonstration, Path], None]:
    def write(demonstration: Demonstration, path: Path) -> None:
        getattr(import_module(f"skillframe.demonstration.{module}"), function)(demonstration, path)

    return write


def _bag_reader(tool_poses: ToolPoses) -> Callable[[Path, Mapping[str, Any]], Demonstration]:
    def read(path: Path, options: Mapping[str, Any]) -> Demonstration:
        from skillframe.demonstration.bags import read_bag

        return read_bag(path, options, tool_poses)

    return read


def reader_types(tool_poses: ToolPoses) -> Iterable[ReaderType]:
    """The core's formats: native npz, CSV, delimited text, files of arrays, HDF5, parquet, ROS bags, MCAP.

    Args:
        tool_poses: forward kinematics for recorded joint states.
    """
    yield ReaderType(
        name="npz", summary="native form: named arrays and JSON metadata", suffixes=(".npz",),
        read=_reader("npz", "read_npz"), write=_writer("npz", "write_npz"), table=_table("foreign", "npz_table"),
    )  # fmt: skip
    yield ReaderType(
        name="csv", summary="CSV with a header, metadata in NAME.meta.toml", suffixes=(".csv",),
        read=_reader("csv", "read_csv"), write=_writer("csv", "write_csv"), table=_table("table", "table_of_text"),
    )  # fmt: skip
    yield ReaderType(
        name="delimited", summary="delimited text of any layout, with --columns", suffixes=(".dat", ".txt", ".tsv"),
        read=_reader("delimited", "read_delimited"), table=_table("table", "table_of_text"),
    )  # fmt: skip
    yield ReaderType(
        name="arrays", summary="NumPy, MATLAB and JSON files of any layout, with --columns",
        suffixes=(".npy", ".mat", ".json", ".jsonl"), read=_reader("foreign", "read_foreign"),
        table=_table("foreign", "foreign_table"),
    )  # fmt: skip
    yield ReaderType(
        name="hdf5", summary="HDF5: robomimic, robosuite, REASSEMBLE and others, with --columns",
        suffixes=(".h5", ".hdf5"), read=_reader("hdf5", "read_hdf5"), table=_table("hdf5", "hdf5_table"),
        write=_writer("robomimic", "write_robomimic"),
    )  # fmt: skip
    yield ReaderType(
        name="parquet", summary="parquet files and folders of LeRobot data sets, with --columns and --episode",
        suffixes=(".parquet",), read=_reader("parquet", "read_parquet"), table=_table("parquet", "parquet_table"),
    )  # fmt: skip
    yield ReaderType(
        name="rosbag", summary="ROS 1 and ROS 2 bags, with --pose-topic and --wrench-topic",
        suffixes=(".bag", ".db3"), read=_bag_reader(tool_poses),
    )  # fmt: skip
    yield ReaderType(
        name="mcap", summary="MCAP files of ROS 1 and ROS 2, with --pose-topic and --wrench-topic; written for ROS 2",
        suffixes=(".mcap",), read=_bag_reader(tool_poses), write=_writer("mcap_written", "write_mcap"),
    )  # fmt: skip
