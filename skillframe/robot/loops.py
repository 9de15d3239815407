"""Constraints of a robot's tree: loops, and joints that follow others.

Loops are points that two frames share; they have gaps, and directions in which these open.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import qr

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, norm
from skillframe.robot.model import ROOT_JOINT, RobotModel, mimic_joints
from skillframe.robot.urdf import numbers

_LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
DEGENERATE = 1e-3
"""Sine and relative size below which motions are called dependent; URDFs are written with four digits or more."""


class ClosedLoop(NamedTuple):
    """A point that two frames share.

    Attributes:
        name: of both frames; frames: their ids; carrier: the last joint that both hang on, 0 for base.
        joints: those below the carrier that move the frames.
    """

    name: str
    frames: tuple[int, int]
    carrier: int
    joints: tuple[int, ...]


class Follower(NamedTuple):
    """A joint at ratio times the position of another, plus an offset [rad or m]. Joints by their ids."""

    joint: int
    leader: int
    ratio: float
    offset: float


def followers_of(robot: RobotModel) -> tuple[Follower, ...]:
    """Joints of a machine that follow others by mimic tags of the URDF.

    Raises:
        InputError: a leader that does not move.
    """
    spec, model, found = robot.spec, robot.model, []
    for name in mimic_joints(robot.urdf) if spec.mimic and spec.machine else ():
        tag = robot.urdf.joints[name].element.find("mimic")
        assert tag is not None
        leader = tag.get("joint", "")
        if not model.existJointName(leader) or leader == name:
            fix = "name a moving joint, or hold it by [lock] as well"
            raise InputError(
                f"{robot.urdf.path}: joint {name!r} mimic", f"follows {leader!r}, which does not move", fix
            )
        ratio, offset = (numbers(tag, key, 1, (usual,))[0] for key, usual in (("multiplier", 1.0), ("offset", 0.0)))
        own, other = (-1.0 if joint in robot.turned else 1.0 for joint in (name, leader))
        found.append(Follower(model.getJointId(name), model.getJointId(leader), own * ratio * other, own * offset))
    return tuple(found)


def couplings(model: pin.Model, followers: Sequence[Follower]) -> tuple[Float, Float]:
    """Rows (followers, nv) and offsets (followers,) of the equations rows q = offsets."""
    rows = np.zeros((len(followers), model.nv))
    for row, each in zip(rows, followers, strict=True):
        row[model.joints[each.joint].idx_v] = 1.0
        row[model.joints[each.leader].idx_v] -= each.ratio
    return rows, np.array([each.offset for each in followers])


def require_plain_joints(model: pin.Model, where: str) -> None:
    """Refuse joints of more than one coordinate.

    Raises:
        InputError: names the first such joint.
    """
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if joint.nq == 1:
            continue
        fixes = {"stands on a free base": 'write base = "fixed" in robot.toml'}
        why = f"has {joint.nv} freedoms"
        if name == ROOT_JOINT:
            why = "stands on a free base"
        elif joint.nv == 1:
            why = "is continuous"
            fixes[why] = "make it revolute, with limits"
        text = f"joint {name!r} {why}; a machine with closed chains needs joints with one coordinate each"
        raise InputError(where, text, fixes.get(why, "use joints with limits"))


def closed_loop(model: pin.Model, name_a: str, name_b: str, where: str) -> ClosedLoop:
    """The loop of two frames.

    Raises:
        UnknownName: there is no such frame.
        InputError: one body has both.
    """
    for name in (name_a, name_b):
        if not model.existFrame(name):
            raise UnknownName("frame", name, [f.name for f in model.frames], "named in [[loop]]")
    a, b = (int(model.getFrameId(name)) for name in (name_a, name_b))
    one, two = (list(model.supports[model.frames[frame].parentJoint]) for frame in (a, b))
    joints = tuple(sorted(set(one) ^ set(two)))
    if not joints:
        text = f"the loop {name_a} - {name_b} joins two frames of one body"
        raise InputError(where, text, "name frames of two bodies that meet in a pin")
    return ClosedLoop(f"{name_a} - {name_b}", (a, b), int(max(set(one) & set(two))), joints)


def moving_rows(model: pin.Model, loops: Sequence[ClosedLoop], jacobian: Float, where: str) -> Float:
    """Orthonormal directions (R, 3 loops) in which joints move each loop's gap, from the gaps' Jacobian.

    Raises:
        InputError: a loop that cannot move, or a joint that does not move its loop.
    """
    rows = []
    for index, loop in enumerate(loops):
        columns = [model.joints[j].idx_v for j in loop.joints]
        moved = jacobian[3 * index : 3 * index + 3, columns]
        sizes = norm(moved.T)
        for j, size in zip(loop.joints, sizes, strict=True):
            if size <= DEGENERATE * sizes.max():
                text = f"the joint {model.names[j]} does not move the loop {loop.name}: its axis runs through"
                raise InputError(where, f"{text} the frames", "correct its axis, or make it fixed")
        left, values, _ = np.linalg.svd(moved)
        rank = int((values > DEGENERATE * values.max(initial=0.0)).sum())
        if rank >= len(loop.joints):
            names = [model.names[j] for j in loop.joints]
            text = f"the loop {loop.name} cannot move: its joints {', '.join(names)} do not turn in one plane"
            raise InputError(where, text, "draw their hinges parallel and square to rods, or add a joint")
        # rows along the axes where the plane is: a sparse choice among all bases of it
        basis, _, _ = qr(left[:, :rank] @ left[:, :rank].T, pivoting=True)
        block = np.zeros((rank, jacobian.shape[0]))
        block[:, 3 * index : 3 * index + 3] = np.where(np.abs(basis[:, :rank].T) < 1e-12, 0.0, basis[:, :rank].T)
        rows.append(block)
    return np.concatenate([np.zeros((0, len(jacobian))), *rows])


def loop_gaps(model: pin.Model, loops: Sequence[ClosedLoop], data: pin.Data, q: Float) -> tuple[Float, Float]:
    """Gaps (3 loops,) in the axes of the loops' carriers [m], and their Jacobian (3 loops, nv)."""
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    gaps, jacobian = np.zeros(3 * len(loops)), np.zeros((3 * len(loops), model.nv))
    for index, loop in enumerate(loops):
        a, b = loop.frames
        gap = np.array(data.oMf[a].translation - data.oMf[b].translation)
        moved = (pin.getFrameJacobian(model, data, a, _LWA) - pin.getFrameJacobian(model, data, b, _LWA))[:3]
        if loop.carrier:
            moved = moved + pin.skew(gap) @ pin.getJointJacobian(model, data, loop.carrier, _LWA)[3:]
        back = data.oMi[loop.carrier].rotation.T
        gaps[3 * index : 3 * index + 3], jacobian[3 * index : 3 * index + 3] = back @ gap, back @ moved
    return gaps, jacobian


def dependent_joints(
    robot: RobotModel, loops: Sequence[ClosedLoop], followers: Sequence[int], constraint: Float
) -> np.ndarray:
    """Indices in velocities of joints that constraints (R, nv) move: the fewest possible of those that carry tools."""
    model = robot.model
    inside = sorted({j for loop in loops for j in loop.joints} | set(followers))
    tool = {j for frame in robot.tool_frames for j in model.supports[model.frames[frame].parentJoint]}
    basis: Float = np.zeros((len(constraint), 0))
    chosen = []
    for j in sorted(inside, key=lambda joint: (joint in tool, joint not in followers, joint)):
        column = constraint[:, model.joints[j].idx_v]
        left = column - basis @ (basis.T @ column)
        if np.linalg.norm(left) > DEGENERATE * np.linalg.norm(column):
            chosen.append(int(model.joints[j].idx_v))
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
    return np.array(sorted(chosen), dtype=int)
