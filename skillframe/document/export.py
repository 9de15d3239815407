"""What controllers that others wrote want to be told: parameters and messages, as YAML with the rest in comments.

Sources: the parameter declarations of crisp_controllers' `CartesianController` (cartesian_controller.yaml), the source
of cartesian_controllers' `CartesianComplianceController` and of its two bases, and aic_control_interfaces'
`MotionUpdate.msg` with `TrajectoryGenerationMode.msg` and aic_controller's documentation and bring-up. Each format's
record says which version of them it was checked against (`skillframe.extend.exporters`). None of these controllers was
run here: try them in free air first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from skillframe.document.impedance import MOST_OFF, per_axis
from skillframe.errors import InputError, SkillframeError
from skillframe.extend.records import ExporterType, MovingImpedance
from skillframe.extend.registry import BadPlugin
from skillframe.frames import Float

DIRECTIONS = ("x", "y", "z")
WIDE_OPEN = {"translation": 0.1, "rotation": 0.5}  # crisp's defaults, on axes without stiffness [m, rad]
CRISP_LARGEST = 5000.0  # its bound of every stiffness and damping: it refuses to load a larger one
WIDTH = 110  # of the file's comments
VELOCITY_MODE = 1  # aic_control_interfaces/TrajectoryGenerationMode


CRISP = (
    "Add joints, base_frame and end_effector_frame of your robot; the latter at the centre of compliance.",
    "Publish target_pose: the pose at the start of the phase, moving with the twist above.",
    "error_clip keeps the push below the lead; the last word on force is your robot's own limit.",
)
COMPLIANCE = (
    "Add joints, links, command_interfaces, solver and pd_gains of your robot, and ft_sensor_ref_link.",
    "The stiffness turns with the tool. The twist above is in the tool's axes at the start of the phase: "
    "turn it into robot_base_link, in which target_frame is read.",
    "Publish target_frame: the pose at the start of the phase, moving with that twist, but ahead of the "
    "measured one by no more than lead over stiffness: the controller itself clips at 1 m and 1 rad only.",
    "Publish ft_sensor_wrench, the environment's force on the tool, without bias and the tool's weight, in "
    "the axes of ft_sensor_ref_link: without it nothing gives way. Leave target_wrench at zero.",
)
MOTION_UPDATE = (
    "Publish it on /aic_controller/pose_commands, with the controller in its Cartesian target mode.",
    "In velocity mode nothing limits how far the target leads a blocked tool: end the phase in time.",
)
"""How each is used, a sentence each."""


def crisp(phase: MovingImpedance, lines: Sequence[str]) -> str:
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
    body = {"cartesian_controller": {"ros__parameters": {**fixed, "task": {**task, "error_clip": clip}}}}
    return yaml_text([*lines, *CRISP], body)


def _refuse_beyond(values: Float, part: str) -> None:
    if values.max() > CRISP_LARGEST:
        raise InputError(
            f"skill: {part}", f"holds a stiffness or damping of {values.max():g}, and crisp_controllers takes "
            f"{CRISP_LARGEST:g} at most", "learn with a smaller --set stiffness_n_m or stiffness_nm_rad",
        )  # fmt: skip


def cartesian_compliance(phase: MovingImpedance, lines: Sequence[str]) -> str:
    """Parameters of cartesian_controllers' CartesianComplianceController: stiffness in axes of compliance_ref_link."""
    stiffness = {}
    for _, _, _, _, at in _parts(phase):
        k, _ = _gains(phase, at)
        name = "trans_" if at == 0 else "rot_"
        stiffness.update({name + axis: value for axis, value in zip(DIRECTIONS, k.tolist(), strict=True)})
    body = {"cartesian_compliance_controller": {"ros__parameters": {"stiffness": stiffness}}}
    return yaml_text([*lines, *COMPLIANCE], body)


def motion_update(phase: MovingImpedance, lines: Sequence[str]) -> str:
    """A message aic_control_interfaces/MotionUpdate in velocity mode, whole matrices, in the robot's base."""
    zero = _vector(np.zeros(3))
    body = {
        "header": {"frame_id": "base_link"},
        "velocity": {"linear": _vector(phase.twist[:3]), "angular": _vector(phase.twist[3:])},
        "target_stiffness": phase.stiffness.reshape(-1).tolist(),
        "target_damping": phase.damping.reshape(-1).tolist(),
        "feedforward_wrench_at_tip": {"force": zero, "torque": zero},
        "wrench_feedback_gains_at_tip": [0.0] * 6,
        "trajectory_generation_mode": {"mode": VELOCITY_MODE},
    }
    return yaml_text([*lines, *MOTION_UPDATE], body)


def exported(exporter: ExporterType, phase: MovingImpedance, words: Sequence[str]) -> str:
    """The text of a settings file.

    Args:
        exporter: the format.
        phase: in the exporter's axes.
        words: what the skill does, a line each.

    Raises:
        InputError: the controller cannot hold the skill's compliance.
        BadPlugin: the exporter fails otherwise, or gives no text.
    """
    stops = ", ".join(f"{key} {value:g}" for key, value in sorted(phase.stop.items()) if "lead" not in key)
    lines = [
        exporter.summary,
        *words,
        f"axes: {phase.axes}; centre of compliance {_numbers(phase.center)} m in the tool frame",
        f"twist of the desired pose: {_numbers(phase.twist)} m/s, rad/s",
        f"lead: {phase.lead_force:g} N, {phase.lead_torque:g} Nm at most",
        f"the phase ends with: {stops}",
        f"checked against {exporter.checked}",
        *exporter.notes,
    ]
    try:
        text: object = exporter.write(phase, lines)
    except SkillframeError:
        raise
    except Exception as error:  # foreign code
        problem = f"raised {type(error).__name__}: {error}"
        raise BadPlugin(f"exporter {exporter.name}: {problem}; tell its author, or export to another format") from error
    if not isinstance(text, str) or not text:
        raise BadPlugin(f"exporter {exporter.name}: gave {text!r:.60}, not the text of a file; tell its author")
    return text


def yaml_text(lines: Sequence[str], body: Mapping[str, Any]) -> str:
    """Lines as comments, wrapped, then nested mappings of numbers, truth values, text and rows of numbers as YAML."""
    return "".join(f"# {part}\n" for line in lines for part in wrap(line, WIDTH)) + "".join(_lines(body, ""))


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
