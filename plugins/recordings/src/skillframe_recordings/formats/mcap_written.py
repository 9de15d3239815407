"""Writer and reader of demonstrations as MCAP with ROS 2 messages and checksums, one file each.

    /tool_pose         geometry_msgs/msg/PoseStamped      tool point in base
    /wrench            geometry_msgs/msg/WrenchStamped    environment on the tool, at the tool point, base axes
    /skillframe/extra  std_msgs/msg/Float64MultiArray     clock [s] and further columns

Stamps are whole nanoseconds from the bag's original start if known, else from 0; the third topic keeps the exact clock.
A metadata record holds the metadata and column names. The format is at https://mcap.dev/spec, the messages are those of
ROS 2 Humble.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration import (
    POSITION,
    QUATERNION,
    WRENCH,
    Columns,
    Demonstration,
    assemble_split,
    read_options,
    read_wrench_file,
)
from skillframe.errors import InputError, extras_named
from skillframe.files import write_whole
from skillframe_recordings.formats.bagfile import fields_of, messages_of, opened, topics_of
from skillframe_recordings.formats.franka import six
from skillframe_recordings.formats.mcap import metadata_record

OURS, FORMAT, VERSION = "skillframe", "skillframe.demonstration", 1
POSE, FORCE, EXTRA = "/tool_pose", "/wrench", "/skillframe/extra"
KINDS = {
    POSE: "geometry_msgs/msg/PoseStamped",
    FORCE: "geometry_msgs/msg/WrenchStamped",
    EXTRA: "std_msgs/msg/Float64MultiArray",
}
BASE = "base"
START = "header_stamp_start_ns"
"""Metadata key of the stamp at time 0 [ns], set when a bag is read."""


def write_mcap(demonstration: Demonstration, path: Path) -> None:
    """Write a demonstration, whole or not at all.

    Raises:
        InputError: the place cannot be written, or ROS cannot represent the stamps.
        MissingDependency: rosbags or mcap is not installed.
    """
    with extras_named():
        from mcap.writer import CompressionType, Writer
        from rosbags.typesys import Stores, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    start = demonstration.meta.get(START)
    begin = start if isinstance(start, int) and not isinstance(start, bool) else 0
    stamps = [begin + round(float(t) * 1e9) for t in demonstration.time]
    if stamps[0] < 0 or stamps[-1] >= 2**31 * 10**9:
        raise InputError(path, "would need stamps that ROS cannot hold", "read it with zero-time = true in a layout")
    if any(later <= before for before, later in pairwise(stamps)):
        raise InputError(path, "would need two samples with one stamp of ROS", "write .npz: they are under 1 ns apart")
    stamps = stamps
    names = ["t", *demonstration.extra]
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.LZ4, enable_data_crcs=True)
    writer.start(profile="ros2", library=OURS)
    text = {"format": FORMAT, "version": VERSION, "meta": demonstration.meta, "columns": names}
    writer.add_metadata(OURS, {OURS: json.dumps(text, sort_keys=True)})
    channels = {}
    for topic, kind in KINDS.items():
        definition = store.generate_msgdef(kind, ros_version=2)[0]
        schema = writer.register_schema(kind, "ros2msg", definition.encode())
        channels[topic] = writer.register_channel(topic, "cdr", schema)
    for stamp, messages in zip(stamps, _messages(store, demonstration, stamps), strict=True):
        for topic, message in messages.items():
            data = bytes(store.serialize_cdr(message, KINDS[topic]))
            writer.add_message(channels[topic], stamp, data, stamp)
    writer.finish()
    write_whole(path, buffer.getvalue())


def _messages(store: Any, d: Demonstration, stamps: Sequence[int]) -> Iterator[Mapping[str, Any]]:
    types = store.types
    geometry = {
        name: types[f"geometry_msgs/msg/{name}"]
        for name in ("Point", "Pose", "PoseStamped", "Quaternion", "Vector3", "Wrench", "WrenchStamped")
    }
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    rows = np.column_stack([d.time, *d.extra.values()])
    for stamp, p, q, w, row in zip(stamps, d.position, d.quaternion, d.wrench, rows, strict=True):
        time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        header = types["std_msgs/msg/Header"](stamp=time, frame_id=BASE)
        pose = geometry["Pose"](
            position=geometry["Point"](*map(float, p)), orientation=geometry["Quaternion"](*map(float, q))
        )
        wrench = geometry["Wrench"](
            force=geometry["Vector3"](*map(float, w[:3])), torque=geometry["Vector3"](*map(float, w[3:]))
        )
        yield {
            POSE: geometry["PoseStamped"](header=header, pose=pose),
            FORCE: geometry["WrenchStamped"](header=header, wrench=wrench),
            EXTRA: types[KINDS[EXTRA]](layout=layout, data=np.ascontiguousarray(row)),
        }


def own_text(path: Path) -> dict[str, Any] | None:
    """Return the metadata of a file by `write_mcap`, or None for others.

    Raises:
        InputError: the metadata have another version or are damaged.
    """
    if not path.is_file() or path.suffix.lower() != ".mcap":
        return None
    text = metadata_record(path, OURS).get(OURS)
    if text is None:
        return None
    try:
        found: dict[str, Any] = json.loads(text)
        known = (found["format"], found["version"]) == (FORMAT, VERSION)
        if not known or not isinstance(found["meta"], dict) or not isinstance(found["columns"], list):
            raise ValueError
    except (ValueError, KeyError, TypeError):
        fix = "update skillframe, or name its topics with --set pose-topic and --set wrench-topic"
        raise InputError(path, f"its metadata are no {FORMAT} of version {VERSION}", fix) from None
    return found


def read_own(path: Path, text: Mapping[str, Any], options: Mapping[str, Any]) -> Demonstration:
    """Return the demonstration of a file by `write_mcap`.

    Args:
        path: the file.
        text: result of `own_text`.
        options: fields of `ReadOptions`.

    Raises:
        InputError: damage, changes, or anything in the contract's list of bad input.
    """
    chosen = read_options(options)
    with opened(path) as bag:
        if changed := [topic for topic, kind in KINDS.items() if topics_of(path, bag).get(topic) != kind]:
            raise _changed(path, f"lacks {changed[0]}")
        poses, wrenches, extra = (messages_of(path, bag, topic) for topic in KINDS)
    if not len(poses) == len(wrenches) == len(extra):
        raise _changed(path, "has topics of unequal length")
    with fields_of(path, ", ".join(KINDS), "messages"):
        places = [(m.pose.position, m.pose.orientation) for m in poses]
        rows = np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in places])
        values = {
            **dict(zip(text["columns"], np.array([m.data for m in extra], dtype=float).T, strict=True)),
            **dict(zip((*POSITION, *QUATERNION), rows.T, strict=True)),
            **dict(zip(WRENCH, np.array([six(m.wrench) for m in wrenches], dtype=float).T, strict=True)),
        }
    columns = Columns({name: column.copy() for name, column in values.items()}, str(path))
    return assemble_split(columns, dict(text["meta"]), chosen, [], read_wrench_file(chosen))


def _changed(path: Path, problem: str) -> InputError:
    fix = "name its topics with --set pose-topic and --set wrench-topic, or write it again"
    return InputError(path, f"says that skillframe wrote it, and {problem}", fix)
