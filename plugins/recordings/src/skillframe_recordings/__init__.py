"""Recordings that other tools made: their formats, what layout they have, what is wrong with them, filters.

This module registers them and is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import AuditType, Lazy, LazyCommand, ReaderType

skillframe_contract = "0.2"

FORMATS, COMMANDS = "skillframe_recordings.formats", "skillframe_recordings.commands"
check = LazyCommand("Audit recordings: rate, gaps, frames, bias, noise, contact.", f"{COMMANDS}.recordings:check")
convert = LazyCommand("Read recordings of any layout and write demonstrations.", f"{COMMANDS}.recordings:convert")
calibrate = LazyCommand("Find a force sensor's bias, tool and mounting from free air.", f"{COMMANDS}.calibrate:command")
filter_command = LazyCommand("Filter a wrench; remove bias and tool weight.", f"{COMMANDS}.filter:command")


@hookimpl
def skillframe_readers() -> Iterable[ReaderType]:
    """Files of arrays, HDF5, parquet, ROS bags and MCAP."""
    yield ReaderType(
        name="arrays", summary="NumPy, MATLAB and JSON files of any layout, with --set columns",
        suffixes=(".npy", ".mat", ".json", ".jsonl"), read=Lazy(f"{FORMATS}.foreign:read_foreign"),
        table=Lazy(f"{FORMATS}.foreign:foreign_table"),
    )  # fmt: skip
    yield ReaderType(
        name="hdf5", summary="HDF5: robomimic, robosuite, REASSEMBLE and others, with --set columns",
        suffixes=(".h5", ".hdf5"), read=Lazy(f"{FORMATS}.hdf5:read_hdf5"),
        table=Lazy(f"{FORMATS}.hdf5:hdf5_table"), write=Lazy(f"{FORMATS}.hdf5:write_robomimic"),
    )  # fmt: skip
    yield ReaderType(
        name="parquet", summary="parquet files and folders of LeRobot data sets, by --set columns and --set episode",
        suffixes=(".parquet",), read=Lazy(f"{FORMATS}.parquet:read_parquet"),
        table=Lazy(f"{FORMATS}.parquet:parquet_table"), claims=Lazy(f"{FORMATS}.folders:is_data_set"),
        write_set=Lazy(f"{FORMATS}.lerobot:write_lerobot"), check_set=Lazy(f"{FORMATS}.lerobot:check_new"),
    )  # fmt: skip
    yield ReaderType(
        name="rosbag", summary="ROS 1 and ROS 2 bags, by --set pose-topic and --set wrench-topic",
        suffixes=(".bag", ".db3"), topics=True, read=Lazy(f"{FORMATS}.bags:read_bag"),
        claims=Lazy(f"{FORMATS}.folders:is_bag"),
    )  # fmt: skip
    yield ReaderType(
        name="mcap", summary="MCAP files of ROS 1 and ROS 2, by --set pose-topic and wrench-topic; written for ROS 2",
        suffixes=(".mcap",), topics=True, read=Lazy(f"{FORMATS}.bags:read_bag"),
        write=Lazy(f"{FORMATS}.mcap_written:write_mcap"),
    )  # fmt: skip


@hookimpl
def skillframe_audits() -> Iterable[AuditType]:
    """What looks wrong in a recording, by its own figures and beside the others of its set."""
    yield AuditType(
        name="recordings", summary="clock, frames, bias, noise, stalls, spikes, and sets that do not fit together",
        warnings=Lazy("skillframe_recordings.audit:warnings_of"),
    )  # fmt: skip
