"""Bags for the tests, written with rosbags' own writers: any kind, stamps of headers, receive times that lag."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from skillframe.demonstration.record import Demonstration
from skillframe.frames import rotate_spatial

ENDINGS = (".bag", ".db3", ".mcap")
START = 1_588_512_872_785_162_138  # ns
LATE = 2_000_000_000  # ns by which receive times lag in these bags, unevenly; real ones lag by 1.6 to 2.4 s
STORE1, STORE2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
Topics = Mapping[str, tuple[str, list[tuple[int, Any]]]]
"""Type and (stamp [ns], message without header) by topic."""


def write_bag(
    path: Path, topics: Topics, frame: str = "base", zero: Collection[str] = (), uneven: int = 400_000_000
) -> Path:
    """A bag of any kind, without stamps in the headers of some topics, received unevenly [ns]. Returns the file."""
    ros1 = path.suffix == ".bag"
    store = STORE1 if ros1 else STORE2
    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    writer = Writer1(path) if ros1 else Writer2(path.with_suffix(""), version=9, storage_plugin=plugin)
    rng = np.random.default_rng(0)
    with writer:
        for topic, (kind, messages) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for i, (stamp, fields) in enumerate(messages):
                header = head(store, 0 if topic in zero else stamp, frame, {"seq": i} if ros1 else {})
                message = store.types[kind](header=header, **fields(store))
                data = store.serialize_ros1(message, kind) if ros1 else store.serialize_cdr(message, kind)
                writer.write(connection, stamp + LATE + int(rng.integers(uneven)), data)
    return path if ros1 else next(path.with_suffix("").glob(f"*{path.suffix}"))


def head(store: Any, stamp: int, frame: str, more: dict[str, int]) -> Any:
    time = store.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **more)


def vector(store: Any, name: str, values: Any) -> Any:
    keys = "xyzw"[: len(values)]
    return store.types[f"geometry_msgs/msg/{name}"](**dict(zip(keys, map(float, values), strict=True)))


def pose_fields(kind: str, p: Any, q: Any) -> Callable[[Any], dict[str, Any]]:
    def fields(store: Any) -> dict[str, Any]:
        types, quaternion = store.types, vector(store, "Quaternion", q)
        if kind == "TransformStamped":
            turn = types["geometry_msgs/msg/Transform"](translation=vector(store, "Vector3", p), rotation=quaternion)
            return {"transform": turn, "child_frame_id": "tool"}
        pose = types["geometry_msgs/msg/Pose"](position=vector(store, "Point", p), orientation=quaternion)
        if kind == "PoseStamped":
            return {"pose": pose}
        zero = vector(store, "Vector3", np.zeros(3))
        twist = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
        unsure = types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
        moving = types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
        return {"pose": unsure} | ({"twist": moving, "child_frame_id": "tool"} if kind == "Odometry" else {})

    return fields


def wrench_fields(w: Any) -> Callable[[Any], dict[str, Any]]:
    return lambda store: {
        "wrench": store.types["geometry_msgs/msg/Wrench"](
            force=vector(store, "Vector3", w[:3]), torque=vector(store, "Vector3", w[3:])
        )
    }


def stamps(time: Any) -> list[int]:
    return [START + round(t * 1e9) for t in time]


def poses(demo: Demonstration, kind: str = "PoseStamped") -> tuple[str, list[tuple[int, Any]]]:
    package = "nav_msgs" if kind == "Odometry" else "geometry_msgs"
    rows = zip(stamps(demo.time), demo.position, demo.quaternion, strict=True)
    return f"{package}/msg/{kind}", [(t, pose_fields(kind, p, q)) for t, p, q in rows]


def wrenches(demo: Demonstration) -> tuple[str, list[tuple[int, Any]]]:
    rows = zip(stamps(demo.time), demo.wrench, strict=True)
    return "geometry_msgs/msg/WrenchStamped", [(t, wrench_fields(w)) for t, w in rows]


def joints(time: Any, names: list[str], angles: Any) -> tuple[str, list[tuple[int, Any]]]:
    def fields(row: Any) -> Callable[[Any], dict[str, Any]]:
        none = np.zeros(0)
        return lambda store: {"name": names, "position": np.array(row, dtype=float), "velocity": none, "effort": none}

    return "sensor_msgs/msg/JointState", [(t, fields(row)) for t, row in zip(stamps(time), angles, strict=True)]


def transforms_and_wrench(path: Path, demo: Demonstration, child: str, sensor: str) -> Path:
    """A ROS 2 bag with a topic of `TransformStamped` of a child frame, and a wrench in the axes of that frame."""
    names = ("Vector3", "Quaternion", "Transform", "TransformStamped", "Wrench", "WrenchStamped")
    types = {name: STORE2.types[f"geometry_msgs/msg/{name}"] for name in names}
    in_tool = rotate_spatial(np.swapaxes(demo.pose.rotation, -1, -2), demo.wrench)
    with Writer2(path.with_suffix(""), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            n: writer.add_connection(f"/{n}", types[n].__msgtype__, typestore=STORE2) for n in (names[3], names[5])
        }
        for stamp, p, q, w in zip(stamps(demo.time), demo.position, demo.quaternion, in_tool, strict=True):
            transform = types["Transform"](translation=types["Vector3"](*p), rotation=types["Quaternion"](*q))
            wrench = types["Wrench"](force=types["Vector3"](*w[:3]), torque=types["Vector3"](*w[3:]))
            moved = types[names[3]](header=head(STORE2, stamp, "base", {}), child_frame_id=child, transform=transform)
            felt = types[names[5]](header=head(STORE2, stamp, sensor, {}), wrench=wrench)
            for name, message in ((names[3], moved), (names[5], felt)):
                writer.write(topics[name], stamp, STORE2.serialize_cdr(message, message.__msgtype__))
    return next(path.with_suffix("").glob("*.mcap"))
