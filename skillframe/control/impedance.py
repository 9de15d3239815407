r"""Cartesian impedance, equation (1) of the overview paper with the damping sign that dissipates.

    F = K (x_d - x) + D (v_d - v) + F_ff,    x: position and attitude of the centre of compliance

The attitude error is the rotation vector of R_d R^T in base axes. As printed, "+ D v" would only dissipate for a
negative D; here D acts on desired minus measured twist and is positive definite. Critical damping is designed from the
task-space inertia L = (J M^-1 J^T)^-1 by D = 2 zeta L^(1/2) (L^(-1/2) K L^(-1/2))^(1/2) L^(1/2), the matrix form of
d = 2 zeta sqrt(k m), with a floor so that compliant axes (K = 0) are damped too (the floor is ours).
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float, Pose, rotation_vector

DAMPING_FLOOR = (20.0, 0.3)
"""Least damping along any axis [Ns/m, Nms/rad]; ours, from lmc trials with a 2.6 kg tool."""


def pose_error(desired: Pose, measured: Pose) -> Float:
    """Desired minus measured as (N, 6): metres, then the rotation vector of R_d R^T, both in base axes."""
    turn = desired.rotation @ np.swapaxes(measured.rotation, -1, -2)
    return np.concatenate([desired.position - measured.position, rotation_vector(turn)], axis=-1)


def impedance_wrench(
    desired: Pose, measured: Pose, twist_error: Float, stiffness: Float, damping: Float, feedforward: Float
) -> Float:
    """Equation (1): the wrench (N, 6) of the robot on its tool at the centre of compliance, base axes.

    Args:
        desired: pose of the centre of compliance that the skill wants.
        measured: pose that the sensors give.
        twist_error: (N, 6) desired minus measured twist.
        stiffness: (N, 6, 6) or (6, 6).
        damping: same.
        feedforward: (N, 6).
    """
    error = pose_error(desired, measured)
    wrench: Float = (stiffness @ error[..., None])[..., 0] + (damping @ twist_error[..., None])[..., 0] + feedforward
    return wrench


def task_inertia(jacobian: Float, mass_matrix: Float) -> Float:
    """Task-space inertia (N, 6, 6), Lambda = (J M^-1 J^T + eps)^-1. `eps` keeps singular postures finite."""
    mobility = jacobian @ np.linalg.solve(mass_matrix, np.swapaxes(jacobian, -1, -2))
    inertia: Float = np.linalg.inv(mobility + 1e-6 * np.eye(6)).astype(np.float64, copy=False)
    return 0.5 * (inertia + np.swapaxes(inertia, -1, -2))


def critical_damping(
    stiffness: Float, inertia: Float, ratio: float = 1.0, floor: tuple[float, float] = DAMPING_FLOOR
) -> Float:
    """Damping matrices (N, 6, 6) of a damping ratio for a stiffness and task inertia, with a floor.

    The translational and rotational parts are designed apart (the block diagonal of Lambda), so that the axes of each
    keep their meaning; the floor raises eigenvalues below it.

    Args:
        stiffness: (N, 6, 6) or (6, 6).
        inertia: (N, 6, 6) task-space inertia.
        ratio: zeta, 1 is critical.
        floor: least eigenvalue of the translational [Ns/m] and rotational [Nms/rad] part.
    """
    shape = np.broadcast_shapes(stiffness.shape, inertia.shape)
    damping = np.zeros(shape)
    for part, least in ((slice(0, 3), floor[0]), (slice(3, 6), floor[1])):
        k = np.broadcast_to(stiffness, shape)[..., part, part]
        half, inverse_half = _square_roots(inertia[..., part, part])
        core = _matrix_sqrt(inverse_half @ k @ inverse_half)
        damping[..., part, part] = _raise_to(2.0 * ratio * half @ core @ half, least)
    return damping


def raised_damping(damping: Float, floor: tuple[float, float]) -> Float:
    """Given damping (..., 6, 6), its symmetric translational and rotational parts raised to a floor. Couplings stay.

    Args:
        damping: (6, 6) or (N, 6, 6).
        floor: least eigenvalue of the translational [Ns/m] and rotational [Nms/rad] part.
    """
    result = damping.copy()
    for part, least in ((slice(0, 3), floor[0]), (slice(3, 6), floor[1])):
        result[..., part, part] = _raise_to(damping[..., part, part], least)
    return result


def _eigen(matrix: Float) -> tuple[Float, Float]:
    """Eigenvalues (..., n) and vectors (..., n, n). NaN for a matrix that is not finite, as of a trial that diverged.

    LAPACK would refuse such a matrix, and with it every other of the batch.
    """
    sound = np.asarray(np.isfinite(matrix).all(axis=(-1, -2)))
    value, vector = np.linalg.eigh(np.where(sound[..., None, None], matrix, np.eye(matrix.shape[-1])))
    return np.where(sound[..., None], value, np.nan), np.where(sound[..., None, None], vector, np.nan)


def _square_roots(matrix: Float) -> tuple[Float, Float]:
    value, vector = _eigen(matrix)
    root = np.sqrt(np.maximum(value, 1e-12))
    turned = np.swapaxes(vector, -1, -2)
    return (vector * root[..., None, :]) @ turned, (vector / root[..., None, :]) @ turned


def _matrix_sqrt(matrix: Float) -> Float:
    value, vector = _eigen(0.5 * (matrix + np.swapaxes(matrix, -1, -2)))
    result: Float = (vector * np.sqrt(np.maximum(value, 0.0))[..., None, :]) @ np.swapaxes(vector, -1, -2)
    return result


def _raise_to(matrix: Float, least: float) -> Float:
    value, vector = _eigen(0.5 * (matrix + np.swapaxes(matrix, -1, -2)))
    result: Float = (vector * np.maximum(value, least)[..., None, :]) @ np.swapaxes(vector, -1, -2)
    return result


def null_space_damping(jacobian: Float, mass_matrix: Float, damping: float) -> Float:
    """Matrices (N, nv, nv) that turn joint velocities into damping torques without any effect on the task.

    With the dynamically consistent inverse Jbar = M^-1 J^T Lambda, the torque is -d N M N' q' with N = 1 - J^T Jbar^T,
    so that J M^-1 tau = 0 (Khatib 1987); `damping` d is in 1/s. Zero for robots without redundancy.
    """
    transposed = np.swapaxes(jacobian, -1, -2)
    solved = np.linalg.solve(mass_matrix, transposed)  # M^-1 J^T
    inertia = np.linalg.inv(jacobian @ solved + 1e-9 * np.eye(6))
    projector = np.eye(mass_matrix.shape[-1]) - transposed @ inertia @ np.swapaxes(solved, -1, -2)
    result: Float = -damping * projector @ mass_matrix @ np.swapaxes(projector, -1, -2)
    return result
