"""The force estimate over arrays: the second opinion on the generated one, with formulas of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from skillframe_hydraulics.force.identification import Identification
from skillframe_hydraulics.force.momentum import Estimate, ForceSettings, force_gain
from skillframe_hydraulics.law.hydraulic import tool_axes

from skillframe.frames import Float
from skillframe.signals import SteadyWrenchFilter
from tests.oracle.filters import CriticallyDamped, ImpulseFilter, Undamped

if TYPE_CHECKING:
    from skillframe_hydraulics.law.hydraulic import Measured, Terms
    from skillframe_hydraulics.law.vdc_actuator import Cylinders

    from skillframe.robot.chain import ClosedChain


class MomentumRate:
    """What known forces leave of p', for N machines in lock-step; p' is a difference over a sample of dt [s]."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._momentum: Float | None = None

    def start(self) -> None:
        """Forget the past; the next step takes the machine to be in balance."""
        self._momentum = None

    def step(self, momentum: Float, known: Float) -> Float:
        """(N, n) p' less the rate of it that is accounted for, of p (N, n)."""
        before = momentum if self._momentum is None else self._momentum
        self._momentum = momentum
        return np.asarray((momentum - before) / self._dt - known)


def force_from_residual(jacobian: Float, residual: Float, variance: Float) -> tuple[Float, Float]:
    """Equation (2): the force (N, m) that explains residuals (N, n) of variances (N, n) best, and its sigma (N, m).

    Args:
        jacobian: J (N, m, n) of the tool's point.
        residual: what is left for J^T f.
        variance: diagonal of W^-1.
    """
    weighted = jacobian / variance[:, None, :]
    a = weighted @ np.swapaxes(jacobian, -1, -2)
    covariance = np.linalg.inv(a)
    force = covariance @ (weighted @ residual[..., None])
    return force[..., 0], np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))


def standing_out(force: Float, sigma: Float, doubted: float) -> Float:
    """What of forces (N, 2) stands out of their sigma: f d^4 / (1 + d^4), d^2 the sum of (f_i / (doubted sigma_i))^2.

    Our choice, because a law that answers a force which standing pistons only seem to show sets them moving, and the
    force turns round: with its tool in the air the crane swung by 60 mm/s where it should have stood. The fourth power
    leaves 8 kN as they are, to 0.1 %.
    """
    power = np.square(np.sum(np.square(force / (doubted * sigma)), axis=-1, keepdims=True))
    return np.asarray(force * (power / (1.0 + power)))


