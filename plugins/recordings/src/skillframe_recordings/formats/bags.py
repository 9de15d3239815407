"""ROS recordings: ROS 1 `.bag`, ROS 2 `.db3` and `.mcap`, read by `rosbags` without ROS.

The pose comes from a topic of `POSES`, from `JointState` by a robot's forward kinematics, or from transforms
(`transforms`); the wrench from `WrenchStamped`. A Franka's states hold both (`franka`). Topics are joined on time.

Times are header stamps, since receive times are late and jitter; they serve if stamps are missing. The clock starts at
0 with the pose's first stamp, which the metadata keeps, because doubles resolve seconds since 1970 to 0.24 us only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.demonstration import (
    POSITION,
    QUATERNION,
    WRENCH,
    Columns,
    Demonstration,
    ReadOptions,
    assemble,
    read_meta,
    read_options,
)
from skillframe.errors import InputError, UnknownName
from skillframe.extend import Lazy
from skillframe.frames import Float, Pose, quaternion_from_matrix
from skillframe_recordings.formats.bagfile import (
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
from skillframe_recordings.formats.franka import FRANKA, FRANKA_NOTE, six, tool_poses_of, wrenches_of
from skillframe_recordings.formats.mcap_written import own_text, read_own
from skillframe_recordings.formats.transforms import tool_in_base, tree

ToolPoses = Callable[[str, "str | None", Sequence[str], Float], Pose]
"""(robot, arm, joint names, positions (T, joints)) -> tool poses; raises `InputError` or `UnknownName`."""

POSES: Mapping[str, Callable[[Any], tuple[Any, Any]]] = {
    "geometry_msgs/msg/PoseStamped": lambda m: (m.pose.position, m.pose.orientation),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: (m.pose.pose.position, m.pose.pose.orientation),
    "geometry_msgs/msg/TransformStamped": lambda m: (m.transform.translation, m.transform.rotation),
    "nav_msgs/msg/Odometry": lambda m: (m.pose.pose.position, m.pose.pose.orientation),
}
JOINTS, WRENCHES = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
POSE_TYPES, WRENCH_TYPES = [*POSES, *FRANKA], [WRENCHES, *FRANKA]
FORCE_WORDS = ("wrench", "force", "franka", "robotstate", "torque")
"""Words in names of message types that may hold a wrench."""
STAMP_START = "header_stamp_start_ns"
"""Metadata key of the header stamp at time 0 [ns]."""

TOOL_POSES = Lazy("skillframe.robot:tool_poses")
"""Forward kinematics, loaded for joint states only."""


def read_bag(path: Path, options: Mapping[str, Any], tool_poses: ToolPoses = TOOL_POSES) -> Demonstration:
    """Return a demonstration from a ROS bag.

    Args:
        path: the file, or the folder of a ROS 2 bag; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`; `pose_topic`, `pose_frames` and `wrench_topic` resolve ambiguities.
        tool_poses: forward kinematics, for joint states.

    Raises:
        InputError: anything in the contract's list of bad input, or an ambiguous topic.
        UnknownName: no such topic; lists the bag's topics with types.
        MissingDependency: `rosbags` is not installed.
    """
    chosen, notes = read_options(options), list[str]()
    for name in ("columns", "wrench_columns", "wrench", "euler", "units", "wrench_units"):
        if getattr(chosen, name) is not None:
            raise InputError(
                path, f"is a ROS bag, which has topics and SI units; {name.replace('_', '-')} is for text files",
                "choose topics with --set pose-topic and --set wrench-topic",
            )  # fmt: skip
    refuse_other_files(path)
    checksums = checksum_notes(path)
    named = any(value is not None for value in (chosen.pose_topic, chosen.pose_frames, chosen.wrench_topic))
    if not named and (text := own_text(path)) is not None:
        return read_own(path, text, options)
    meta = {"quaternion": "xyzw", **read_meta(path)}  # a message names its numbers
    notes += [*parts_note(path), *checksums]
    with opened(path) as bag:
        topics = topics_of(path, bag)
        wrenches = _wrench_topic(path, topics, chosen, meta)
        recorded = [
            _recorded_pose(path, bag, topics, chosen, notes),
            *(read_topic(path, bag, name, topics[name], notes) for name in [wrenches] if name is not None),
        ]
    if blank := [each.topic for each in recorded if not each.stamped]:
        notes.append(
            f"every header stamp of {' and '.join(blank)} is zero: the times at which the bag received the messages "
            "are taken, of every topic, which are late and uneven; --set rate and --set wrench-rate replace them"
        )
        recorded = [each.by_receipt() for each in recorded]
    zero = int(recorded[0].stamps[0])
    pose = _pose(path, recorded[0], zero, chosen, tool_poses)
    if len(recorded) == 1:
        none = {name: np.zeros(len(recorded[0].messages)) for name in WRENCH}
        return assemble(pose.with_values({**pose, **none}), {**meta, STAMP_START: zero}, _plain(chosen), notes)
    wrench = _wrench(path, recorded[1], zero)
    if recorded[1].kind in FRANKA:
        notes.append(FRANKA_NOTE)
    else:
        chosen = _framed(recorded, chosen, meta, notes)
    joined = replace(_plain(chosen), wrench=path)  # a second source, so that cuts keep a margin until the join
    return assemble(pose, {**meta, STAMP_START: zero}, joined, notes, wrench)


def _plain(options: ReadOptions) -> ReadOptions:
    return replace(options, pose_topic=None, pose_frames=None, wrench_topic=None, robot=None, arm=None)


def _wrench_topic(path: Path, topics: Mapping[str, str], options: ReadOptions, meta: Mapping[str, Any]) -> str | None:
    """The wrench's topic, or None if there is none and the metadata says `contact = false`."""
    there = any(kind in WRENCH_TYPES for kind in topics.values())
    if options.wrench_topic is None and meta.get("contact") is False and not there:
        return None
    plain = [k for k in FRANKA if k in topics.values()] if WRENCHES not in topics.values() else []
    return _chosen(path, topics, options.wrench_topic, WRENCH_TYPES, "wrench", plain or [WRENCHES])


def _chosen(
    path: Path, topics: Mapping[str, str], name: str | None, allowed: Sequence[str], what: str, default: Sequence[str]
) -> str:
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
        raise InputError(
            path, f"holds several {what} topics: {', '.join(found)}", f"choose one with --set {what}-topic"
        )
    readable = ", ".join(kind.rpartition("/")[2] for kind in default)
    raise InputError(path, f"has no {what} topic ({readable}); it holds {listing}", _remedy(what, topics))


def _remedy(what: str, topics: Mapping[str, str]) -> str:
    if what == "pose":
        named = ["name the robot with --set robot"] * (JOINTS in topics.values())
        named += ["name base and tool with --set pose-frames=BASE,TOOL"] * any(
            kind in TREES for kind in topics.values()
        )
        return ", or ".join(named) or "record the tool's pose or joint states"
    other = [topic for topic, kind in sorted(topics.items()) if any(word in kind.lower() for word in FORCE_WORDS)]
    if other:
        which = " and ".join(other)
        return (
            f"{which} may hold one in a type that is not read: republish it as WrenchStamped, "
            "or export it as CSV and type --layout auto"
        )
    return "record the wrench too, or state contact = false in NAME.meta.toml beside it"


def _recorded_pose(path: Path, bag: Any, topics: Mapping[str, str], options: ReadOptions, notes: list[str]) -> Recorded:
    if options.pose_frames is None:
        states = [k for k in FRANKA if k in topics.values()] if not any(k in POSES for k in topics.values()) else []
        kinds = [JOINTS] if options.robot is not None else states or list(POSES)
        allowed = [*POSE_TYPES, JOINTS] if options.robot is None else kinds
        name = _chosen(path, topics, options.pose_topic, allowed, "pose", kinds)
        if topics[name] == JOINTS and options.robot is None:
            raise InputError(f"{path}: {name}", "holds joint states", "name the robot they are of with --set robot")
        return read_topic(path, bag, name, topics[name], notes)
    names = [name.strip().lstrip("/") for name in str(options.pose_frames).split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise InputError(
            f"pose-frames={options.pose_frames}", "names no two frames", "give base and tool: base_link,tool0"
        )
    if options.pose_topic is not None or options.robot is not None:
        other = "--set pose-topic" if options.pose_topic is not None else "--set robot"
        raise InputError("--set pose-frames", f"says where the pose is, and so does {other}", "give one of them")
    base, tool = names[0], names[1]
    published = [name for name, kind in topics.items() if kind in TREES]
    if not published:
        raise InputError(path, "holds no transforms (TFMessage)", "choose a topic with --set pose-topic, or record /tf")
    with fields_of(path, " and ".join(published), "transforms"):
        stamps, rows = tool_in_base(tree(read_transforms(path, bag, published), str(path)), base, tool, str(path))
    return Recorded(f"{base} to {tool}", "tf", stamps, stamps, rows, base, tool)


def _clock(recorded: Recorded, zero: int) -> dict[str, Float]:
    return {"t": (recorded.stamps - zero).astype(np.float64) * 1e-9}


def _pose(path: Path, recorded: Recorded, zero: int, options: ReadOptions, tool_poses: ToolPoses) -> Columns:
    columns = _clock(recorded, zero)
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
        names = [str(name) for name in recorded.messages[0].name]
        rows = []
        for i, message in enumerate(recorded.messages):
            found = dict(zip(map(str, message.name), map(float, message.position), strict=False))
            missing = [name for name in names if name not in found]
            if missing or not names:
                what = f"message {i + 1} has no position of {', '.join(missing)}" if missing else "names no joint"
                raise InputError(
                    f"{path}: {recorded.topic}", what, "choose a topic on which one node publishes all joints"
                )
            rows.append([found[name] for name in names])
        positions = np.array(rows)
        bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
        if bad.size:
            raise InputError(
                f"{path}: {recorded.topic}", f"message {bad[0] + 1} holds no finite position", "cut it out"
            )
        return names, positions


def _wrench(path: Path, recorded: Recorded, zero: int) -> Columns:
    columns = _clock(recorded, zero)
    with fields_of(path, recorded.topic, recorded.kind):
        if recorded.kind in FRANKA:
            values = wrenches_of(recorded.kind, recorded.messages)
        else:
            values = np.array([six(message.wrench) for message in recorded.messages], dtype=float)
    columns.update(zip(WRENCH, values.T.copy(), strict=True))
    return Columns(columns, f"{path}: {recorded.topic}")


def _framed(
    recorded: Sequence[Recorded], options: ReadOptions, meta: Mapping[str, Any], notes: list[str]
) -> ReadOptions:
    """Settings with the wrench in tool axes if its headers name the frame of the pose.

    Any other frame than the pose's parent needs the user's statement.
    """
    pose, wrench = recorded
    declared = options.wrench_frame is not None or "frame" in dict(meta.get("wrench", {}))
    if declared or wrench.frame in ("", pose.frame):
        return options
    if wrench.frame == pose.child:
        notes.append(f"the wrench's header says frame {wrench.frame!r}, whose pose was read: it is in tool axes")
        return replace(options, wrench_frame="tool")
    notes.append(
        f"the wrench's header says frame {wrench.frame!r}, the pose's {pose.frame!r}: state its axes with "
        "--set wrench-frame=base or tool (taken as base), and its point with --set wrench-point"
    )
    return options
