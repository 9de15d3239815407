r"""The law of `machine.law.hydraulic` over arrays, trial by trial: the second opinion on the generated one.

The terms come another way than there: the mass matrix from Pinocchio's Jacobians, Coriolis' part as a central
difference of the kinetic energy. Nothing of the product's formulas is used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skillframe_hydraulics.law.hydraulic import (
    Demand,
    HydraulicGains,
    Measured,
    Reference,
    Terms,
    tool_axes,
    tool_task,
)
from skillframe_hydraulics.law.vdc_actuator import CylinderGains, Cylinders, friction_parameters
from skillframe_hydraulics.law.vdc_adaptation import relative_bounds
from skillframe_hydraulics.law.vdc_body import parameters

from skillframe.frames import Float
from skillframe.robot.chain import ChainState, ClosedChain
from skillframe.signals import RateFilter
from tests.oracle.valve_law import (
    across_deadband,
    bristle_after,
    compensated,
    coulomb_shape,
    flow_demand,
    friction_regressor,
    inverse_valve,
    pressure_force,
    pursued,
    through_points,
)
from tests.oracle.vdc import Bodies, Reduced, adapt, bodies, net_forces, piston_forces, reduced
from tests.oracle.vdc_reference import Path, required_motion


def terms(chain: ClosedChain, z: Float, rate: Float, theta: Float | None = None) -> Terms:
    """The model's terms at minimal coordinates and rates (N, n), with its own inertias or theta (N, B, 10)."""
    axes, given = tool_axes(chain), [None] * len(z) if theta is None else theta
    rows = [_terms(chain, axes, *row) for row in zip(z, rate, given, strict=True)]
    return Terms(*(np.array(column) for column in zip(*rows, strict=True)))


def _terms(chain: ClosedChain, axes: Float, z: Float, rate: Float, theta: Float | None) -> Terms:
    state, frame = chain.at(z, rate), chain.robot.tool_frames[0]
    jacobian = axes @ state.jacobian(frame)[:3]
    tip = axes @ np.array(state.data.oMf[frame].translation)
    mass, gravity = _reduced(state, theta)
    return Terms(
        mass, _kinetic_gradient(chain, z, rate, theta), gravity, jacobian, state.arms, *state.driven_motion,
        tip, jacobian @ rate, state.load_gravity,
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
        self._task = tool_task(chain)
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
            piston[i], speed[i] = state.driven_motion
            self._learn(i, motion)
        shape = self._slide(rate_r, measured.force, ids)
        force = required + np.sum(shape * self.friction, axis=-2)
        if self.learning:
            self._rub(shape, rate_r - speed, ids)
        return self._valves(measured, force, (piston, speed, rate_r))

    def _required(self, measured: Measured, reference: Reference, i: int) -> tuple[ChainState, Bodies]:
        state = self.chain.at(measured.z[i], measured.rate[i])
        n, m = len(self.chain.independent), len(self._task.axes)
        wanted = Path(
            np.concatenate([reference.position[i], reference.joint[i]]),
            np.concatenate([reference.velocity[i], reference.joint_rate[i]]),
            np.zeros(n) if reference.acceleration is None else reference.acceleration[i],
        )  # fmt: skip
        gain, push = self.gains.joint * np.eye(n), np.zeros(n)
        gain[:m, :m] = np.linalg.solve(reference.damping[i], reference.stiffness[i])
        push[:m] = np.linalg.solve(reference.damping[i], self._answer(measured, reference, state, i))
        required = required_motion(self._task, state, wanted, gain, push)
        return state, bodies(state, required.rate, required.acceleration)

    def _answer(self, measured: Measured, reference: Reference, state: ChainState, i: int) -> Float:
        """(m,) f + f_ff, less what of the imbalance is not pursued."""
        pushing, tip = measured.force[i] + reference.push[i], self._task.position(state)[: len(self._task.axes)]
        error = reference.position[i] - tip
        imbalance = reference.damping[i] @ reference.velocity[i] + reference.stiffness[i] @ error + pushing
        return np.asarray(pushing - (1.0 - pursued(imbalance, measured.force[i], measured.sigma[i])) * imbalance)

    def _pushed(self, state: ChainState, force: Float) -> Float:
        return self._task.generalised(state, force @ self._task.axes)

    def _learn(self, i: int, motion: Bodies) -> None:
        if self.learning and self.gains.adaptation > 0.0:
            drive = np.einsum("bij,bi->bj", motion.regressor, motion.error)
            low, high = self._bounds
            self.theta[i] = adapt(self.theta[i], drive, self.gains.adaptation, (low[i], high[i]), self._dt)

    def _slide(self, rate_r: Float, force: Float, ids: NDArray[np.int64]) -> Float:
        """Y_f (N, 2, k) at required velocities (N, k)."""
        self._bristle[ids] = bristle_after(self.cylinders, self._bristle[ids], rate_r[ids], self._dt)
        return friction_regressor(rate_r, coulomb_shape(self._bristle, rate_r, force, self.gains.contact))

    def _rub(self, shape: Float, error: Float, ids: NDArray[np.int64]) -> None:
        drive = np.array(self.gains.friction)[:, None] * shape * error[:, None, :]
        moved = adapt(self.friction, drive, 1.0, self._friction_bounds, self._dt)
        self.friction[ids] = moved[ids]

    def _valves(self, measured: Measured, force: Float, motion: tuple[Float, Float, Float]) -> Demand:
        if self._fresh:
            self._force_rate.start(force)
            self._fresh = False
        rate = self._force_rate.step(force)
        pressures = (measured.pressure_a, measured.pressure_b)
        demand = flow_demand(self.cylinders, self._cylinder_gains, motion, (force, rate), pressures)
        given = self.cylinders, demand, motion[0], pressures, self.supply
        kinds = {one["compensation"]: one["margin"] for one in self.chain.robot.spec.tables.get("supply", {}).values()}
        if kinds:
            opening = compensated(*given, self.deadband, kinds.get("pre"))
        else:
            opening = inverse_valve(*given)
        valve = np.clip(through_points(self.cylinders, across_deadband(self.deadband, opening)), -1.0, 1.0)
        return Demand(valve, force, pressure_force(self.cylinders, *pressures))
