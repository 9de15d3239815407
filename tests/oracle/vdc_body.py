"""Regressor and mass matrix of a rigid body over arrays; the product writes them as expressions (`law.vdc_body`)."""

from __future__ import annotations

import numpy as np
from skillframe_hydraulics.law.vdc_body import PARAMETERS

from skillframe.frames import Float, cross, skew


def moment_matrix(w: Float) -> Float:
    """L (..., 3, 6) with I w = L(w) (Ixx, Ixy, Iyy, Ixz, Iyz, Izz)."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    o = np.zeros_like(x)
    rows = [[x, y, o, z, o, o], [o, x, y, o, z, o], [o, o, o, x, y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def regressor(rate: Float, required: Float, velocity: Float, gravity: Float) -> Float:
    """Y (..., 6, 10): net force and moment on a body are Y theta.

    Args:
        rate: dV_r/dt (..., 6), derivative of the components in body axes.
        required: V_r (..., 6).
        velocity: V (..., 6).
        gravity: (..., 3) in body axes [m/s^2].
    """
    w, v_r, w_r, turn = velocity[..., 3:], required[..., :3], required[..., 3:], rate[..., 3:]
    linear = rate[..., :3] - gravity + cross(w, v_r)
    y = np.zeros((*linear.shape[:-1], 6, PARAMETERS))
    y[..., :3, 0] = linear
    y[..., :3, 1:4] = skew(turn) + skew(w) @ skew(w_r)
    y[..., 3:, 1:4] = -skew(linear)
    y[..., 3:, 4:] = moment_matrix(turn) + skew(w_r) @ moment_matrix(w)
    return y


def mass_matrix(theta: Float) -> Float:
    """M (..., 6, 6) of parameters (..., 10)."""
    m, mr = theta[..., 0], theta[..., 1:4]
    xx, xy, yy, xz, yz, zz = np.moveaxis(theta[..., 4:], -1, 0)
    result = np.zeros((*m.shape, 6, 6))
    result[..., :3, :3] = m[..., None, None] * np.eye(3)
    result[..., 3:, :3] = skew(mr)
    result[..., :3, 3:] = -skew(mr)
    inertia = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1)
    result[..., 3:, 3:] = inertia.reshape(*m.shape, 3, 3)
    return result
