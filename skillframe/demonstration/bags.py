"""ROS recordings: ROS 1 `.bag`, ROS 2 `.db3` and `.mcap`, read through `rosbags`, which needs no ROS.

The pose is a topic of `PoseStamped`, `PoseWithCovarianceStamped`, `TransformStamped` or `Odometry`, or of `JointState`
with the robot whose forward kinematics it is, or what the bag's transforms say of one frame in another (`transforms`);
the wrench is a topic of `WrenchStamped`. States of a Franka hold both (`franka`). Every topic keeps its own clock, and
both are joined on time as two files are.
The clock is that of the headers, because a bag's receive times are late by up to seconds and jitter; it starts at 0
with the pose's first stamp, which the metadata keeps, because seconds since 1970 leave a double no more than 0.24 us.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration.assemble import assemble
from skillframe.demonstration.bagfile import (
    TREES,
    Recorded,
    checksum_notes,
    fields_of,
    opened,
    parts_note,
    read_topic,
    read_transforms,
    refuse_other_files,
    topics_of,
)
from skillframe.demonstration.columns import POSITION, QUATERNION, WRENCH, Columns
from skillframe.demonstration.franka import FRANKA, FRANKA_NOTE, six, tool_poses_of, wrenches_of
from skillframe.demonstration.mcap_written import own_text, read_own
from skillframe.demonstration.metafile import read_meta
from skillframe.demonstration.options import ReadOptions, read_options
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.transforms import tool_in_base, tree
from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose, quaternion_from_matrix

ToolPoses = Callable[[str, "str | None", Sequence[str], Float], Pose]
"""(robot, arm, joint names, positions (T, joints)) -> poses of the tool; raises `InputError` or `UnknownName`."""

POSES: Mapping[str, Callable[[Any], tuple[Any, Any]]] = {
    "geometry_msgs/msg/PoseStamped": lambda m: (m.pose.position, m.pose.orientation),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: (m.pose.pose.position, m.pose.pose.orientation),
    "geometry_msgs/msg/TransformStamped": lambda m: (m.transform.translation, m.transform.rotation),
    "nav_msgs/msg/Odometry": lambda m: (m.pose.pose.position, m.pose.pose.orientation),
}
JOINTS, WRENCHES = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
POSE_TYPES, WRENCH_TYPES = [*POSES, *FRANKA], [WRENCHES, *FRANKA]
FORCE_WORDS = ("wrench", "force", "franka", "robotstate", "torque")
"""What types of messages are called that may hold a wrench."""
STAMP_START = "header_stamp_start_ns"
"""Metadata key of the header stamp at time 0 [ns]."""


def read_bag(path: Path, options: Mapping[str, Any], tool_poses: ToolPoses) -> Demonstration:
    """A demonstration from a ROS bag.

    Args:
        path: the file, or the folder of a ROS 2 bag with all its parts; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `pose_topic`, `pose_frames` and `wrench_topic` where the bag leaves a choice.
        tool_poses: forward kinematics, for joint states.

    Raises:
        InputError: anything of the contract's list of bad input, or a topic that has to be chosen.
        UnknownName: no such topic; the bag's topics are listed with their types.
        MissingDependency: `rosbags` is not installed.
    """
    chosen, notes = read_options(options), list[str]()
    _refuse_text_options(path, chosen)
    refuse_other_files(path)
    checksums = checksum_notes(path)
    named = any(value is not None for value in (chosen.pose_topic, chosen.pose_frames, chosen.wrench_topic))
    if not named and (text := own_text(path)) is not None:
        return read_own(path, text, options)
    meta = read_meta(path)
    notes += [*parts_note(path), *checksums]
    with opened(path) as bag:
        topics = topics_of(path, bag)
        wrenches = _wrench_topic(path, topics, chosen, meta)
        recorded = [
            _recorded_pose(path, bag, topics, chosen, notes),
            *(read_topic(path, bag, name, topics[name], notes) for name in [wrenches] if name is not None),
        ]
    zero = int(recorded[0].stamps[0])
    pose = _pose(path, recorded[0], zero, chosen, tool_poses)
    if len(recorded) == 1:
        none = {name: np.zeros(len(recorded[0].messages)) for name in WRENCH}
        return assemble(pose.with_values({**pose, **none}), {**meta, STAMP_START: zero}, _plain(chosen), notes)
    wrench = _wrench(path, recorded[1], zero, chosen)
    notes += [FRANKA_NOTE] if recorded[1].kind in FRANKA else _frame_note(recorded, chosen, meta)
    joined = replace(_plain(chosen), wrench=path)  # a second source, so that cuts keep a margin until they are joined
    return assemble(pose, {**meta, STAMP_START: zero}, joined, notes, wrench)


def _plain(options: ReadOptions) -> ReadOptions:
    """The settings without those that only a bag has."""
    return replace(options, pose_topic=None, pose_frames=None, wrench_topic=None, robot=None, arm=None)


def _refuse_text_options(path: Path, options: ReadOptions) -> None:
    for name in ("columns", "wrench_columns", "wrench", "euler", "units", "wrench_units"):
        if getattr(options, name) is not None:
            raise InputError(
                path, f"is a ROS bag, which has topics and SI units; --{name.replace('_', '-')} is for text files",
                "choose topics with --pose-topic and --wrench-topic",
            )  # fmt: skip


def _pose_topic(path: Path, topics: Mapping[str, str], options: ReadOptions) -> str:
    states = [k for k in FRANKA if k in topics.values()] if not any(k in POSES for k in topics.values()) else []
    kinds = [JOINTS] if options.robot is not None else states or list(POSES)
    allowed = [*POSE_TYPES, JOINTS] if options.robot is None else kinds
    name = _chosen(path, topics, options.pose_topic, allowed, "pose", kinds)
    if topics[name] == JOINTS and options.robot is None:
        raise InputError(f"{path}: {name}", "holds joint states", "name the robot they are of with --robot")
    return name


def _wrench_topic(path: Path, topics: Mapping[str, str], options: ReadOptions, meta: Mapping[str, Any]) -> str | None:
    """The wrench's topic, or None where the metadata says that nothing was touched and there is none."""
    there = any(kind in WRENCH_TYPES for kind in topics.values())
    if options.wrench_topic is None and meta.get("contact") is False and not there:
        return None
    plain = [k for k in FRANKA if k in topics.values()] if WRENCHES not in topics.values() else []
    return _chosen(path, topics, options.wrench_topic, WRENCH_TYPES, "wrench", plain or [WRENCHES])


