r"""The control law of a hydraulic machine: from a desired motion and an impedance to valve commands, N trials at once.

The tool follows the first-order impedance, f the force of the environment on it and f_ff the feed-forward,

    D (X' - X_d') + K (X - X_d) = f + f_ff      by      X_r' = X_d' + D^-1 [K (X_d - X) + f + f_ff]             (1)

(J. Koivumaki and J. Mattila, IEEE/ASME T-Mech 22(2), 2017) as far as the force's uncertainty lets it (`doubt`), joints
that the tool's plane leaves open follow zd_r = zd_d + lambda (z_d - z), the bodies get what `vdc` says they need, and
each cylinder makes that force with its valve as in `vdc_actuator`. The required force's rate comes from a critically
damped filter. The force is left out of zdd_r (our choice: its derivative is noise). This is the readable law,
written trial by trial; a generated one does the same in C (`hydraulic_compiled`) and is tested against it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.law.doubt import left_undone
from skillframe.machine.law.vdc import Bodies, Reduced, bodies, net_forces, parameters, piston_forces, reduced
from skillframe.machine.law.vdc_actuator import (
    ContactFriction,
    CylinderGains,
    Cylinders,
    across_deadband,
    bristle_after,
    coulomb_shape,
    flow_demand,
    friction_parameters,
    friction_regressor,
    inverse_valve,
    pressure_force,
)
from skillframe.machine.law.vdc_adaptation import adapt, relative_bounds
from skillframe.machine.law.vdc_reference import Path, ToolTask, required_motion
from skillframe.robot.chain import ChainState, ClosedChain
from skillframe.robot.spec import RobotSpec
from skillframe.signals.rates import RateFilter

REACH = 1e-6  # m per unit of a joint: an axis of base along which the tool moves less is not commanded


class Measured(NamedTuple):
    """What the machine's sensors say, for N trials.

    Attributes:
        z, rate: (N, n) minimal coordinates and their filtered rates.
        pressure_a, pressure_b: (N, k) [Pa].
        force, sigma: (N, 2) of the environment on the tool, along the plane's axes, and its standard deviation [N].
    """

    z: Float
    rate: Float
    pressure_a: Float
    pressure_b: Float
    force: Float
    sigma: Float


class Reference(NamedTuple):
    """What is wanted of the tool's point in the machine's plane, and of the joints it leaves open, for N trials.

    Attributes:
        position, velocity: X_d, X_d' (N, 2) [m, m/s].
        stiffness, damping: K, D (N, 2, 2) [N/m, Ns/m]; D is positive definite.
        push: f_ff (N, 2) [N].
        joint, joint_rate: (N, n - 2).
        acceleration: X_d'' and the open joints' (N, n), where it is known.
    """

    position: Float
    velocity: Float
    stiffness: Float
    damping: Float
    push: Float
    joint: Float
    joint_rate: Float
    acceleration: Float | None = None


class Terms(NamedTuple):
    """The model's terms in minimal coordinates, for N trials.

    Attributes:
        mass: M_z (N, n, n); drift: C_z^T zd (N, n); gravity: g_z (N, n).
        jacobian: of the tool's point in the plane (N, 2, n); tip, tip_rate: its position and velocity (N, 2).
        arms: (N, k, n), dx/dz of the pistons; piston, piston_rate: (N, k).
    """

    mass: Float
    drift: Float
    gravity: Float
    jacobian: Float
    arms: Float
    piston: Float
    piston_rate: Float
    tip: Float
    tip_rate: Float


@dataclass(frozen=True, slots=True, kw_only=True)
class HydraulicGains:
    """Gains of the law.

    Attributes:
        velocity, force: k_x and k_f of each cylinder (k,). Published for this crane: 5e-3, 5e-3, 1e-3 and 2e-8, 2e-8,
            8e-9; the default k_f is a fifth of it, which tracks better where friction is not known (our measurement).
        body: K_A, the same for all bodies [N s/m, N m s/rad]. Published: 5, which damps nothing. Ours: a tool that
            lands on something hard is stopped in less time than k_x and k_f need, and this damps it; with twice as
            much and a valve that is 20 ms late the crane rings on 1e6 N/m.
        adaptation: rho of the inertial parameters; 0 switches it off. share: bounds, +- of each parameter as told.
        friction: rho_f of the cylinders' Coulomb [N/m] and viscous friction [N s/m^2 per m/s]; 0 switches it off.
            Published: 1e5 of both.
        friction_share: bounds, +- of each.
        joint: lambda of the joints that the tool's plane leaves open [1/s].
        contact: friction there, see `vdc_actuator`.
        force_corner: of the filter that gives the required force's rate [Hz]. Published: 8, too late for `body`.
    """

    velocity: tuple[float, ...] = (5e-3, 5e-3, 1e-3)
    force: tuple[float, ...] = (4e-9, 4e-9, 1.6e-9)
    body: float = 1000.0
    adaptation: float = 300.0
    share: float = 0.3
    friction: tuple[float, float] = (2e5, 2e5)
    friction_share: float = 0.5
    joint: float = 3.0
    force_corner: float = 16.0
    contact: ContactFriction = field(default_factory=ContactFriction)

    @classmethod
    def of(cls, spec: RobotSpec) -> HydraulicGains:
        """Those of a machine as its robot.toml says them."""
        velocity, force = (tuple(getattr(a, f"{name}_gain") for a in spec.actuation) for name in ("velocity", "force"))
        return cls(velocity=velocity, force=force, body=spec.gains.body, force_corner=spec.gains.force_corner_hz)


class Demand(NamedTuple):
    """What a step comes to: valve commands (N, k) in [-1, 1], required and present pressure force (N, k) [N]."""

    valve: Float
    required: Float
    present: Float


def plane_axes(chain: ClosedChain) -> tuple[int, int]:
    """The two axes of base (0 to 2) along which a machine moves its tool.

    Raises:
        InputError: it moves its tool along one axis, or along three.
    """
    state = chain.at(chain.minimal(chain.robot.home), np.zeros(len(chain.independent)))
    reach = np.abs(state.jacobian(chain.robot.tool_frames[0])[:3]).max(axis=1)
    axes = [int(i) for i in np.flatnonzero(reach > REACH)]
    if len(axes) != 2:
        text = f"moves its tool along {len(axes)} axes of base; the hydraulic law is for machines of one plane"
        raise InputError(chain.robot.spec.name, text, "take a robot without [[actuation]]")
    return axes[0], axes[1]


def plane_task(chain: ClosedChain) -> ToolTask:
    """The tool's point in its plane, and the last independent joints as far as the plane leaves them open."""
    return ToolTask(chain, plane_axes(chain), chain.independent[2:])


