r"""A learned LMC skill as a URScript program: skill, admittance controller and joint steps in the robot's controller.

The program does in each cycle of 2 ms what `skillframe drive run` does on a robot that takes positions:

    joints, wrench -> filter -> equation (2) of skillframe_lmc.runtime -> equation (2) of skillframe.control.admittance
        -> skillframe.control.joint_steps -> servoj

Matrices that do not change are computed here: K from the skill, D raised to the robot's floor, and the gains
(M/h + D + h K)^-1, for translation and rotation apart. A skill in the tool's axes turns them at its start. Poses and
Jacobian come from robot.toml's URDF at the measured joints, not from the controller's kinematics.

Source of the language: Universal Robots, "The URScript Programming Language", e-Series: chapters "Matrix and Array
Expressions", "Module motion" (servoj), "Module internals" (get_tcp_force: at the flange, base axes), "Module urmath".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from skillframe_drive.real import STILL_RAD, TARE_S
from skillframe_lmc.phase import Part, Phase, read_phase, speed
from skillframe_lmc.runtime import PUSHING
from skillframe_lmc.stall import SMOOTHING_S

from skillframe.control import (
    CALMING,
    LEASH_SLACK,
    MASS,
    MEMORY,
    QUIET_FORCE,
    QUIET_TORQUE,
    SHARE,
    SLOW,
    critical_damping,
)
from skillframe.document import read_frame
from skillframe.errors import InputError
from skillframe.execution import RAMP_S, load_robot_model
from skillframe.extend import Document
from skillframe.frames import Float, norm
from skillframe.robot import RobotModel, RobotSpec
from skillframe.signals import WrenchFilter
from skillframe_ur.link import GAIN, LOOKAHEAD_S, RATE_HZ, STOP_RAD_S2

JOINTS = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
"""The maker's names, from base to flange."""
NEAR_SINGULAR = 400.0
"""Largest sum of 1/s^2 over the singular values s of the Jacobian, rotation in units of 0.2 m [1/m^2].

Below it every s is above the 0.05 m where `skillframe.control.joint_steps` begins to damp.
"""
OTHER_ROBOT_M, OTHER_ROBOT_RAD = 5e-3, 0.02
"""Largest difference between the flange's pose and the controller's own: calibrated arms differ by millimetres."""
TURNED_AWAY_RAD = 3.0
"""Largest difference of the tool's orientation from the desired one; a rotation vector is unique up to pi."""
TEMPLATE = Path(__file__).with_name("program.script")
"""The program, with `{{name}}` where a number or a statement of the skill or robot stands."""


def program(document: Document, robot: RobotSpec, lines: Sequence[str]) -> str:
    """The text of the program.

    Args:
        document: a checked skill document.
        robot: a Universal Robot that takes positions 500 times a second.
        lines: of the comment at its head.

    Raises:
        InputError: another skill or robot, or a limit that the program cannot keep.
    """
    if document["type"] != "lmc":
        text = f"is of type {document['type']}, and a URScript program holds an lmc skill"
        raise InputError("the skill", text, "run it with skillframe drive run")
    _refuse_other(robot)
    phase, frame = read_phase(document), read_frame(document)
    if "tip" not in frame.points:
        fix = "learn from recordings whose metadata have it, frames.tip"
        raise InputError("the skill", "names no point 'tip' of its tool, which the damping depends on", fix)
    arm, pace = robot.control.admittance, robot.control.pace(speed(document))
    lever = float(norm(frame.points["tip"] - frame.center_of_compliance))
    law, h = _law(robot, phase, lever), 1.0 / RATE_HZ
    filter_ = WrenchFilter(dt=h).steady().gain
    model, limits = load_robot_model(robot), robot.limits
    name = re.sub(r"\W", "_", robot.name, flags=re.ASCII)
    values: dict[str, str] = {
        "name": name, "robot": name, **_kinematics(model),
        "h": _number(h), "period": _number(h / pace), "tare": str(round(TARE_S / h)), "still": _number(STILL_RAD),
        "k1": _list(filter_.value), "k2": _list(filter_.slope), "center": _list(frame.center_of_compliance),
        "ramp": _number(RAMP_S), "mass": " ".join(f"{each:g}" for each in np.diag(MASS)[[0, 3]]),
        "push_n": _number(arm.push[0]), "push_nm": _number(arm.push[1]), "calming": _number(CALMING),
        "quiet_f": _number(QUIET_FORCE**2), "quiet_t": _number(QUIET_TORQUE**2),
        "follow": _number(-float(np.expm1(-h / (SLOW * arm.total_delay)))),
        "fade": _number(float(np.exp(-h / (MEMORY * arm.total_delay)))), "ringing": _number(SHARE * arm.push[0]),
        "leash": _list(model.model.velocityLimit * arm.total_delay + LEASH_SLACK),
        "renew": str(max(1, round(0.04 / h))), "singular": _number(NEAR_SINGULAR),
        "other_m": _number(OTHER_ROBOT_M), "other_rad": _number(OTHER_ROBOT_RAD), "away": _number(TURNED_AWAY_RAD),
        "axes": "R" if frame.from_start else "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
        "axes_are": "the tool's at the start" if frame.from_start else "the base's",
        "lookahead": _number(LOOKAHEAD_S), "gain": f"{GAIN:g}", "stop": _number(STOP_RAD_S2),
        "guards": _guards(limits), **law, **_skill(phase, pace, h),
    }  # fmt: skip
    about = [
        *lines,
        f"{robot.name} {arm.told(lever)}",
        f"the skill's clock runs {pace:.2f} times slower than as taught; it gives up at "
        f"{phase.stop.force_limit_n:g} N, {phase.stop.time_limit_s * pace:.1f} s or {phase.stop.travel_limit_m:.3g} m",
        f"centre of compliance {_list(frame.center_of_compliance)} m in the flange's frame; units m, rad, N, Nm, s",
    ]
    head = "".join(f"# {part}\n" for line in about for part in wrap(line, 116))
    return head + _filled(TEMPLATE.read_text(encoding="utf-8"), values)


