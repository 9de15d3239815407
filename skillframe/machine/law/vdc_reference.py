r"""Virtual Decomposition Control, required velocities: where the tool should go, and how it gives way.

Cartesian, free motion and first-order impedance with the force f of the environment on the tool (desired force f_d):

    X_r' = X_d' + Lambda (X_d - X) + D^-1 (f - f_d),    Lambda = D^-1 K in contact,

which makes D (X' - X_d') + K (X - X_d) = f - f_d when the velocity follows. J. Koivumaki and J. Mattila,
"Stability-Guaranteed Impedance Control of Hydraulic Robotic Manipulators", IEEE/ASME T-Mech 22(2), 2017: first order,
no desired inertia; the signs are ours, f is the force of the environment on the tool.
Joints that the Cartesian rows leave open follow a path of their own: zd_r = zd_d + lambda (z_d - z). Together the rows
are a square task Jacobian J_t, and zd_r = J_t^-1 X_r', zdd_r = J_t^-1 (X_r'' - dJ_t/dt zd_r).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.law.doubt import left_undone
from skillframe.robot.chain import ChainState, ClosedChain
from skillframe.robot.symbolic import Expression, SymbolicChain


class ToolTask:
    """Which n quantities are commanded: axes of the tool's position in base, then independent joints.

    Args:
        chain: the machine.
        axes: of base, 0 to 2; for the crane (0, 2).
        joints: names of independent joints; for the crane ("extension",).

    Raises:
        InputError: not as many rows as freedoms, or a joint that is not independent.
    """

    def __init__(self, chain: ClosedChain, axes: Sequence[int], joints: Sequence[str]) -> None:
        wrong = [name for name in joints if name not in chain.independent]
        if wrong or len(axes) + len(joints) != len(chain.independent):
            text = (
                f"{len(axes)} axes and the joints {', '.join(joints) or 'none'} do not command {len(chain.independent)}"
            )
            raise InputError("task", f"{text} freedoms", f"choose joints among {', '.join(chain.independent)}")
        self._frame = chain.robot.tool_frames[0]
        self.axes = list(axes)
        self._joints = [chain.independent.index(name) for name in joints]

    def position(self, state: ChainState) -> Float:
        """(n,) where the rows are."""
        tool = np.array(state.data.oMf[self._frame].translation)
        return np.concatenate([tool[self.axes], state.z[self._joints]])

    def jacobian(self, state: ChainState) -> Float:
        """J_t (n, n)."""
        return np.concatenate([state.jacobian(self._frame)[self.axes], np.eye(len(state.z))[self._joints]])

    def drift(self, state: ChainState, rate: Float) -> Float:
        """Rate of J_t times a rate (n,)."""
        return np.concatenate([state.jacobian_drift(self._frame, rate)[self.axes], np.zeros(len(self._joints))])

    def solve(self, chain: ClosedChain, position: Float, start: Float) -> Float:
        """Minimal coordinates (n,) that put the rows at a position (n,), by Newton's rule from a start near them.

        Raises:
            InputError: it does not converge; the position is out of reach or at a singular pose.
        """
        z = np.array(start, dtype=float)
        for _ in range(20):
            state = chain.at(z, np.zeros(len(z)))
            left = position - self.position(state)
            if np.abs(left).max() < 1e-12:
                return z
            z = z + np.linalg.solve(self.jacobian(state), left)
        if np.abs(left).max() < 1e-9:
            return z
        place = ", ".join(f"{x:.3f}" for x in position)
        raise InputError("task", f"the machine does not reach ({place})", "choose a nearer position or start")

    def generalised(self, state: ChainState, force: Float) -> Float:
        """(n,) generalised forces of a force (3,) of the environment on the tool, base axes."""
        result: Float = state.jacobian(self._frame)[:3].T @ force
        return result


def required_motion(
    s: SymbolicChain, tip: Expression, reference: list[Expression], force: tuple[Expression, Expression],
    joint_gain: Expression,
) -> tuple[Expression, Expression]:  # fmt: skip
    """Required rates zd_r and their derivative zdd_r (n,) of one trial, equation (1) of `hydraulic`.

    Args:
        s: the chain.
        tip: position of the tool's point in its plane (2,) [m].
        reference: the fields of `Reference`, as vectors row by row.
        force: of the environment on the tool (2,) and its standard deviation [N].
        joint_gain: lambda [1/s].
    """
    position, velocity, stiffness, damping, push, joint, joint_rate, given = reference
    n = s.z.shape[0]
    k, d = (ca.reshape(x, 2, 2).T for x in (stiffness, damping))
    inverse = ca.inv(d)
    lead = ca.diagcat(inverse @ k, joint_gain * ca.SX.eye(n - 2))
    at, wanted = ca.vertcat(tip, s.z[2:]), ca.vertcat(position, joint)
    pushing = force[0] + push
    imbalance = d @ velocity + k @ (position - tip) + pushing
    pushing = pushing - left_undone(imbalance, *force) * imbalance
    ahead, pushed = ca.vertcat(velocity, joint_rate), ca.vertcat(inverse @ pushing, ca.SX(n - 2, 1))
    jacobian = ca.jacobian(at, s.z)
    rate = ca.solve(jacobian, ahead + lead @ (wanted - at) + pushed)
    acceleration = given + lead @ (ahead - jacobian @ s.zd) - s.drift_of(jacobian, rate)
    return rate, ca.solve(jacobian, acceleration)
