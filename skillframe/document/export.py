r"""Settings for controllers of other projects: parameters and messages as YAML, with the rest in comments.

Sources: the parameter declarations of crisp_controllers' `CartesianController` (cartesian_controller.yaml), the code of
cartesian_controllers' `CartesianComplianceController` and its two bases, and aic_control_interfaces' `MotionUpdate.msg`
and `TrajectoryGenerationMode.msg` with aic_controller's documentation. Each record names the version that it was
checked against (`skillframe.extend.builtin`). No export was run on its controller: try it in free air first.

One phase of a skill file as a moving impedance, in a controller's axes.

  W = K (x_d - x) + D (v - xdot),     x_d moves with v       (equations 1 and 2)

Directions change axes by v -> R v, gains by K -> R K R^T, with R the tool's orientation in base at the start of the
phase: "base" is base axes, "tool" the axes of the tool at that moment.

Many controllers hold one number per axis. The nearest such stiffness assigns the eigenvalues of K to the axes in the
order of K's diagonal. Its distance in the largest singular value, over the largest eigenvalue, is the sine of the angle
between the learned axes and the controller's (for eigenvalues that are all 0 or k, as LMC's are).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from skillframe.document.frame import read_frame
from skillframe.errors import InputError, SkillframeError
from skillframe.extend.outputs import Axes, ExporterType, MovingImpedance
from skillframe.extend.plugin import BadPlugin
from skillframe.extend.records import Document
from skillframe.frames import Float

DIRECTIONS = ("x", "y", "z")


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
    "the axes of ft_sensor_ref_link: without it nothing is compliant. Leave target_wrench at zero.",
)
MOTION_UPDATE = (
    "Publish it on /aic_controller/pose_commands, with the controller in its Cartesian target mode.",
    "In velocity mode nothing limits how far the target leads a blocked tool: end the phase in time.",
)


def crisp(phase: MovingImpedance, lines: Sequence[str]) -> str:
    """Parameters of crisp_controllers/CartesianController: one stiffness per base axis, errors clipped to the lead."""
    task: dict[str, Any] = {}
    clip: dict[str, float] = {}
    for part, short, prefix, lead, at in _parts(phase):
        k, d = _gains(phase, at)
        values = np.concatenate([k, d])
        if values.max() > 5000.0:  # crisp's limit of stiffness and damping
            raise InputError(
                f"skill: {part}", f"holds a stiffness or damping of {values.max():g}, and crisp_controllers takes "
                "5000 at most", "learn with a smaller --set stiffness_n_m or stiffness_nm_rad",
            )  # fmt: skip
        for axis, stiffness, damping in zip(DIRECTIONS, k.tolist(), d.tolist(), strict=True):
            task[f"k_{short}_{axis}"], task[f"d_{short}_{axis}"] = stiffness, damping
            open_ = 0.1 if part == "translation" else 0.5  # crisp's defaults [m, rad]
            clip[prefix + axis] = lead / stiffness if stiffness > 0.0 else open_
    fixed = {"use_operational_space": False, "use_local_jacobian": False, "limit_error": True}
    body = {"cartesian_controller": {"ros__parameters": {**fixed, "task": {**task, "error_clip": clip}}}}
    return yaml_text([*lines, *CRISP], body)


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
    """A message aic_control_interfaces/MotionUpdate in velocity mode: whole matrices in the robot's base."""
    zero = _vector(np.zeros(3))
    body = {
        "header": {"frame_id": "base_link"},
        "velocity": {"linear": _vector(phase.twist[:3]), "angular": _vector(phase.twist[3:])},
        "target_stiffness": phase.stiffness.reshape(-1).tolist(),
        "target_damping": phase.damping.reshape(-1).tolist(),
        "feedforward_wrench_at_tip": {"force": zero, "torque": zero},
        "wrench_feedback_gains_at_tip": [0.0] * 6,
        "trajectory_generation_mode": {"mode": 1},
    }
    return yaml_text([*lines, *MOTION_UPDATE], body)


def exported(exporter: ExporterType, phase: MovingImpedance, words: Sequence[str]) -> str:
    """The text of a settings file.

    Raises: as `written`.
    """
    stops = ", ".join(f"{key} {value:g}" for key, value in sorted(phase.stop.items()) if "lead" not in key)
    about = [
        *words,
        f"axes: {phase.axes}; centre of compliance {_numbers(phase.center)} m in the tool frame",
        f"twist of the desired pose: {_numbers(phase.twist)} m/s, rad/s",
        f"lead: {phase.lead_force:g} N, {phase.lead_torque:g} Nm at most",
        f"the phase ends with: {stops}",
    ]
    return written(exporter, phase, about=about)