def terms(chain: ClosedChain, z: Float, rate: Float, theta: Float | None = None) -> Terms:
    """The model's terms at minimal coordinates and rates (N, n), with its own inertias or theta (N, B, 10)."""
    axes, given = list(plane_axes(chain)), [None] * len(z) if theta is None else theta
    rows = [_terms(chain, axes, *row) for row in zip(z, rate, given, strict=True)]
    return Terms(*(np.array(column) for column in zip(*rows, strict=True)))


def _terms(chain: ClosedChain, axes: list[int], z: Float, rate: Float, theta: Float | None) -> Terms:
    state, frame = chain.at(z, rate), chain.robot.tool_frames[0]
    jacobian = state.jacobian(frame)[axes]
    tip = np.array(state.data.oMf[frame].translation)[axes]
    mass, gravity = _reduced(state, theta)
    return Terms(
        mass, _kinetic_gradient(chain, z, rate, theta), gravity, jacobian, state.arms, *state.piston,
        tip, jacobian @ rate,
    )  # fmt: skip


def _reduced(state: ChainState, theta: Float | None) -> Reduced:
    return Reduced(state.mass, state.gravity) if theta is None else reduced(state, theta)


def _kinetic_gradient(chain: ClosedChain, z: Float, rate: Float, theta: Float | None, h: float = 1e-5) -> Float:
    """C_z^T zd = d(1/2 zd^T M_z zd)/dz (n,), by central differences: Lagrange's equations say so."""

    def kinetic(at: Float) -> float:
        return 0.5 * float(rate @ _reduced(chain.at(at, rate), theta).mass @ rate)

    steps = h * np.eye(len(z))
    return np.array([(kinetic(z + s) - kinetic(z - s)) / (2 * h) for s in steps])