def _chosen(
    path: Path, topics: Mapping[str, str], name: str | None, allowed: Sequence[str], what: str, default: Sequence[str]
) -> str:
    """The topic asked for, or the only one of the default types."""
    listing = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items()))
    if name is not None:
        if name not in topics:
            raise UnknownName("topic", name, topics, f"{path} holds {listing}")
        if topics[name] not in allowed:
            readable = ", ".join(kind.rpartition("/")[2] for kind in allowed)
            raise InputError(f"{path}: {name}", f"is a {topics[name]}, no {what}", f"choose a topic of {readable}")
        return name
    found = sorted(topic for topic, kind in topics.items() if kind in default)
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(path, f"holds several {what} topics: {', '.join(found)}", f"choose one with --{what}-topic")
    readable = ", ".join(kind.rpartition("/")[2] for kind in default)
    raise InputError(path, f"has no {what} topic ({readable}); it holds {listing}", _remedy(what, topics))


def _remedy(what: str, topics: Mapping[str, str]) -> str:
    if what == "pose":
        named = ["name the robot with --robot"] * (JOINTS in topics.values())
        named += ["name base and tool with --pose-frames BASE,TOOL"] * any(kind in TREES for kind in topics.values())
        return ", or ".join(named) or "record the tool's pose or joint states"
    other = [topic for topic, kind in sorted(topics.items()) if any(word in kind.lower() for word in FORCE_WORDS)]
    if other:
        which = " and ".join(other)
        return (
            f"{which} may hold one in a type that is not read: republish it as WrenchStamped, "
            "or export it as CSV and type --columns auto"
        )
    return "record the wrench too, or state contact = false in NAME.meta.toml beside it"


def _recorded_pose(path: Path, bag: Any, topics: Mapping[str, str], options: ReadOptions, notes: list[str]) -> Recorded:
    if options.pose_frames is None:
        name = _pose_topic(path, topics, options)
        return read_topic(path, bag, name, topics[name], notes)
    base, tool = _frames(options)
    published = [name for name, kind in topics.items() if kind in TREES]
    if not published:
        raise InputError(path, "holds no transforms (TFMessage)", "choose a topic with --pose-topic, or record /tf")
    with fields_of(path, " and ".join(published), "transforms"):
        stamps, rows = tool_in_base(tree(read_transforms(path, bag, published), str(path)), base, tool, str(path))
    return Recorded(f"{base} to {tool}", "tf", stamps, rows, base)