def written(exporter: ExporterType, *given: Any, about: Sequence[str]) -> str:
    """The text that an exporter makes of what it is given, and of lines about it.

    Raises:
        InputError: the controller cannot hold the skill's compliance.
        BadPlugin: the exporter fails otherwise, or returns no text.
    """
    lines = [exporter.summary, *about, f"checked against {exporter.checked}", *exporter.notes]
    try:
        text: object = exporter.write(*given, lines)
    except SkillframeError:
        raise
    except Exception as error:  # a plug-in's code
        problem = f"raised {type(error).__name__}: {error}"
        raise BadPlugin(
            f"exporter {exporter.name}: {problem}; report this to its author, or export to another format"
        ) from error
    if not isinstance(text, str) or not text:
        raise BadPlugin(
            f"exporter {exporter.name}: gave {text!r:.60}, not the text of a file; report this to its author"
        )
    return text


def yaml_text(lines: Sequence[str], body: Mapping[str, Any]) -> str:
    """Lines as wrapped comments, followed by nested mappings as YAML."""
    return "".join(f"# {part}\n" for line in lines for part in wrap(line, 110)) + "".join(_lines(body, ""))


def _parts(phase: MovingImpedance) -> list[tuple[str, str, str, float, int]]:
    return [("translation", "pos", "", phase.lead_force, 0), ("rotation", "rot", "r", phase.lead_torque, 3)]


def _gains(phase: MovingImpedance, at: int) -> tuple[Float, Float]:
    """Stiffness and damping per axis (3,)."""
    block = slice(at, at + 3)
    stiffness, off = per_axis(phase.stiffness[block, block])
    if off > np.deg2rad(15.0):  # the compliant axis would be that of another skill
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


PARTS = ("translation", "rotation")


def moving_impedance(
    document: Document, number: int | None, axes: Axes, orientation: Float | None, where: str
) -> MovingImpedance:
    """A phase of a skill document in some axes.

    Args:
        document: a checked skill document.
        number: of the phase, counted from 1; None if there is only one.
        axes: "base" or "tool".
        orientation: (3, 3) the tool's orientation in base at the start of the phase, or None if unknown.
        where: the file's name, for errors.

    Raises:
        InputError: no such phase, no impedance in it, or a missing orientation.
    """
    phase = _phase(document, number, where)
    frame = read_frame(document, where)
    turn: Float = np.eye(3)
    if (frame.axes == "base") != (axes == "base"):
        if orientation is None:
            raise InputError(
                "--orientation",
                f"the skill is in {frame.axes.replace('_', ' ')} axes, the controller's are the {axes}'s",
                "give the tool's orientation in base at the start of the phase, --orientation qx,qy,qz,qw",
            )  # fmt: skip
        turn = orientation if axes == "base" else orientation.T
    twist = np.zeros(6)
    for part, rows in zip(PARTS, (slice(0, 3), slice(3, 6)), strict=True):
        direction = phase[part]["desired_direction"]
        if direction is not None:
            twist[rows] = float(phase[part]["speed"]) * np.array(direction, dtype=float)
    blocks = np.zeros((6, 6))
    blocks[:3, :3] = blocks[3:, 3:] = turn
    return MovingImpedance(
        axes=axes,
        center=frame.center_of_compliance,
        twist=blocks @ twist,
        stiffness=_turned(phase, "stiffness", blocks),
        damping=_turned(phase, "damping", blocks),
        lead_force=float(phase["stop"]["lead_force_n"]),
        lead_torque=float(phase["stop"]["lead_torque_nm"]),
        stop=phase["stop"],
    )


def _phase(document: Document, number: int | None, where: str) -> Document:
    phases = document["phases"]
    if number is None and len(phases) != 1:
        raise InputError(where, f"has {len(phases)} phases", f"choose one of them with --phase 1 ... {len(phases)}")
    if number is not None and not 1 <= number <= len(phases):
        raise InputError("--phase", f"there is no phase {number}", f"{where} has {len(phases)}, counted from 1")
    phase: Document = phases[(number or 1) - 1]
    gains = ("stiffness", "damping", "speed", "desired_direction")
    if not all(isinstance(phase.get(p), dict) and all(key in phase[p] for key in gains) for p in PARTS) or not all(
        key in phase.get("stop", {}) for key in ("lead_force_n", "lead_torque_nm")
    ):
        raise InputError(
            where, f"a skill of type {document['type']} holds no moving impedance in this phase",
            "export a skill of type lmc, or such a phase of a policy",
        )  # fmt: skip
    return phase


def _turned(phase: Document, key: str, blocks: Float) -> Float:
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = phase["translation"][key], phase["rotation"][key]
    turned: Float = blocks @ matrix @ blocks.T
    return turned


def per_axis(matrix: Float) -> tuple[Float, float]:
    """One number per axis (3,) for a symmetric matrix (3, 3), and the angle between its axes and the matrix's [rad]."""
    values = np.linalg.eigvalsh(matrix)
    result = np.empty(3)
    result[np.argsort(np.diag(matrix), kind="stable")] = np.where(values < 1e-9 * values[-1], 0.0, values)
    if values[-1] <= 0.0:
        return np.zeros(3), 0.0
    off = np.linalg.norm(matrix - np.diag(result), 2) / values[-1]
    return result, float(np.arcsin(min(off, 1.0)))
