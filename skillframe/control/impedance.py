r"""Cartesian impedance, equation (1) of the overview paper, with the damping sign that dissipates.

    F = K (x_d - x) + D (v_d - v) + F_ff,    x: position and orientation of the centre of compliance

The orientation error is the rotation vector of R_d R^T in base axes. The printed "+ D v" dissipates only for a negative
D; here D is positive definite and acts on desired minus measured twist. Critical damping uses the task-space inertia
L = (J M^-1 J^T)^-1: D = 2 zeta L^(1/2) (L^(-1/2) K L^(-1/2))^(1/2) L^(1/2), the matrix form of d = 2 zeta sqrt(k m).
A floor damps compliant axes (K = 0) too.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float, Pose, pose_error

DAMPING_FLOOR = (20.0, 0.3)
"""Least damping along any axis [Ns/m, Nms/rad], chosen for a 2.6 kg tool."""


def impedance_wrench(
    desired: Pose, measured: Pose, twist_error: Float, stiffness: Float, damping: Float, feedforward: Float
) -> Float:
    """Wrench (N, 6) of the robot on its tool at the centre of compliance, base axes, by equation (1).

    Twist error and feed-forward are (N, 6); stiffness and damping are (6, 6) or (N, 6, 6).
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
    """Damping matrices (N, 6, 6) for a damping ratio, a stiffness (..., 6, 6) and a task inertia (N, 6, 6).

    Translation and rotation are designed separately, from the diagonal blocks of Lambda. `floor` is the least
    eigenvalue of each [Ns/m, Nms/rad].
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
    """Damping (..., 6, 6) with its translational and rotational blocks raised to a floor [Ns/m, Nms/rad]."""
    result = damping.copy()
    for part, least in ((slice(0, 3), floor[0]), (slice(3, 6), floor[1])):
        result[..., part, part] = _raise_to(damping[..., part, part], least)
    return result


def _eigen(matrix: Float) -> tuple[Float, Float]:
    """Eigenvalues (..., n) and vectors (..., n, n), NaN for a matrix that is not finite.

    LAPACK would otherwise fail for the whole batch because of one diverged trial.
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
    """Matrices (N, nv, nv) that turn joint velocities into damping torques without effect on the task.

    With Jbar = M^-1 J^T Lambda and N = 1 - J^T Jbar^T, the torque is -d N M N' q', so that J M^-1 tau = 0 (Khatib
    1987). `damping` d is in 1/s. The matrices are zero for robots without redundancy.
    """
    transposed = np.swapaxes(jacobian, -1, -2)
    solved = np.linalg.solve(mass_matrix, transposed)  # M^-1 J^T
    inertia = np.linalg.inv(jacobian @ solved + 1e-9 * np.eye(6))
    projector = np.eye(mass_matrix.shape[-1]) - transposed @ inertia @ np.swapaxes(solved, -1, -2)
    result: Float = -damping * projector @ mass_matrix @ np.swapaxes(projector, -1, -2)
    return result
