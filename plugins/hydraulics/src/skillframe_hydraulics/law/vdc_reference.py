r"""Virtual Decomposition Control, required velocities: motion and compliance of the tool.

Free motion and first-order impedance with the force f of the environment on the tool (desired force f_d):

    X_r' = X_d' + Lambda (X_d - X) + D^-1 (f - f_d),    Lambda = D^-1 K in contact,

so that D (X' - X_d') + K (X - X_d) = f - f_d if the velocity follows. J. Koivumaki and J. Mattila,
"Stability-Guaranteed Impedance Control of Hydraulic Robotic Manipulators", IEEE/ASME T-Mech 22(2), 2017, with the sign
of f changed. Free joints follow zd_r = zd_d + lambda (z_d - z). All rows form a square task Jacobian J_t, and zd_r =
J_t^-1 X_r', zdd_r = J_t^-1 (X_r'' - dJ_t/dt zd_r).

While contact force and piston stiction cannot be distinguished, the force's uncertainty sigma attenuates the motion:

    D X_r' = T (1 - s / (1 + p)),    T = D X_d' + K (X_d - X) + f + f_ff
    s = a / (1 + a),  a = (sum of (f_i / 2 sigma_i)^2)^2,    p = (sum of (T_i / 1.5 sigma_i)^2)^4

In contact (s = 1) the tool does not move for an imbalance T within sigma. Otherwise pistons stick, the estimate takes
stiction for force, T reverses, and a crane pressing into a corner hunts by hundreds of newtons. The eighth power keeps
a slide at 0.1 m/s within 0.1 % of the target dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot import ChainState, ClosedChain, OutOfReach
from skillframe_hydraulics.law.symbolic_chain import Expression, SymbolicChain
from skillframe_hydraulics.symbolic_or_numeric import maximum, square_sum

WIDEST = 0.5
"""Largest step of Newton's rule towards a place [rad or m]; longer ones turn a joint around."""


def swung_by(chain: ClosedChain) -> bool:
    """Whether passive joints swing the tool."""
    state = chain.at(chain.minimal(chain.home), np.zeros(len(chain.free)))
    swing: Float = state.jacobian(chain.robot.tool_frames[0])[:3, chain.steered :]
    return bool(np.abs(swing).max(initial=0.0) > 1e-9)


