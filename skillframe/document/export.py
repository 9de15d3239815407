"""What controllers that others wrote want to be told: parameters and messages, as YAML with the rest in comments.

Sources: the parameter declarations of crisp_controllers' `CartesianController` (cartesian_controller.yaml), the source
of cartesian_controllers' `CartesianComplianceController` and of its two bases, and aic_control_interfaces'
`MotionUpdate.msg` with `TrajectoryGenerationMode.msg` and aic_controller's documentation and bring-up. Each format says
which version of them it was checked against. None of these controllers was run here: try them in free air first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np

from skillframe.document.impedance import MOST_OFF, Axes, MovingImpedance, per_axis
from skillframe.errors import InputError
from skillframe.frames import Float

DIRECTIONS = ("x", "y", "z")
WIDE_OPEN = {"translation": 0.1, "rotation": 0.5}  # crisp's defaults, on axes without stiffness [m, rad]
CRISP_LARGEST = 5000.0  # its bound of every stiffness and damping: it refuses to load a larger one
WIDTH = 110  # of the file's comments
VELOCITY_MODE = 1  # aic_control_interfaces/TrajectoryGenerationMode


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format to export to.

    Attributes:
        name: as written after `--to`.
        summary: one line.
        axes: what its numbers are expressed in.
        body: the settings.
        checked: the controller's version, or repository and commit, that names and types were checked against.
        notes: what must be known before it is used, a sentence each; in the file and on the terminal.
        comments: how they are used; in the file.
    """

    name: str
    summary: str
    axes: Axes
    body: Callable[[MovingImpedance], Mapping[str, Any]]
    checked: str
    notes: tuple[str, ...]
    comments: tuple[str, ...]


def crisp(phase: MovingImpedance) -> Mapping[str, Any]:
    """Parameters of crisp_controllers/CartesianController: one stiffness per base axis, errors clipped to the lead."""
    task: dict[str, Any] = {}
    clip: dict[str, float] = {}
    for part, short, prefix, lead, at in _parts(phase):
        k, d = _gains(phase, at)
        _refuse_beyond(np.concatenate([k, d]), part)
        for axis, stiffness, damping in zip(DIRECTIONS, k.tolist(), d.tolist(), strict=True):
            task[f"k_{short}_{axis}"], task[f"d_{short}_{axis}"] = stiffness, damping
            clip[prefix + axis] = lead / stiffness if stiffness > 0.0 else WIDE_OPEN[part]
    fixed = {"use_operational_space": False, "use_local_jacobian": False, "limit_error": True}
    return {"cartesian_controller": {"ros__parameters": {**fixed, "task": {**task, "error_clip": clip}}}}


def _refuse_beyond(values: Float, part: str) -> None:
    if values.max() > CRISP_LARGEST:
        raise InputError(
            f"skill: {part}", f"holds a stiffness or damping of {values.max():g}, and crisp_controllers takes "
            f"{CRISP_LARGEST:g} at most", "learn with a smaller --set stiffness_n_m or stiffness_nm_rad",
        )  # fmt: skip


def cartesian_compliance(phase: MovingImpedance) -> Mapping[str, Any]:
    """Parameters of cartesian_controllers' CartesianComplianceController: stiffness in axes of compliance_ref_link."""
    stiffness = {}
    for _, _, _, _, at in _parts(phase):
        k, _ = _gains(phase, at)
        name = "trans_" if at == 0 else "rot_"
        stiffness.update({name + axis: value for axis, value in zip(DIRECTIONS, k.tolist(), strict=True)})
    return {"cartesian_compliance_controller": {"ros__parameters": {"stiffness": stiffness}}}


def motion_update(phase: MovingImpedance) -> Mapping[str, Any]:
    """A message aic_control_interfaces/MotionUpdate in velocity mode, whole matrices, in the robot's base."""
    zero = _vector(np.zeros(3))
    return {
        "header": {"frame_id": "base_link"},
        "velocity": {"linear": _vector(phase.twist[:3]), "angular": _vector(phase.twist[3:])},
        "target_stiffness": phase.stiffness.reshape(-1).tolist(),
        "target_damping": phase.damping.reshape(-1).tolist(),
        "feedforward_wrench_at_tip": {"force": zero, "torque": zero},
        "wrench_feedback_gains_at_tip": [0.0] * 6,
        "trajectory_generation_mode": {"mode": VELOCITY_MODE},
    }


