r"""The law of crisp_controllers' Cartesian controller, and how it exerts equation (1) of `skillframe.skill`.

In the axes of the end-effector frame (`use_local_jacobian`), with the clipped error e and the measured twist v there,
its joint torques are J^T f with

    f = K_c e - D_c v + f_t,    K_c and D_c diagonal, f_t the target wrench                                     (1)

(src/cartesian_controller.cpp, version 1.0.0). The skill's wrench F has matrices that need not be diagonal in those
axes, and its damping acts on v_d - v. So K_c and D_c are the diagonals of its K and D in the tool's axes, and

    f_t = F - (K_c e - D_c v)                                                                                   (2)

carries the rest: couplings between axes, D v_d and the feed-forward. At the state at which F was computed the
controller exerts F itself. Between two messages the diagonals follow at the controller's own rate, and the rest is
held. A coupling k that is T late acts as a damping of -k T, some newton seconds per metre, where D has 20 and more.
"""

from __future__ import annotations

import numpy as np
from skillframe_drive.link import Spring

from skillframe.frames import Float, Pose, pose_error, rotate_spatial

CLIP = np.array([0.1, 0.1, 0.1, 0.5, 0.5, 0.5])
"""Largest error [m, rad]: the controller's default."""
MOST = 5000.0
"""Largest stiffness and damping that the controller's parameters take [SI units]."""
AXES = [f"{group}_{axis}" for group in ("pos", "rot") for axis in "xyz"]
CLIPS = ["x", "y", "z", "rx", "ry", "rz"]


def diagonal(matrix: Float, rotation: Float) -> Float:
    """Diagonal (6,) of a matrix (6, 6) in base axes, in the axes of `rotation` (3, 3)."""
    turn = np.kron(np.eye(2), rotation)
    result: Float = np.einsum("ai,ab,bi->i", turn, matrix, turn)
    return result


def exerted(desired: Pose, measured: Pose, twist: Float, stiffness: Float, damping: Float) -> Float:
    """Wrench (6,) of equation (1) without the target wrench, in the tool's axes.

    Poses are (1,) in base, the twist (6,) is in base axes, stiffness and damping (6,) are diagonals.
    """
    back = np.swapaxes(measured.rotation, -1, -2)
    error = np.clip(rotate_spatial(back, pose_error(desired, measured))[0], -CLIP, CLIP)
    result: Float = stiffness * error - damping * rotate_spatial(back, twist[None])[0]
    return result


def target_wrench(command: Spring, stiffness: Float, damping: Float) -> Float:
    """The target wrench (6,) of equation (2), in the tool's axes."""
    back = np.swapaxes(command.measured.rotation, -1, -2)
    whole = rotate_spatial(back, command.wrench[None])[0]
    result: Float = whole - exerted(command.desired, command.measured, command.twist, stiffness, damping)
    return result


def parameters(stiffness: Float, damping: Float) -> dict[str, bool | float | str]:
    """Parameters of the controller for diagonals (6,) of stiffness and damping.

    The null space is damped alone. Its damping has to be given: the default of -1, which should stand for critical
    damping, is taken as it is by version 1.0.0.
    """
    values: dict[str, bool | float | str] = {}
    values.update({f"task.k_{axis}": float(value) for axis, value in zip(AXES, stiffness, strict=True)})
    values.update({f"task.d_{axis}": float(value) for axis, value in zip(AXES, damping, strict=True)})
    values.update({f"task.error_clip.{axis}": float(value) for axis, value in zip(CLIPS, CLIP, strict=True)})
    values.update({"nullspace.stiffness": 0.0, "nullspace.damping": 2.0, "nullspace.projector_type": "dynamic"})
    values.update({"use_local_jacobian": True, "use_operational_space": False, "limit_error": True})
    values["filter.target_pose"] = 0.1  # the least smoothing
    return values