def _frames(options: ReadOptions) -> tuple[str, str]:
    names = [name.strip().lstrip("/") for name in str(options.pose_frames).split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise InputError(
            f"--pose-frames {options.pose_frames}", "names no two frames", "give base and tool: base_link,tool0"
        )
    if options.pose_topic is not None or options.robot is not None:
        other = "--pose-topic" if options.pose_topic is not None else "--robot"
        raise InputError("--pose-frames", f"says where the pose is, and so does {other}", "give one of them")
    return names[0], names[1]


def _clock(path: Path, recorded: Recorded, zero: int, rate: float | None, option: str) -> dict[str, Float]:
    """The header clock from `zero` on, or none where the stamps were never filled in and a rate is given."""
    if np.any(recorded.stamps != 0):
        return {"t": (recorded.stamps - zero).astype(np.float64) * 1e-9}
    if rate is None:
        raise InputError(
            f"{path}: {recorded.topic}", "every header stamp is zero", f"give the sample rate with {option}"
        )
    return {}


def _pose(path: Path, recorded: Recorded, zero: int, options: ReadOptions, tool_poses: ToolPoses) -> Columns:
    columns = _clock(path, recorded, zero, options.rate, "--rate")
    if recorded.kind == "tf":
        values = recorded.messages
    elif recorded.kind == JOINTS:
        assert options.robot is not None
        names, positions = _joint_positions(path, recorded)
        pose = tool_poses(options.robot, options.arm, names, positions)
        values = np.concatenate([pose.position, quaternion_from_matrix(pose.rotation)], axis=1)
    elif recorded.kind in FRANKA:
        with fields_of(path, recorded.topic, recorded.kind):
            values = tool_poses_of(recorded.kind, recorded.messages)
    else:
        pick = POSES[recorded.kind]
        with fields_of(path, recorded.topic, recorded.kind):
            parts = [pick(message) for message in recorded.messages]
            values = np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in parts], dtype=float)
    columns.update(zip((*POSITION, *QUATERNION), values.T.copy(), strict=True))
    return Columns(columns, f"{path}: {recorded.topic}")


def _joint_positions(path: Path, recorded: Recorded) -> tuple[list[str], Float]:
    """Joint names of the first message, and positions (T, joints) in that order."""
    with fields_of(path, recorded.topic, recorded.kind):
        return _joint_rows(path, recorded)


def _joint_rows(path: Path, recorded: Recorded) -> tuple[list[str], Float]:
    names = [str(name) for name in recorded.messages[0].name]
    rows = []
    for i, message in enumerate(recorded.messages):
        found = dict(zip(map(str, message.name), map(float, message.position), strict=False))
        missing = [name for name in names if name not in found]
        if missing or not names:
            what = f"message {i + 1} has no position of {', '.join(missing)}" if missing else "names no joint"
            raise InputError(f"{path}: {recorded.topic}", what, "choose a topic on which one node publishes all joints")
        rows.append([found[name] for name in names])
    positions = np.array(rows)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if bad.size:
        raise InputError(f"{path}: {recorded.topic}", f"message {bad[0] + 1} holds no finite position", "cut it out")
    return names, positions


def _wrench(path: Path, recorded: Recorded, zero: int, options: ReadOptions) -> Columns:
    columns = _clock(path, recorded, zero, options.wrench_rate or options.rate, "--wrench-rate")
    with fields_of(path, recorded.topic, recorded.kind):
        if recorded.kind in FRANKA:
            values = wrenches_of(recorded.kind, recorded.messages)
        else:
            values = np.array([six(message.wrench) for message in recorded.messages], dtype=float)
    columns.update(zip(WRENCH, values.T.copy(), strict=True))
    return Columns(columns, f"{path}: {recorded.topic}")


def _frame_note(recorded: Sequence[Recorded], options: ReadOptions, meta: Mapping[str, Any]) -> list[str]:
    """What the headers say about axes, which only a person can relate to base and tool."""
    pose, wrench = (r.frame for r in recorded)
    declared = options.wrench_frame is not None or "frame" in dict(meta.get("wrench", {}))
    if declared or not wrench or wrench == pose:
        return []
    return [
        f"the wrench's header says frame {wrench!r}, the pose's {pose!r}: state its axes with --wrench-frame base or "
        "tool (taken as base), and its point with --wrench-point"
    ]
