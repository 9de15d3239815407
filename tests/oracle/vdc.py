"""Virtual Decomposition Control over arrays, body by body through Pinocchio: the second opinion on the law.

The same equations as `skillframe_hydraulics.law.vdc_body`, which writes them as casadi expressions of the closed chain.
Here bodies, Jacobians and their rates are Pinocchio's, and adaptation sets a rate to zero where the product clips. An
ideal force actuator gets f_cr + k (xd_r - xd): k stands for the k_x/k_f of a cylinder's force loop (our choice), and
adds -k (xd_r - xd)^2 to the rate of the accompanying function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from skillframe_hydraulics.law.vdc_adaptation import relative_bounds
from skillframe_hydraulics.law.vdc_body import parameters

from skillframe.frames import Float
from skillframe.robot.chain import ChainState, ClosedChain
from tests.oracle.vdc_body import mass_matrix, regressor
from tests.oracle.vdc_reference import Required

PUBLISHED_BODY_GAIN = 5.0  # K = 5 times the unit matrix, N s/m and N m s/rad


def projected_rate(estimate: Float, drive: Float, gain: float, lower: Float, upper: Float) -> Float:
    """Rate of parameters (...): gain times drive, zero where it points out of the bounds at a bound."""
    outward = ((estimate >= upper) & (drive > 0.0)) | ((estimate <= lower) & (drive < 0.0))
    return np.where(outward, 0.0, gain * drive)


def adapt(estimate: Float, drive: Float, gain: float, bounds: tuple[Float, Float], dt: float) -> Float:
    """Parameters after a step of dt [s], kept within the bounds."""
    lower, upper = bounds
    return np.clip(estimate + dt * projected_rate(estimate, drive, gain, lower, upper), lower, upper)


class Reduced(NamedTuple):
    """Of a chain in minimal coordinates: M_z (n, n) and gravity's generalised forces g_z (n,)."""

    mass: Float
    gravity: Float


class Bodies(NamedTuple):
    """All moving bodies (B of them, Pinocchio's joint order), in body axes at the body's frame, linear part first.

    Attributes:
        jacobian: J_b (B, 6, nv); velocity, required: V and V_r (B, 6); rate: dV_r/dt (B, 6).
        regressor: Y (B, 6, 10); gravity: (B, 3).
        tree_required: v_r (nv,).
    """

    jacobian: Float
    velocity: Float
    required: Float
    rate: Float
    regressor: Float
    gravity: Float
    tree_required: Float

    @property
    def error(self) -> Float:
        """V_r - V (B, 6)."""
        return self.required - self.velocity


def bodies(state: ChainState, rate: Float, acceleration: Float) -> Bodies:
    """Velocities of every body for required rates and accelerations (n,) in minimal coordinates.

    With the measured rates and the true accelerations it describes how the bodies do move.
    """
    model, data, local = state.chain.model, state.data, pin.ReferenceFrame.LOCAL
    ids = range(1, model.njoints)
    jacobian = np.array([pin.getJointJacobian(model, data, j, local) for j in ids])
    drift = np.array([pin.getJointJacobianTimeVariation(model, data, j, local) for j in ids])
    v_r = state.embedding @ rate
    a_r = state.embedding @ acceleration + state.drift_of(rate)
    velocity, required, v_rate = jacobian @ state.v, jacobian @ v_r, jacobian @ a_r + drift @ v_r
    gravity = np.array([data.oMi[j].rotation.T @ model.gravity.linear for j in ids])
    y = regressor(v_rate, required, velocity, gravity)
    return Bodies(jacobian, velocity, required, v_rate, y, gravity, v_r)