FORMATS = {
    f.name: f
    for f in (
        Format(
            name="crisp", summary="crisp_controllers CartesianController (ROS 2 parameters)", axes="base", body=crisp,
            checked="utiasDSL/crisp_controllers 2b33ab7 (releases 2.2.0 to 2.3.1)",
            notes=(
                "needs crisp_controllers 1.3.0 or newer: before, use_local_jacobian: false acts at the base's origin, "
                "where a push makes a torque (20 N at 0.5 m: 10 Nm) about axes that the skill leaves free",
            ),
            comments=(
                "Add joints, base_frame and end_effector_frame of your robot; the latter at the centre of compliance.",
                "Publish target_pose: the pose at the start of the phase, moving with the twist above.",
                "error_clip keeps the push below the lead; the last word on force is your robot's own limit.",
            ),
        ),
        Format(
            name="cartesian_controllers", axes="tool", body=cartesian_compliance,
            summary="cartesian_controllers CartesianComplianceController (ROS 2 parameters)",
            checked="fzi-forschungszentrum-informatik/cartesian_controllers f53f798 (2024-10-20, ros2)",
            notes=(
                "the spring acts at end_effector_link; compliance_ref_link gives only its axes and the sensor's point: "
                "put both at the centre of compliance, with the tool's axes",
                "it holds stiffness alone: damping and speed follow from its own pd_gains and solver",
            ),
            comments=(
                "Add joints, links, command_interfaces, solver and pd_gains of your robot, and ft_sensor_ref_link.",
                "The stiffness turns with the tool. The twist above is in the tool's axes at the start of the phase: "
                "turn it into robot_base_link, in which target_frame is read.",
                "Publish target_frame: the pose at the start of the phase, moving with that twist, but ahead of the "
                "measured one by no more than lead over stiffness: the controller itself clips at 1 m and 1 rad only.",
                "Publish ft_sensor_wrench, the environment's force on the tool, without bias and the tool's weight, in "
                "the axes of ft_sensor_ref_link: without it nothing gives way. Leave target_wrench at zero.",
            ),
        ),
        Format(
            name="aic_motion_update", summary="aic_control_interfaces MotionUpdate (ROS 2 message)", axes="base",
            body=motion_update, checked="intrinsic-dev/aic db40abc (2026-03-13)",
            notes=(
                "for aic_control_interfaces from 2026-02-19 on (2b0f671): wrench_feedback_gains_at_tip is float64[6]",
                "the toolkit's bring-up limits the wrench to 10 N and 10 Nm per axis (impedance.maximum_wrench): "
                "a larger push never arrives",
            ),
            comments=(
                "Publish it on /aic_controller/pose_commands, with the controller in its Cartesian target mode.",
                "In velocity mode nothing limits how far the target leads a blocked tool: end the phase in time.",
            ),
        ),
    )
}  # fmt: skip


def settings_text(form: Format, phase: MovingImpedance, words: list[str]) -> str:
    """The file: what the skill does and how the settings are used as comments, then the settings.

    Raises:
        InputError: the controller cannot hold the skill's compliance.
    """
    stops = ", ".join(f"{key} {value:g}" for key, value in sorted(phase.stop.items()) if "lead" not in key)
    said = [
        *words,
        f"axes: {phase.axes}; centre of compliance {_numbers(phase.center)} m in the tool frame",
        f"twist of the desired pose: {_numbers(phase.twist)} m/s, rad/s",
        f"lead: {phase.lead_force:g} N, {phase.lead_torque:g} Nm at most",
        f"the phase ends with: {stops}",
        f"checked against {form.checked}",
        *(line for text in (*form.notes, *form.comments) for line in wrap(text, WIDTH)),
    ]
    return "".join(f"# {line}\n" for line in [form.summary, *said]) + "".join(_lines(form.body(phase), ""))


def _parts(phase: MovingImpedance) -> list[tuple[str, str, str, float, int]]:
    """Translation and rotation: name, crisp's short name, prefix of an axis, lead, and where they begin."""
    return [("translation", "pos", "", phase.lead_force, 0), ("rotation", "rot", "r", phase.lead_torque, 3)]


def _gains(phase: MovingImpedance, at: int) -> tuple[Float, Float]:
    """Stiffness and damping per axis (3,)."""
    block = slice(at, at + 3)
    stiffness, off = per_axis(phase.stiffness[block, block])
    if off > MOST_OFF:
        raise InputError(
            "skill", f"its compliant axes are {np.rad2deg(off):.0f} degrees from the controller's ({phase.axes}) axes",
            "export aic_motion_update, which holds whole matrices, or learn with other --axes",
        )  # fmt: skip
    damping = phase.damping[block, block]
    return stiffness, np.diag(damping)


def _vector(values: Float) -> dict[str, float]:
    return dict(zip(DIRECTIONS, values.tolist(), strict=True))


def _numbers(values: Float) -> str:
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in values) + ")"


def _lines(value: Mapping[str, Any], indent: str) -> list[str]:
    """YAML of nested mappings with numbers, truth values, text and rows of numbers."""
    lines = []
    for key, item in value.items():
        if isinstance(item, Mapping):
            lines += [f"{indent}{key}:\n", *_lines(item, indent + "  ")]
        else:
            lines.append(f"{indent}{key}: {_scalar(item)}\n")
    return lines


def _scalar(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_scalar(item) for item in value) + "]"
    if isinstance(value, bool | str):
        return str(value).lower() if isinstance(value, bool) else f'"{value}"'
    if isinstance(value, int):
        return str(value)
    text = f"{value:.9f}".rstrip("0")
    return "0.0" if float(text) == 0.0 else text + "0" * text.endswith(".")
