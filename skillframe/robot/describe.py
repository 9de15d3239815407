"""Description of a robot as text, with degrees where marked, and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pinocchio as pin

from skillframe.errors import SkillframeError
from skillframe.frames import quaternion_from_matrix, rotation_vector
from skillframe.robot.bodies import rigid_bodies
from skillframe.robot.chain import ClosedChain
from skillframe.robot.kinematics import tool_pose
from skillframe.robot.link_checks import given_inertias, guess_note
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec
from skillframe.robot.tables import Actuation, Arm


def describe(robot: RobotModel, of_drive: Sequence[str] = ()) -> str:
    """Text with joints, limits, mass, arms, actuators and payload."""
    robot = _closed(robot)
    spec, model = robot.spec, robot.model
    mass, moving = _mass(robot), _moving(robot)
    lines = [
        f"{spec.name}: {spec.summary}" if spec.summary else spec.name,
        f"  base {spec.base}, {moving} moving bodies, nq {model.nq}, nv {model.nv}, {mass:.4g} kg",
        f"  control {spec.control.rate_hz:g} Hz, fixture at {_triple(spec.workspace.fixture)} m in base",
        *([] if spec.control.interface == "torque" else [f"  {spec.control.admittance.told()}"]),
        f"  limits: {_limits(robot)}",
        *_measured(spec),
    ]
    lines += [f"  {note}"] if (note := guess_note(spec)) else []
    lines += ["", "  joints that turn in rad, rad/s and Nm, joints that slide in m, m/s and N"]
    lines += [f"  {'joint':<20}{'home':>16}{'lower':>12}{'upper':>12}{'velocity':>12}{'effort':>10}"]
    lines += [_joint(robot, index) for index in range(1, model.njoints)]
    for arm, frame in zip(spec.arm, robot.tool_frames, strict=True):
        pose = tool_pose(model, robot.home, frame)
        turn = np.degrees(rotation_vector(pose.rotation))
        lines += ["", f"  arm {arm.name!r}: tool frame {arm.tool_frame!r}{_axis(arm)}"]
        lines += [f"    at home {_triple(pose.position)} m, turned by the rotation vector {_triple(turn, 1)} degrees"]
        lines += [f"    z axis (out along the tool) {_triple(pose.rotation[:, 2])}"]
    machine = [f"  loop: {loop.frame_a} meets {loop.frame_b}" for loop in spec.loop]
    machine += [f"  {a.joint} is driven by {a.fmu}{_how(a, spec)}" for a in spec.actuation]
    machine += [f"  {n} is drawn backwards in the URDF: here it grows as the rod slides out" for n in robot.turned]
    machine += of_drive
    if spec.payload is not None:
        load = spec.payload
        machine.append(f"  payload {load.mass:g} kg in {load.link!r}, rated for {load.rating:g} kg")
    return "\n".join([*lines, "", *machine] if machine else lines)


def _axis(arm: Arm) -> str:
    return "" if arm.tool_axis == "z" else f", its {arm.tool_axis} axis out along the tool"


def _closed(robot: RobotModel) -> RobotModel:
    if not robot.spec.machine:
        return robot
    try:
        chain = ClosedChain(robot)
        return replace(robot, home=chain.home)
    except SkillframeError:
        return robot


def _measured(spec: RobotSpec) -> list[str]:
    if spec.own_law:
        return []
    known = "exact positions and velocities" if spec.encoders is None else str(spec.encoders)
    ms = 1e3 * spec.control.late_s
    late = f"{ms:g} ms from command to torque" if ms else "no delay of the loop"
    lines = [f"  encoders: {known}; {late}"]
    if spec.mount is not None:
        lines.append(f"  mount: {spec.mount}, between force sensor and tool")
    if spec.dynamics.compensate:
        lines.append("  joint friction and damping: the controller adds the nominal ones to its torques")
    return lines


def _how(actuation: Actuation, spec: RobotSpec) -> str:
    if spec.servo:
        return ", which takes a position" if "target" in actuation.inputs else ", which takes a torque"
    gains = ((actuation.velocity_gain, "m"), (actuation.force_gain, "m2/(N s)"))
    text = " and ".join("a derived one" if gain is None else f"{gain:.4g} {unit}" for gain, unit in gains)
    return f", with gains of {text}"


def as_json(robot: RobotModel, of_drive: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The description in SI units and radians. Missing limits and homes are null."""
    robot = _closed(robot)
    spec, model = robot.spec, robot.model
    return {
        "name": spec.name, "summary": spec.summary, "base": spec.base, "nq": model.nq, "nv": model.nv,
        "mass_kg": _mass(robot), "moving_bodies": _moving(robot), "rate_hz": spec.control.rate_hz,
        "interface": spec.control.figures(),
        "fixture_m": [float(x) for x in spec.workspace.fixture], "limits": asdict(spec.limits),
        "encoders": spec.encoders and asdict(spec.encoders), "mount": spec.mount and asdict(spec.mount),
        "delay_s": spec.control.late_s,
        "joints": [_joint_values(robot, index) for index in range(1, model.njoints)],
        "arms": [_arm_values(robot, i) for i in range(len(spec.arm))],
        **({**_machine_values(spec), **(of_drive or {})} if spec.loop or spec.actuation or spec.payload else {}),
    }  # fmt: skip


