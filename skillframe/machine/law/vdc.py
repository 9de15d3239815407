r"""Virtual Decomposition Control of a machine with closed chains: required piston forces, body by body.

From required rates (`vdc_reference`) every body gets its required velocity V_r = J_b G zd_r and, by `vdc_body`, the net
force F_r it needs. Virtual work resolves the closed chains (the same result as cutting them, as the tests show):

    tau = G^T (sum_b J_b^T F_r + D v_r) - J^T f,    f_cr = R^-T tau,

with f the force of the environment on the tool and D the pins' damping. W.-H. Zhu, "Virtual Decomposition Control",
Springer 2010; hydraulic manipulators: Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from skillframe.machine.law.vdc_body import regressor
from skillframe.robot.symbolic import BodyMotion, Expression, SymbolicChain


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
