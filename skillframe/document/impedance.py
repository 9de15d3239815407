r"""One phase of a skill file as a moving impedance, in the axes that a controller wants.

    W = K (x_d - x) + D (v - xdot),     x_d moves with v       (equations 1 and 2)

Directions change axes by v -> R v, gains by K -> R K R^T, with R the tool's attitude in base at the start of the phase:
"base" is base axes, "tool" the axes of the tool as it stood then.

Many controllers hold one number per axis. The nearest such stiffness keeps the eigenvalues of K and gives them to the
axes in the order of K's diagonal. Its distance in the largest singular value, over the largest eigenvalue, is the sine
of the angle between the learned axes and the controller's (for eigenvalues that are all 0 or k, as LMC's are); ours.
"""

from __future__ import annotations

import numpy as np

from skillframe.document.frame import read_frame
from skillframe.errors import InputError
from skillframe.extend.outputs import Axes
from skillframe.extend.records import Document, MovingImpedance
from skillframe.frames import Float

PARTS = ("translation", "rotation")
MOST_OFF = np.deg2rad(15.0)  # a compliant axis farther from a controller's axis is another skill


def moving_impedance(
    document: Document, number: int | None, axes: Axes, attitude: Float | None, where: str
) -> MovingImpedance:
    """A phase of a skill document, in the axes wanted.

    Args:
        document: a checked skill document.
        number: which phase, counted from 1; None if there is one only.
        axes: "base" or "tool".
        attitude: (3, 3) the tool's in base at the start of the phase, or None if it is not known.
        where: the file's name, for errors.

    Raises:
        InputError: no such phase, no impedance in it, or the attitude is needed and not given.
    """
    phase = _phase(document, number, where)
    frame = read_frame(document, where)
    turn = _turn(frame.axes, axes, attitude)
    blocks = np.zeros((6, 6))
    blocks[:3, :3] = blocks[3:, 3:] = turn
    return MovingImpedance(
        axes=axes,
        center=frame.center_of_compliance,
        twist=blocks @ np.concatenate([_velocity(phase[part]) for part in PARTS]),
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


def _turn(given: str, wanted: Axes, attitude: Float | None) -> Float:
    if (given == "base") == (wanted == "base"):
        return np.eye(3)
    if attitude is None:
        raise InputError(
            "--attitude", f"the skill is in {given.replace('_', ' ')} axes, the controller's are the {wanted}'s",
            "give the tool's attitude in base at the start of the phase, --attitude qx,qy,qz,qw",
        )  # fmt: skip
    return attitude if wanted == "base" else attitude.T


def _velocity(part: Document) -> Float:
    direction = part["desired_direction"]
    return np.zeros(3) if direction is None else float(part["speed"]) * np.array(direction, dtype=float)


def _turned(phase: Document, key: str, blocks: Float) -> Float:
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = phase["translation"][key], phase["rotation"][key]
    turned: Float = blocks @ matrix @ blocks.T
    return turned


def per_axis(matrix: Float) -> tuple[Float, float]:
    """One number per axis (3,) for a symmetric matrix (3, 3), and how far its axes are from the matrix's [rad]."""
    values = np.linalg.eigvalsh(matrix)
    result = np.empty(3)
    result[np.argsort(np.diag(matrix), kind="stable")] = np.where(values < 1e-9 * values[-1], 0.0, values)
    if values[-1] <= 0.0:
        return np.zeros(3), 0.0
    off = np.linalg.norm(matrix - np.diag(result), 2) / values[-1]
    return result, float(np.arcsin(min(off, 1.0)))
