"""Tool pose from a tree of transforms, as on ROS' `/tf` and `/tf_static`.

A transform places a frame in its parent. The tool's pose in base goes by their nearest common ancestor,

    T_base,tool = (T_up,n ... T_up,1)^-1  T_down,n ... T_down,1        each T of a frame in its parent

The most frequent transform gives the samples, within the common time; others are interpolated. Static ones always hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose, matrix_from_quaternion, quaternion_from_matrix, slerp


class Edge(NamedTuple):
    """Pose of a frame in its parent: stamps (T,) [ns] (None if static), positions (T, 3), quaternions (T, 4)."""

    parent: str
    stamps: NDArray[np.int64] | None
    position: Float
    quaternion: Float

    def at(self, stamps: NDArray[np.int64]) -> Pose:
        """Return poses at times within its own."""
        if self.stamps is None or len(self.stamps) == 1:
            rotation = np.broadcast_to(matrix_from_quaternion(self.quaternion[-1]), (len(stamps), 3, 3))
            return Pose(np.broadcast_to(self.position[-1], (len(stamps), 3)), rotation)
        clock, time = (1e-9 * (each - self.stamps[0]) for each in (self.stamps, stamps))
        position = np.stack([np.interp(time, clock, column) for column in self.position.T], axis=1)
        return Pose(position, matrix_from_quaternion(slerp(clock, self.quaternion, time)))


def tree(transforms: Iterable[tuple[bool, Any]], where: str) -> dict[str, Edge]:
    """Return edges by the name of the frame that they place.

    Args:
        transforms: (whether it is static, message of `TransformStamped`) in any order.
        where: file, for errors.

    Raises:
        InputError: a frame has two parents, or a transform is no finite rigid motion.
    """
    rows: dict[str, list[tuple[bool, str, int, Any]]] = {}
    for lasting, message in transforms:
        parent, child = (name.lstrip("/") for name in (message.header.frame_id, message.child_frame_id))
        stamp = message.header.stamp
        row = (lasting, parent, stamp.sec * 1_000_000_000 + stamp.nanosec, message.transform)
        rows.setdefault(child, []).append(row)
    return {child: _edge(child, found, where) for child, found in rows.items()}


def _edge(child: str, rows: Sequence[tuple[bool, str, int, Any]], where: str) -> Edge:
    parents = sorted({row[1] for row in rows})
    if len(parents) > 1:
        raise InputError(
            where, f"frame {child} has several parents: {', '.join(parents)}",
            "record the transforms of one robot, with one publisher for each",
        )  # fmt: skip
    moving = [row for row in rows if not row[0]]
    latest = {row[2]: row[3] for row in (moving or rows)}  # the last published of equal stamps counts
    stamps = np.array(sorted(latest), dtype=np.int64)
    parts = [(latest[s].translation, latest[s].rotation) for s in stamps.tolist()]
    values = np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in parts], dtype=float)
    if not np.all(np.isfinite(values)) or np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1.0).max() > 0.01:
        raise InputError(where, f"a transform of {child} in {parents[0]} is no rigid motion", "check what published it")
    return Edge(parents[0], stamps if moving else None, values[:, :3], values[:, 3:])


def tool_in_base(edges: Mapping[str, Edge], base: str, tool: str, where: str) -> tuple[NDArray[np.int64], Float]:
    """Return stamps (T,) [ns] and rows (T, 7), position and quaternion, of one frame in another.

    Raises:
        UnknownName: no such frame.
        InputError: they are unconnected or relatively at rest, or their transforms share no time.
    """
    known = {*edges, *(edge.parent for edge in edges.values())}
    for name in (base, tool):
        if name not in known:
            raise UnknownName("frame", name, known, where=where)
    from_base, from_tool = (_upwards(edges, name, where) for name in (base, tool))
    common = next((name for name in from_tool if name in from_base), None)
    if common is None:
        raise InputError(
            where, f"no transforms connect {base} and {tool}: the one hangs from {from_base[-1]}, the other from "
            f"{from_tool[-1]}", "record /tf_static too, or choose other frames",
        )  # fmt: skip
    up, down = (chain[: chain.index(common)] for chain in (from_base, from_tool))
    way = [*up, *down]
    place = f"{where}: {base} to {tool}"
    clocks = [stamps for name in way if (stamps := edges[name].stamps) is not None]
    if not clocks:
        raise InputError(place, "nothing between them moves", "choose the robot's base and its tool")
    if not any(clock.any() for clock in clocks):
        raise InputError(place, "every header stamp is zero", "record transforms with their stamps")
    first, last = max(c[0] for c in clocks), min(c[-1] for c in clocks)
    most = max(clocks, key=len)
    stamps = most[(most >= first) & (most <= last)]
    if len(stamps) < 2:
        raise InputError(place, "their transforms have no interval in common", "record them at the same time")
    stamps = np.asarray(stamps)
    pose = _product(edges, up, stamps).inverse().compose(_product(edges, down, stamps))
    return stamps, np.concatenate([pose.position, quaternion_from_matrix(pose.rotation)], axis=1)


def _upwards(edges: Mapping[str, Edge], name: str, where: str) -> list[str]:
    chain = [name]
    while (edge := edges.get(chain[-1])) is not None:
        if edge.parent in chain:
            raise InputError(where, f"frame {edge.parent} is its own ancestor", "record the transforms of one robot")
        chain.append(edge.parent)
    return chain


def _product(edges: Mapping[str, Edge], chain: Sequence[str], stamps: NDArray[np.int64]) -> Pose:
    count = len(stamps)
    pose = Pose(np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))
    for name in chain:
        pose = edges[name].at(stamps).compose(pose)
    return pose
