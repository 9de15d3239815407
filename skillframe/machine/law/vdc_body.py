r"""Virtual Decomposition Control, one rigid body: the force it needs to move as required.

With V = (v; w) in body axes at the body's frame (linear part first), required velocity V_r, its component derivative,

    F_r = Y theta + K (V_r - V),    Y theta = M dV_r/dt + C(w) V_r + G,
    M = [[m 1, -m r_x], [m r_x, I_o]],    C(w) = [[m w_x, -m w_x r_x], [m r_x w_x, -(I_o w)_x]],    G = -M (g; 0).

W.-H. Zhu, "Virtual Decomposition Control", Springer 2010. C is skew for every w, which is what the proof of
stability needs. Zhu's C has w_x I + I w_x in the last block and needs 13 parameters; -(I_o w)_x does the same to w, is
skew, and is linear in the ten of Pinocchio's `toDynamicParameters` (our choice):
theta = (m, m r, Ixx, Ixy, Iyy, Ixz, Iyz, Izz), inertia about the body's frame.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot.symbolic import BodyMotion, Expression, Twist

PARAMETERS = 10


def parameters(model: pin.Model) -> Float:
    """Inertial parameters theta (B, 10) of a model's moving bodies."""
    return np.array([model.inertias[j].toDynamicParameters() for j in range(1, model.njoints)])


def regressor(body: BodyMotion) -> Expression:
    """Y (6, 10): net force and moment on a body are Y theta."""
    w, w_r, turn = body.velocity.angular, body.required.angular, body.rate.angular
    linear = body.rate.linear - body.gravity + ca.cross(w, body.required.linear)
    upper = ca.horzcat(linear, ca.skew(turn) + ca.skew(w) @ ca.skew(w_r), ca.SX(3, 6))
    lower = ca.horzcat(ca.SX(3, 1), -ca.skew(linear), moment_matrix(turn) + ca.skew(w_r) @ moment_matrix(w))
    return ca.vertcat(upper, lower)


def moment_matrix(w: Expression) -> Expression:
    """L (3, 6) with I w = L(w) (Ixx, Ixy, Iyy, Ixz, Iyz, Izz)."""
    x, y, z = ca.vertsplit(w)
    o = ca.SX(1, 1)
    rows = [[x, y, o, z, o, o], [o, x, y, o, z, o], [o, o, o, x, y, z]]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def inertia_times(theta: Expression, v: Twist) -> Twist:
    """M V (6,)."""
    m, mr, inertia = theta[0], theta[1:4], _moment(theta)
    return Twist(m * v.linear - ca.cross(mr, v.angular), ca.cross(mr, v.linear) + inertia @ v.angular)


def _moment(theta: Expression) -> Expression:
    xx, xy, yy, xz, yz, zz = ca.vertsplit(theta[4:10])
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))


def kinetic_energy(v: Twist, theta: Expression) -> Expression:
    """1/2 V^T M V [J]."""
    momentum = inertia_times(theta, v)
    return 0.5 * (ca.dot(v.linear, momentum.linear) + ca.dot(v.angular, momentum.angular))