class ToolTask:
    """The n commanded quantities: axes of the tool's position in base, then independent joints.

    A tool that swings on passive joints is commanded to where it hangs at rest.

    Args:
        chain: the machine.
        axes: (m, 3) of the tool's position in base; for the crane x and z.
        joints: names of independent joints; for the crane ("extension",).

    Raises:
        InputError: not as many rows as freedoms, or a joint that is not independent.
    """

    def __init__(self, chain: ClosedChain, axes: Float, joints: Sequence[str]) -> None:
        wrong = [name for name in joints if name not in chain.independent]
        if wrong or len(axes) + len(joints) != len(chain.independent):
            text = (
                f"{len(axes)} axes and the joints {', '.join(joints) or 'none'} do not command {len(chain.independent)}"
            )
            raise InputError("task", f"{text} freedoms", f"choose joints among {', '.join(chain.independent)}")
        self._frame, self._chain = chain.robot.tool_frames[0], chain
        self._swung = swung_by(chain)
        self.axes: Float = np.asarray(axes, dtype=float)
        self._joints = [chain.independent.index(name) for name in joints]

    def position(self, state: ChainState) -> Float:
        """Position of the rows (n,)."""
        tool = np.array(self._hung(state).data.oMf[self._frame].translation)
        return np.concatenate([self.axes @ tool, state.z[self._joints]])

    def _hung(self, state: ChainState) -> ChainState:
        return self._chain.at(self._chain.settled(state.z), 0.0 * state.zd) if self._swung else state

    def jacobian(self, state: ChainState) -> Float:
        """J_t (n, n)."""
        moved, still = self._hung(state), np.eye(len(state.z))
        if self._swung:  # the passive joints follow so that their weights' moments stay zero
            s, h = self._chain.steered, 1e-5
            pairs = [
                (self._chain.at(moved.z + h * way, moved.zd), self._chain.at(moved.z - h * way, moved.zd))
                for way in still
            ]
            slope = np.array([(one.gravity[s:] - other.gravity[s:]) / (2.0 * h) for one, other in pairs]).T
            still[s:] = np.hstack([-np.linalg.solve(slope[:, s:], slope[:, :s]), np.zeros((len(slope), len(slope)))])
        return np.concatenate([self.axes @ moved.jacobian(self._frame)[:3] @ still, np.eye(len(state.z))[self._joints]])

    def drift(self, state: ChainState, rate: Float) -> Float:
        """Rate of J_t times a rate (n,)."""
        drift = self.axes @ state.jacobian_drift(self._frame, rate)[:3]
        return np.concatenate([drift, np.zeros(len(self._joints))])

    def solve(self, chain: ClosedChain, position: Float, start: Float) -> Float:
        """Minimal coordinates (n,) for a position (n,) of the rows, by Newton's rule from `start`.

        Raises:
            InputError: no convergence: out of reach or singular.
        """
        z, left = np.array(start, dtype=float), np.full(len(position), np.inf)
        for _ in range(40):
            try:
                state = chain.at(z, np.zeros(len(z)))
            except OutOfReach:
                break
            left = position - self.position(state)
            if np.abs(left).max() < 1e-12:
                return z
            step = np.linalg.solve(self.jacobian(state), left)
            z = z + step * WIDEST / max(float(np.abs(step).max()), WIDEST)
        if np.abs(left).max() < 1e-9:
            return z
        place = ", ".join(f"{x:.3f}" for x in position)
        fix = "choose a nearer start or workspace.fixture: skillframe robots ROBOT --check states the working range"
        raise InputError("task", f"the machine does not reach ({place})", fix)

    def generalised(self, state: ChainState, force: Float) -> Float:
        """Generalised forces (n,) of a force (3,) of the environment on the tool, base axes."""
        result: Float = state.jacobian(self._frame)[:3].T @ force
        return result


def required_motion(
    s: SymbolicChain, tip: Expression, reference: list[Expression], force: tuple[Expression, Expression],
    joint_gain: Expression,
) -> tuple[Expression, Expression]:  # fmt: skip
    """Required rates zd_r and their derivative zdd_r (n,) of one trial, equation (1) of `hydraulic`.

    `tip` is the tool's position along its axes (m,) [m], `reference` the fields of `Reference` row by row, `force` that
    of the environment (m,) with its standard deviation [N], `joint_gain` lambda [1/s].
    """
    position, velocity, stiffness, damping, push, joint, joint_rate, given = reference
    n, m = s.zd.shape[0], tip.shape[0]
    k, d = (ca.reshape(x, m, m).T for x in (stiffness, damping))
    inverse = ca.inv(d)
    lead = ca.diagcat(inverse @ k, joint_gain * ca.SX.eye(n - m))
    at, wanted = ca.vertcat(tip, s.z[m:]), ca.vertcat(position, joint)
    pushing = force[0] + push
    imbalance = d @ velocity + k @ (position - tip) + pushing
    pushing = pushing - left_undone(imbalance, *force) * imbalance
    ahead, pushed = ca.vertcat(velocity, joint_rate), ca.vertcat(inverse @ pushing, ca.SX(n - m, 1))
    jacobian = s.by_z(at)
    rate = ca.solve(jacobian, ahead + lead @ (wanted - at) + pushed)
    acceleration = given + lead @ (ahead - jacobian @ s.zd) - s.drift_of(jacobian, rate)
    return rate, ca.solve(jacobian, acceleration)


def left_undone(imbalance: Any, force: Any, sigma: Any) -> Any:
    """Share s / (1 + p) of an imbalance T (..., m) [N] that is attenuated, (..., 1) from 0 to 1.

    `force` (..., m) acts on the tool, with standard deviation `sigma`. Arrays or casadi expressions.
    """
    certain = maximum(sigma, 1e-3)  # N
    touch = square_sum(force / (2.0 * certain)) ** 2
    worth = square_sum(imbalance / (1.5 * certain)) ** 4
    return touch / (1.0 + touch) / (1.0 + worth)
