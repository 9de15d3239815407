r"""Virtual Decomposition Control of rigid bodies: forces for their required motion, and those of the pistons.

With V = (v; w) in body axes at the body's frame (linear part first), required velocity V_r, its component derivative,

    F_r = Y theta + K (V_r - V),    Y theta = M dV_r/dt + C(w) V_r + G,
    M = [[m 1, -m r_x], [m r_x, I_o]],    C(w) = [[m w_x, -m w_x r_x], [m r_x w_x, -(I_o w)_x]],    G = -M (g; 0).

W.-H. Zhu, "Virtual Decomposition Control", Springer 2010. The proof of stability needs a skew C for every w. Zhu's last
block w_x I + I w_x needs 13 parameters; -(I_o w)_x acts alike on w, is skew, and is linear in the ten of Pinocchio's
`toDynamicParameters`: theta = (m, m r, Ixx, Ixy, Iyy, Ixz, Iyz, Izz), inertia about the body's frame.

Required rates (`vdc_reference`) give every body's V_r = J_b G zd_r, and so F_r. Virtual work resolves the closed
chains, equivalently to cutting them:

    tau = G^T (sum_b J_b^T F_r + D v_r) - J^T f,    f_cr = R^-T tau,

with f the force of the environment on the tool and D the damping of the pins (hydraulic manipulators: Petrovic and
Mattila, Mech. Mach. Theory 170 (2022) 104680).
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe_hydraulics.law.symbolic_chain import BodyMotion, Expression, SymbolicChain, Twist

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
    """Momentum M V (6,)."""
    m, mr, (xx, xy, yy, xz, yz, zz) = theta[0], theta[1:4], ca.vertsplit(theta[4:10])
    inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return Twist(m * v.linear - ca.cross(mr, v.angular), ca.cross(mr, v.linear) + inertia @ v.angular)


def kinetic_energy(v: Twist, theta: Expression) -> Expression:
    """Kinetic energy 1/2 V^T M V [J]."""
    momentum = inertia_times(theta, v)
    return 0.5 * (ca.dot(v.linear, momentum.linear) + ca.dot(v.angular, momentum.angular))


def needed_forces(
    s: SymbolicChain, moving: list[BodyMotion], rows: Expression, body_gain: Expression, rate: Expression
) -> tuple[Expression, list[Expression]]:
    """Generalised forces (n,) without the tool's, and Y^T (V_r - V) (10,) of every body."""
    damping = s.embedding.T @ (ca.SX(np.array(s.model.damping, dtype=float)) * (s.embedding @ rate))
    total, drive = damping, []
    for b, body in enumerate(moving):
        velocity = ca.vertcat(*body.velocity)
        error = ca.vertcat(*body.required) - velocity
        y = regressor(body)
        net = y @ rows[b, :].T + body_gain * error
        total = total + ca.jacobian(velocity, s.zd).T @ net
        drive.append(y.T @ error)
    return total, drive