def _refuse_other(robot: RobotSpec) -> None:
    where = f"robot {robot.name}"
    if robot.control.interface != "position" or robot.control.rate_hz != RATE_HZ:
        text = f"takes a joint {robot.control.interface} {robot.control.rate_hz:g} times a second"
        raise InputError(where, text, f'name a Universal Robot with interface = "position" and rate_hz = {RATE_HZ:g}')
    model = load_robot_model(robot).model
    plain = all(joint.shortname() == "JointModelRZ" for joint in list(model.joints)[1:])
    if tuple(model.names)[1:] != JOINTS or not plain or tuple(model.parents) != (0, *range(len(JOINTS))):
        text = "is no Universal Robot: its joints are not shoulder_pan_joint ... wrist_3_joint, each about its own z"
        raise InputError(where, text, "name one of ours (ur5e), or a robot.toml with the maker's URDF")
    if robot.limits.energy_j is not None:
        raise InputError(f"{where}: limits.energy_j", "cannot be kept by a URScript program", "leave it out")


def _kinematics(model: RobotModel) -> dict[str, str]:
    """Where each joint and the flange are on the link before, and the joints' limits."""
    pin, tool = model.model, model.model.frames[model.tool_frames[0]]
    places = [*list(pin.jointPlacements)[1:], tool.placement]
    values = {"fastest": _list(pin.velocityLimit)}
    values |= {"lower": _list(pin.lowerPositionLimit), "upper": _list(pin.upperPositionLimit)}
    for i, place in enumerate(places, 1):
        values |= {f"p{i}": _list(place.translation), f"f{i}": _matrix(place.rotation)}
    return values


def _law(robot: RobotSpec, phase: Phase, lever: float) -> dict[str, str]:
    """K, D and the gains of equation (2), usual and calming, of translation and rotation in the skill's axes."""
    arm, h = robot.control.admittance, 1.0 / RATE_HZ
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3], stiffness[3:, 3:] = phase.translation.stiffness, phase.rotation.stiffness
    largest = float(np.linalg.eigvalsh(stiffness[:3, :3]).max())
    if largest > arm.stiffness:
        text = f"commands {largest:.3g} N/m, and {robot.name} with its surroundings yields with {arm.stiffness:.3g} N/m"
        raise InputError("the skill", text, "learn a softer one, --set stiffness_n_m, or measure contact_stiffness")
    damping = critical_damping(stiffness, MASS, floor=(arm.damping, arm.turning_damping(lever)))
    values: dict[str, Float] = {"k": stiffness, "d": damping}
    for name, share in (("g", 1.0), ("c", CALMING)):
        values[name] = np.linalg.inv(MASS / h + share * damping + h * stiffness).astype(np.float64, copy=False)
    halves = {"f": slice(0, 3), "t": slice(3, 6)}
    return {f"{name}_{half}": _matrix(m[at, at]) for name, m in values.items() for half, at in halves.items()}


