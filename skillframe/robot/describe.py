"""A robot in words and figures a person can read; degrees only here, with the unit written."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from skillframe.frames import rotation_vector
from skillframe.robot.bodies import rigid_bodies
from skillframe.robot.kinematics import tool_pose
from skillframe.robot.link_checks import given_inertias
from skillframe.robot.model import RobotModel


def describe(robot: RobotModel) -> str:
    """Joints with limits and home, mass, arms with the tool's pose at home."""
    spec, model = robot.spec, robot.model
    mass = sum(g.mass for g in given_inertias(robot).values())
    moving = len(rigid_bodies(robot.urdf)) - (spec.base == "fixed")
    lines = [
        f"{spec.name}: {spec.summary}" if spec.summary else spec.name,
        f"  base {spec.base}, {moving} moving bodies, nq {model.nq}, nv {model.nv}, {mass:.4g} kg",
        f"  control {spec.control.rate_hz:g} Hz, fixture at {_triple(spec.workspace.fixture)} m in base",
        f"  limits {_limits(robot)}",
    ]
    lines += ["", f"  {'joint':<20}{'home':>16}{'lower':>12}{'upper':>12}{'velocity/s':>12}{'effort':>10}"]
    lines += [_joint(robot, index) for index in range(1, model.njoints)]
    for arm, frame in zip(spec.arm, robot.tool_frames, strict=True):
        pose = tool_pose(model, robot.home, frame)
        turn = np.degrees(rotation_vector(pose.rotation))
        lines += ["", f"  arm {arm.name!r}: tool frame {arm.tool_frame!r}"]
        lines += [f"    at home {_triple(pose.position)} m, turned by the rotation vector {_triple(turn, 1)} degrees"]
        lines += [f"    z axis (out along the tool) {_triple(pose.rotation[:, 2])}"]
    return "\n".join(lines)


def _joint(robot: RobotModel, index: int) -> str:
    model, joint = robot.model, robot.model.joints[index]
    name = f"  {model.names[index]:<20}"
    if joint.nv == 0:
        return f"{name}{'follows another':>16}"
    if joint.nv > 1:
        return f"{name}{f'{joint.nv} freedoms':>16}"
    value = robot.home[joint.idx_q]
    bounds = ["free", "free"]
    if joint.nq == 2:
        value = np.arctan2(robot.home[joint.idx_q + 1], robot.home[joint.idx_q])
    elif model.lowerPositionLimit[joint.idx_q] < model.upperPositionLimit[joint.idx_q]:
        bounds = [f"{limit[joint.idx_q]:.4g}" for limit in (model.lowerPositionLimit, model.upperPositionLimit)]
    speed, effort = model.velocityLimit[joint.idx_v], model.effortLimit[joint.idx_v]
    return f"{name}{f'{value:.4f} {_unit(joint)}':>16}{bounds[0]:>12}{bounds[1]:>12}{speed:>12.4g}{effort:>10.4g}"


def _unit(joint: pin.JointModel) -> str:
    return "m" if joint.shortname().startswith("JointModelP") else "rad"


def _limits(robot: RobotModel) -> str:
    limits = robot.spec.limits
    units = {"force_n": "N", "torque_n_m": "N m", "torque_rate_nm_s": "N m/s", "energy_j": "J"}
    given = [f"{getattr(limits, key):g} {unit}" for key, unit in units.items() if getattr(limits, key) is not None]
    if limits.workspace_m is not None:
        given.append(f"box {_triple(limits.workspace_m[0])} to {_triple(limits.workspace_m[1])} m")
    return ", ".join(given) or "none"


def _triple(values: object, digits: int = 3) -> str:
    return "(" + ", ".join(f"{round(float(x), digits) + 0.0:.{digits}f}" for x in np.asarray(values, dtype=float)) + ")"