class HydraulicLaw:
    """The law with its memory, for N trials.

    Args:
        chain, cylinders: as the controller knows them.
        gains: see `HydraulicGains`.
        count: number of trials N.
        dt: sample time [s].

    Attributes:
        told: (N, B, 10) inertial parameters of every moving body, as `tell` said; the model's own to begin with.
        theta: (N, B, 10) the same as estimated.
        friction: (N, 2, k) estimated Coulomb [N] and viscous friction [N s/m]; may be set to what is found otherwise.
        deadband, supply: (N, k) of the valves, share of their travel, and the pressure before them [Pa]; likewise.
    """

    def __init__(self, chain: ClosedChain, cylinders: Cylinders, gains: HydraulicGains, count: int, dt: float) -> None:
        self.chain, self.cylinders, self.gains, self._dt = chain, cylinders, gains, dt
        self._task = plane_task(chain)
        self.tell(np.tile(parameters(chain.model), (count, 1, 1)))
        rub = friction_parameters(cylinders)
        self.friction: Float = np.tile(rub, (count, 1, 1))
        self._friction_bounds = relative_bounds(rub, gains.friction_share)
        self.deadband: Float = np.tile(cylinders.deadband, (count, 1))
        self.supply: Float = np.tile(cylinders.supply_pressure, (count, 1))
        self._bristle: Float = np.zeros_like(self.deadband)
        self._gain: Float = gains.body * np.eye(6)
        self._cylinder_gains = CylinderGains(velocity=np.array(gains.velocity), force=np.array(gains.force))
        self._force_rate = RateFilter(gains.force_corner, dt)
        self._fresh, self.learning = True, True

    def start(self) -> None:
        """Forget the past; the required force's filter begins at the first required force."""
        self._fresh = True
        self._bristle[:] = 0.0

    def tell(self, theta: Float) -> None:
        """Say what inertial parameters (N, B, 10) the machines have: terms, estimate and its bounds start from them."""
        self.told: Float = theta.copy()
        self.theta: Float = theta.copy()
        self._bounds = relative_bounds(theta, self.gains.share)

    def adapt(self, on: bool) -> None:
        """Learn, as at first, or hold what was learned: in contact with stiff things learning rings (our trials)."""
        self.learning = on

    def terms(self, measured: Measured) -> Terms:
        """The model's terms where the machine is measured to be."""
        return terms(self.chain, measured.z, measured.rate, self.told)

    def step(self, measured: Measured, reference: Reference, ids: NDArray[np.int64]) -> Demand:
        """A sample for the trials in `ids`; the other rows mean nothing."""
        count, k = len(measured.z), len(self.cylinders.area_a)
        required, rate_r = np.zeros((count, k)), np.zeros((count, k))
        piston, speed = np.zeros((count, k)), np.zeros((count, k))
        for i in ids:
            state, motion = self._required(measured, reference, i)
            forces = net_forces(motion, self.theta[i], self._gain)
            required[i] = piston_forces(state, motion, forces, self._pushed(state, measured.force[i]))
            rate_r[i] = motion.tree_required[self.chain.driven]
            piston[i], speed[i] = state.piston
            self._learn(i, motion)
        shape = self._slide(rate_r, measured.force, ids)
        force = required + np.sum(shape * self.friction, axis=-2)
        if self.learning:
            self._rub(shape, rate_r - speed, ids)
        return self._valves(measured, force, (piston, speed, rate_r))

    def _required(self, measured: Measured, reference: Reference, i: int) -> tuple[ChainState, Bodies]:
        state = self.chain.at(measured.z[i], measured.rate[i])
        n = len(self.chain.independent)
        wanted = Path(
            np.concatenate([reference.position[i], reference.joint[i]]),
            np.concatenate([reference.velocity[i], reference.joint_rate[i]]),
            np.zeros(n) if reference.acceleration is None else reference.acceleration[i],
        )  # fmt: skip
        gain, push = self.gains.joint * np.eye(n), np.zeros(n)
        gain[:2, :2] = np.linalg.solve(reference.damping[i], reference.stiffness[i])
        push[:2] = np.linalg.solve(reference.damping[i], self._answer(measured, reference, state, i))
        required = required_motion(self._task, state, wanted, gain, push)
        return state, bodies(state, required.rate, required.acceleration)

    def _answer(self, measured: Measured, reference: Reference, state: ChainState, i: int) -> Float:
        """(2,) f + f_ff, less what of the imbalance is not pursued."""
        pushing, error = measured.force[i] + reference.push[i], reference.position[i] - self._task.position(state)[:2]
        imbalance = reference.damping[i] @ reference.velocity[i] + reference.stiffness[i] @ error + pushing
        return np.asarray(pushing - left_undone(imbalance, measured.force[i], measured.sigma[i]) * imbalance)

    def _pushed(self, state: ChainState, force: Float) -> Float:
        in_base = np.zeros(3)
        in_base[self._task.axes] = force
        return self._task.generalised(state, in_base)

    def _learn(self, i: int, motion: Bodies) -> None:
        if self.learning and self.gains.adaptation > 0.0:
            drive = np.einsum("bij,bi->bj", motion.regressor, motion.error)
            low, high = self._bounds
            self.theta[i] = adapt(self.theta[i], self.gains.adaptation * drive, (low[i], high[i]), self._dt)

    def _slide(self, rate_r: Float, force: Float, ids: NDArray[np.int64]) -> Float:
        """Y_f (N, 2, k) at required velocities (N, k)."""
        self._bristle[ids] = bristle_after(self.cylinders, self._bristle[ids], rate_r[ids], self._dt)
        return friction_regressor(rate_r, coulomb_shape(self._bristle, rate_r, force, self.gains.contact))

    def _rub(self, shape: Float, error: Float, ids: NDArray[np.int64]) -> None:
        drive = np.array(self.gains.friction)[:, None] * shape * error[:, None, :]
        moved = adapt(self.friction, drive, self._friction_bounds, self._dt)
        self.friction[ids] = moved[ids]

    def _valves(self, measured: Measured, force: Float, motion: tuple[Float, Float, Float]) -> Demand:
        if self._fresh:
            self._force_rate.start(force)
            self._fresh = False
        rate = self._force_rate.step(force)
        pressures = (measured.pressure_a, measured.pressure_b)
        demand = flow_demand(self.cylinders, self._cylinder_gains, motion, (force, rate), pressures)
        opening = inverse_valve(self.cylinders, demand, motion[0], pressures, self.supply)
        valve = np.clip(across_deadband(self.deadband, opening), -1.0, 1.0)
        return Demand(valve, force, pressure_force(self.cylinders, *pressures))