def reduced(state: ChainState, theta: Float) -> Reduced:
    """Mass matrix and gravity of a chain whose bodies have inertial parameters theta (B, 10), whatever its model says.

    M_z = sum_b G^T J_b^T M_b J_b G,    g_z = -sum_b G^T J_b^T M_b (g_b; 0)
    """
    model, data, local = state.chain.model, state.data, pin.ReferenceFrame.LOCAL
    ids, inertia = range(1, model.njoints), mass_matrix(theta)
    jacobian = np.array([pin.getJointJacobian(model, data, j, local) for j in ids]) @ state.embedding
    pull = np.array([[*(data.oMi[j].rotation.T @ model.gravity.linear), 0.0, 0.0, 0.0] for j in ids])
    mass = np.einsum("bia,bij,bjc->ac", jacobian, inertia, jacobian)
    return Reduced(mass, -np.einsum("bia,bij,bj->a", jacobian, inertia, pull))


def net_forces(motion: Bodies, theta: Float, gain: Float) -> Float:
    """F_r (B, 6): Y theta + K (V_r - V) with K (6, 6) or (B, 6, 6)."""
    result: Float = (motion.regressor @ theta[..., None] + gain @ motion.error[..., None])[..., 0]
    return result


def piston_forces(state: ChainState, motion: Bodies, forces: Float, tool: Float | None = None) -> Float:
    """f_cr (actuators,) [N]; tool: generalised forces (n,) of the environment on the tool in minimal coordinates."""
    tree = np.einsum("bij,bi->j", motion.jacobian, forces) + state.chain.model.damping * motion.tree_required
    tau = state.embedding.T @ tree
    return state.actuator_force(tau if tool is None else tau - tool)


@dataclass(frozen=True, slots=True, kw_only=True)
class VdcGains:
    """Gains of the law.

    Attributes:
        body: part of K that is the same for every body [N s/m, N m s/rad].
        bandwidth: kappa [1/s] of the part kappa M_b, positive definite as the proof wants it: it makes every direction
            of the whole machine settle at one rate, which one number for bodies of 7 and of 570 kg cannot (our choice).
        piston: k of an ideal force actuator (actuators,) [N s/m].
        adaptation: rho of the bodies' parameters; 0 switches it off. share: bounds, +- of a parameter's size.
    """

    body: float = PUBLISHED_BODY_GAIN
    bandwidth: float = 0.0
    piston: Float
    adaptation: float = 0.0
    share: float = 0.3


class VdcController:
    """The law with its memory, the estimated parameters, for one machine.

    Args:
        chain: the controller's model; its inertias are where the estimate starts.
        gains: of the law.

    Attributes:
        theta: (B, 10) estimated parameters; gain: K (B, 6, 6) of the bodies.
    """

    def __init__(self, chain: ClosedChain, gains: VdcGains) -> None:
        self.chain, self.gains = chain, gains
        self.theta = parameters(chain.model)
        self.gain: Float = gains.body * np.eye(6) + gains.bandwidth * mass_matrix(self.theta)
        self._bounds = relative_bounds(self.theta, gains.share)

    def forces(self, state: ChainState, required: Required, tool: Float | None = None) -> tuple[Float, Bodies]:
        """Piston forces (actuators,) for ideal force actuators, and the bodies' motion that `learn` needs."""
        motion = bodies(state, required.rate, required.acceleration)
        needed = piston_forces(state, motion, net_forces(motion, self.theta, self.gain), tool)
        return needed + self.gains.piston * (state.arms @ required.rate - state.driven_motion[1]), motion

    def learn(self, motion: Bodies, dt: float) -> None:
        """Adapt the parameters over a step of dt [s]."""
        if self.gains.adaptation > 0.0:
            drive = np.einsum("bij,bi->bj", motion.regressor, motion.error)
            self.theta = adapt(self.theta, drive, self.gains.adaptation, self._bounds, dt)


def accompanying(motion: Bodies, true: Float, estimate: Float, gain: float) -> float:
    """Nu, 1/2 sum (V_r - V)^T M (V_r - V) + sum (theta - theta^)^2 / (2 rho), with the true parameters [J].

    Without adaptation (gain 0) the second part is left out; then it does not grow only if theta^ is true.
    """
    e = motion.error
    kinetic = 0.5 * float(np.einsum("bi,bij,bj->", e, mass_matrix(true), e))
    return kinetic + (float(np.sum((true - estimate) ** 2)) / (2.0 * gain) if gain > 0.0 else 0.0)
