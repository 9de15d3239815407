"""Tool poses from recorded joint positions: forward kinematics of the arm, the other joints staying at home."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from skillframe.errors import InputError
from skillframe.frames import Float, Pose
from skillframe.robot.model import ROOT_JOINT, RobotModel, load_model
from skillframe.robot.spec import load_robot


def tool_poses(robot: str, arm: str | None, names: Sequence[str], positions: Float) -> Pose:
    """Poses of a robot's tool frame in its base, position (T, 3) and rotation (T, 3, 3).

    Args:
        robot: name or path, as everywhere.
        arm: which arm; None for the only one.
        names: recorded joints; those that do not carry the tool are left out.
        positions: (T, len(names)) [rad, m].

    Raises:
        InputError: several arms and none chosen, a free base, or a joint before the tool that was not recorded.
        UnknownName: no such robot or arm.
    """
    model = load_model(load_robot(robot))
    frame = model.tool_frames[_arm(model, robot, arm)]
    indices = [(i, names.index(name)) for i, name in _joints(model, robot, frame, names)]
    configuration, data = model.home.copy(), model.model.createData()
    position, rotation = np.empty((len(positions), 3)), np.empty((len(positions), 3, 3))
    for row, recorded in enumerate(positions):
        for joint, column in indices:
            _set(model.model.joints[joint], configuration, float(recorded[column]))
        pin.framesForwardKinematics(model.model, data, configuration)
        position[row], rotation[row] = data.oMf[frame].translation, data.oMf[frame].rotation
    return Pose(position, rotation)


def _arm(model: RobotModel, robot: str, arm: str | None) -> int:
    if arm is not None:
        return model.arm_index(arm)
    if len(model.spec.arm) != 1:
        arms = ", ".join(a.name for a in model.spec.arm) or "none"
        raise InputError(f"--robot {robot}", f"has the arms {arms}", "choose one with --arm")
    return 0


def _joints(model: RobotModel, robot: str, frame: int, names: Sequence[str]) -> list[tuple[int, str]]:
    """Index and name of every moving joint between base and tool."""
    supports = [int(i) for i in model.model.supports[model.model.frames[frame].parentJoint] if i > 0]
    found = [(i, str(model.model.names[i])) for i in supports if str(model.model.names[i]) not in model.followers]
    if any(name == ROOT_JOINT for _, name in found):
        raise InputError(f"--robot {robot}", "has a free base, whose pose joint states do not hold", "record the pose")
    missing = [name for _, name in found if name not in names]
    if missing:
        raise InputError(
            f"--robot {robot}", f"needs the joints {', '.join(missing)}; recorded are {', '.join(names)}",
            "choose the robot that was recorded, with its joint names",
        )  # fmt: skip
    return found


def _set(joint: pin.JointModel, configuration: Float, value: float) -> None:
    """One joint's coordinates. A continuous joint holds cosine and sine."""
    angle = (np.cos(value), np.sin(value)) if joint.nq == 2 else (value,)
    configuration[joint.idx_q : joint.idx_q + joint.nq] = angle