class ForceEstimator:
    """Estimates online, identifies in air when told to, and holds what it found.

    Args:
        chain: the controller's model of the machine; gives the payload's gravity.
        cylinders: what the controller knows of them.
        count: number of trials N.
        dt: sample time [s].
        settings: see `ForceSettings`.

    Attributes:
        identification: theta, its standard deviation, and how many rows it has seen.
        raw: (N, m) the force before its Kalman filter [N].
        residual: (N, n) what is left for J^T f [Nm or N].
        regressors: (N, n, 2k + 1) phi, to be read and not kept.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, count: int, dt: float, settings: ForceSettings | None = None
    ) -> None:
        self.settings, self._cylinders, self._dt = settings or ForceSettings(), cylinders, dt
        s, m = self.settings, len(tool_axes(chain))
        self.identification = Identification(count, len(cylinders.area_a), s.identify)
        self._left, self._filter = MomentumRate(dt), CriticallyDamped(s.corner, dt)
        self._rate_share = float(-np.expm1(-2.0 * np.pi * s.rate_corner * dt))
        self._wrench = None if s.force_corner is None else ImpulseFilter(s.force_corner, dt)
        self._undamped, self._feedback = Undamped(s.corner, dt), force_filter(s.feedback_corner, dt, m)
        self._noise: Float = np.square(np.array(s.row_noise))
        self._every, self._tick, self.calibrating = max(1, round(s.identify.period / dt)), 0, False
        self._columns: Float = np.zeros((count, len(s.row_noise), 2 * len(cylinders.area_a) + 2 + m))
        self.raw: Float = np.zeros((count, m))
        self.residual: Float = np.zeros((count, len(s.row_noise)))

    def calibrate(self, on: bool) -> None:
        """Say that the tool is in air (True), or that it may touch from now on (False): an explicit step of a task.

        Turning it on begins the identification anew.
        """
        if on and not self.calibrating:
            self.identification.start()
        self.calibrating = on

    def start(self) -> None:
        """Begin, with the machine at rest."""
        self._left.start()
        self._filter.start()
        self._rate: Float = np.zeros((len(self.raw), len(self._cylinders.area_a)))
        self._since: Float = np.zeros_like(self._rate)
        self._tick = 0

    def step(self, measured: Measured, terms: Terms) -> Estimate:
        """One estimate from one measurement and the model's terms there."""
        c, m = self._cylinders, self.raw.shape[1]
        if self._tick % self._every == 0:
            self._load = terms.load
        before = self._rate
        self._rate = before + self._rate_share * (terms.piston_rate - self._rate)
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        push = c.area_a * measured.pressure_a - c.area_b * measured.pressure_b
        push -= c.coulomb_friction * shape + c.viscous_friction * terms.piston_rate
        known = joint_force(terms.arms, push) + terms.drift - terms.gravity
        momentum = (terms.mass @ measured.rate[..., None])[..., 0]
        columns = self._filter.step(self._fill(self._left.step(momentum, known), terms, shape))
        residual, jacobian, phi = columns[..., 0], np.swapaxes(columns[..., 1 : 1 + m], -1, -2), columns[..., 1 + m :]
        sliding = self._sliding(before)
        if self.calibrating and self._tick % self._every == 0:
            rows = joint_force(np.abs(terms.arms), np.where(sliding, 0.0, 1.0)) == 0.0
            self.identification.update(phi, residual, self._noise, rows)
        self.regressors = phi
        self.residual = residual - (phi @ self.identification.theta[..., None])[..., 0]
        self.raw, sigma = force_from_residual(jacobian, self.residual, self._variance(terms.arms, sliding))
        if self._tick == 0:
            self._begin()
        self._tick += 1
        settled = self._since >= self.settings.settle + self.settings.memory
        level = sum(
            1.0 * (joint_force(np.abs(terms.arms), np.where(one, 0.0, 1.0)) == 0.0) for one in (sliding, settled)
        )
        feedback = self._feedback.step(self.raw)
        answered = standing_out(feedback, sigma, self.settings.doubted)
        return Estimate(self._smooth(), sigma, level, feedback, answered)

    def friction(self, terms: Terms) -> Float:
        """(N, k) of every cylinder as it is known now, nominal and what was identified [N]."""
        c, found = self._cylinders, self.identification
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        coulomb: Float = (c.coulomb_friction + found.coulomb) * shape
        return coulomb + (c.viscous_friction + found.viscous) * terms.piston_rate

    def _fill(self, left: Float, terms: Terms, shape: Float) -> Float:
        """(N, n, 3 + 2k + 1) all that passes L: what is left of p', J^T, and the columns of phi."""
        columns, k, m = self._columns, shape.shape[-1], self.raw.shape[1]
        spread = transposed(terms.arms)
        columns[..., 0], columns[..., 1 : 1 + m] = left, np.swapaxes(terms.jacobian, -1, -2)
        np.multiply(spread, -shape[:, None, :], out=columns[..., 1 + m : 1 + m + k])
        np.multiply(spread, -terms.piston_rate[:, None, :], out=columns[..., 1 + m + k : 1 + m + 2 * k])
        np.negative(self._load, out=columns[..., -1])
        return columns

    def _sliding(self, before: Float) -> NDArray[np.bool_]:
        """(N, k) has the piston been going one way for long enough?"""
        going = (np.abs(self._rate) > self.settings.least_speed) & (self._rate * before > 0.0)
        self._since = np.where(going, self._since + self._dt, 0.0)
        return np.asarray(self._since >= self.settings.settle)

    def _variance(self, arms: Float, sliding: NDArray[np.bool_]) -> Float:
        """(N, n) of each joint's residual: noise, and what its pistons' stiction may hide."""
        if not self.settings.weighted:
            return np.broadcast_to(self._noise.mean(), sliding.shape)
        speed = self._rate / self.settings.stiction_speed
        share = np.where(sliding, np.exp(-np.square(speed)), 1.0)
        return self._noise + joint_force(np.square(arms), np.square(self._cylinders.coulomb_friction * share))

    def _begin(self) -> None:
        self._feedback.start(self.raw)
        self._undamped.start(self.raw)
        if self._wrench is not None:
            self._wrench.start(self.raw)

    def _smooth(self) -> Float:
        """The force now (N, 2): L's place is taken by a better filter, and the sensors' lag made up for."""
        if self._wrench is None:
            return self.raw
        self._wrench.step(self._undamped.step(self.raw))
        return self._wrench.ahead(1.0 / (np.pi * self.settings.sensor_corner))


def force_filter(corner: float, dt: float, components: int) -> SteadyWrenchFilter:
    """The converged Kalman filter of a force's components, `kalman`'s model with a corner [Hz]."""
    return SteadyWrenchFilter(force_gain(corner, dt, components), dt)


def transposed(arms: Float) -> Float:
    """R^T (N, n, k) of moment arms (N, k, n)."""
    return np.swapaxes(arms, -1, -2)


def joint_force(arms: Float, force: Float) -> Float:
    """R^T F (N, n) of piston forces (N, k)."""
    result: Float = (np.swapaxes(arms, -1, -2) @ force[..., None])[..., 0]
    return result