def _skill(phase: Phase, pace: float, h: float) -> dict[str, str]:
    """The statements that depend on what the skill does: push, turn, both or neither."""
    stop, dt = phase.stop, h / pace
    texts = {"advance": "", "turn": "", "pushes": "False", "turns_far": ""}
    values: dict[str, Any] = {"push": [0.0] * 3, "turn_axis": [0.0] * 3, "v_push": 0.0, "v_turn": 0.0}
    pushes = []
    if _moves(phase.translation):
        values |= {"push": phase.translation.desired_direction, "v_push": phase.translation.speed}
        texts["advance"], pushing = _filled_advance(ADVANCE, phase.translation, stop.lead_force_n, dt)
        pushes += [pushing] if pushing else []
    if _moves(phase.rotation):
        values |= {"turn_axis": phase.rotation.desired_direction, "v_turn": phase.rotation.speed}
        texts["turn"], turning = _filled_advance(TURN, phase.rotation, stop.lead_torque_nm, dt)
        pushes += [turning] if turning else []
        texts["turns_far"] = f" or norm(theta) > {_number(stop.turn_limit_rad)}"
    if pushes:
        texts["pushes"] = " or ".join(pushes)
    held = not (_moves(phase.translation) or _moves(phase.rotation))
    smooth = dt / (SMOOTHING_S + dt)
    return {
        **texts, "push": _list(values["push"]), "turn_axis": _list(values["turn_axis"]),
        "v_push": _number(values["v_push"] / pace), "v_turn": _number(values["v_turn"] / pace),
        "stall_s": _number(stop.stall_s), "smooth": _number(smooth),
        "stall_scale": _list([1.0 / stop.stall_m] * 3 + [1.0 / stop.stall_rad] * 9),
        "most_n": _number(stop.force_limit_n), "most_m": _number(stop.travel_limit_m),
        "most_s": _number(stop.time_limit_s), "late": "1" if held else "2",
        "over_text": f"contact force above the skill's limit of {stop.force_limit_n:g} N",
        "far_text": f"went {1e3 * stop.travel_limit_m:g} mm or turned too far without coming to rest",
        "late_text": f"held for {stop.time_limit_s:g} s of the skill's clock, there being no direction to push in"
        if held else f"still under way after the skill's time limit of {stop.time_limit_s:g} s",
    }  # fmt: skip


def _moves(part: Part) -> bool:
    return part.desired_direction is not None and part.speed > 0.0


def _filled_advance(text: str, part: Part, push: float, dt: float) -> tuple[str, str]:
    """Statements that move the desired pose on, and the condition under which the tool pushes ("" for never)."""
    direction = part.desired_direction
    stiffness = 0.0 if direction is None else float(direction @ part.stiffness @ direction)
    body, limit, condition = text.split("--\n")
    step = {"step": _number(part.speed * dt)}
    if stiffness <= 0.0:
        return _filled(body, step), ""
    lead = {"lead": _number(push / stiffness), "least": _number(PUSHING * push / stiffness)}
    return _filled(body + limit, {**step, **lead}), _filled(condition.strip(), lead)


def _guards(limits: Any) -> str:
    """Statements for the robot's own limits, which come before the skill's end."""
    found = []
    if limits.force_n is not None:
        text = f"force limit: above {limits.force_n:g} N, the robot's limit"
        found.append((f"norm(F) > {_number(limits.force_n)}", text))
    if limits.torque_n_m is not None:
        text = f"torque limit: above {limits.torque_n_m:g} Nm, the robot's limit"
        found.append((f"norm(T) > {_number(limits.torque_n_m)}", text))
    if limits.workspace_m is not None:
        low, high = limits.workspace_m
        sides = [f"o7[{i}] < {_number(low[i])} or o7[{i}] > {_number(high[i])}" for i in range(3)]
        found.append((" or ".join(sides), "workspace limit: the flange left the robot's box"))
    return "".join(
        f'    if {condition}:\n      result = 2\n      reason = "{text}"\n    end\n' for condition, text in found
    )


def _filled(text: str, values: Mapping[str, str]) -> str:
    """The text with `{{name}}` replaced."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: values[found[1]], text)


def _number(value: float) -> str:
    """All digits of a number, without an exponent. Raises `InputError` if it is not finite."""
    if not np.isfinite(value):
        text = "needs finite numbers, and the skill or a limit of the robot's joints is infinite"
        raise InputError("the program", text, "give every joint its limits in the URDF")
    return np.format_float_positional(float(value) + 0.0, trim="0")


def _list(values: Any) -> str:
    return "[" + ", ".join(_number(value) for value in np.asarray(values, dtype=float)) + "]"


def _matrix(values: Float) -> str:
    return "[" + ", ".join(_list(row) for row in values) + "]"


ADVANCE = """\
    # x_d = x_0 + s u,  s <- min(s + nu dt, (x - x_0).u + L)
    if tick > 0:
      s = s + {{step}}
    end
    local reached = sf_dot(travel, push)
--
    if s > reached + {{lead}}:
      s = reached + {{lead}}
    end
--
s - reached >= {{least}}
"""
TURN = """\
    # R_d = exp(theta w) R_0,  theta <- min(theta + lambda dt, angle reached about w + L)
    if tick > 0:
      theta = theta + {{step}}
    end
    local turned = theta - sf_dot(sf_rotation_vector(sf_rotation(turn * theta) * R_0 * transpose(R)), turn)
--
    if theta > turned + {{lead}}:
      theta = turned + {{lead}}
    end
--
theta - turned >= {{least}}
"""