def _machine_values(spec: RobotSpec) -> dict[str, Any]:
    values = {"loops": [asdict(loop) for loop in spec.loop], "payload": spec.payload and asdict(spec.payload)}
    if spec.servo:
        drives = [{"joint": a.joint, "fmu": a.fmu, "inputs": a.inputs, "outputs": a.outputs} for a in spec.actuation]
        values |= {"actuation": drives}
    elif spec.actuation:
        kept = ("joint", "fmu", "velocity_gain", "force_gain")
        drives = [{name: getattr(drive, name) for name in kept} for drive in spec.actuation]
        values |= {"actuation": drives}
    return values


def _joint_values(robot: RobotModel, index: int) -> dict[str, Any]:
    model, joint = robot.model, robot.model.joints[index]
    names = ("unit", "home", "lower", "upper", "velocity", "effort")
    values: dict[str, Any] = {"name": model.names[index], "freedoms": joint.nv, **dict.fromkeys(names)}
    if joint.nv == 1:
        speed, effort = model.velocityLimit[joint.idx_v], model.effortLimit[joint.idx_v]
        figures = (_home(robot, joint), *(_bounds(robot, joint) or (None, None)), _finite(speed), _finite(effort))
        values |= dict(zip(names, (_unit(joint), *figures), strict=True))
    return values


def _arm_values(robot: RobotModel, index: int) -> dict[str, Any]:
    arm, pose = robot.spec.arm[index], tool_pose(robot.model, robot.home, robot.tool_frames[index])
    return {
        "name": arm.name, "tool_frame": arm.tool_frame, "tool_axis": arm.tool_axis,
        "home_position_m": pose.position.tolist(),
        "home_quaternion_xyzw": quaternion_from_matrix(pose.rotation).tolist(),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _mass(robot: RobotModel) -> float:
    return float(sum(g.mass for g in given_inertias(robot).values()))


def _moving(robot: RobotModel) -> int:
    return len(rigid_bodies(robot.urdf)) - (robot.spec.base == "fixed")


def _home(robot: RobotModel, joint: pin.JointModel) -> float:
    if joint.nq == 2:
        return float(np.arctan2(robot.home[joint.idx_q + 1], robot.home[joint.idx_q]))
    return float(robot.home[joint.idx_q])


def _bounds(robot: RobotModel, joint: pin.JointModel) -> tuple[float, float] | None:
    low, high = (limit[joint.idx_q] for limit in (robot.model.lowerPositionLimit, robot.model.upperPositionLimit))
    return (float(low), float(high)) if joint.nq == 1 and low < high else None


def _joint(robot: RobotModel, index: int) -> str:
    model, joint = robot.model, robot.model.joints[index]
    name = f"  {model.names[index]:<20}"
    if joint.nv == 0:
        return f"{name}{'follows another':>16}"
    if joint.nv > 1:
        return f"{name}{f'{joint.nv} freedoms':>16}"
    value, bounds = _home(robot, joint), [f"{limit:.4g}" for limit in _bounds(robot, joint) or ()] or ["free", "free"]
    speed, effort = model.velocityLimit[joint.idx_v], model.effortLimit[joint.idx_v]
    return f"{name}{f'{value:.4f} {_unit(joint)}':>16}{bounds[0]:>12}{bounds[1]:>12}{speed:>12.4g}{effort:>10.6g}"


def _unit(joint: pin.JointModel) -> str:
    return "m" if joint.shortname().startswith("JointModelP") else "rad"


def _limits(robot: RobotModel) -> str:
    limits = robot.spec.limits
    words = {
        "force_n": "contact force {:g} N", "torque_n_m": "contact torque {:g} Nm",
        "torque_rate_nm_s": "rate of joint torques {:g} Nm/s", "energy_j": "energy {:g} J",
    }  # fmt: skip
    given = [text.format(getattr(limits, key)) for key, text in words.items() if getattr(limits, key) is not None]
    if limits.workspace_m is not None:
        given.append(f"box {_triple(limits.workspace_m[0])} to {_triple(limits.workspace_m[1])} m")
    return ", ".join(given) or "none"


def _triple(values: object, digits: int = 3) -> str:
    return "(" + ", ".join(f"{round(float(x), digits) + 0.0:.{digits}f}" for x in np.asarray(values, dtype=float)) + ")"
