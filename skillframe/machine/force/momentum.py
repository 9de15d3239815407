r"""Force of the environment on a hydraulic machine's tool, from chamber pressures and encoders, without a force sensor.

In minimal coordinates, with the momentum \(p = M_z \dot z\) and pistons that push \(F_p = A_a p_a - A_b p_b\) less
friction \(F_f\), a machine moves by \(\dot p = R^T (F_p - F_f) + C_z^T \dot z - g_z - \delta m\, g_1 + J^T f\). So

    r = L(s) [ p' - R^T (F_p - F_f) - C_z^T zd + g_z ] = L(s) [ J^T f - dm g_1 - R^T dF_f ], L(s) = (K / (s + K))^2  (1)
    f = (J W J^T)^-1 J W (r - phi theta),     sigma^2 = diag (J W J^T)^-1                                           (2)

The momentum's rate passes the filter L only as a difference of p, so that no acceleration is needed (De Luca and
Mattone, ICRA 2003; for cylinders Koivumaki and Mattila, T-RO 31(4), 2015). What friction and payload are known wrongly
by, theta, is found in air (`identification`). Its regressors phi, and J, pass the same filter: matched, so that nothing
lags behind. W weighs a joint whose piston sticks, or has just turned, by what friction may hide there (our choice; 4 kN
of the crane's cylinders are some 400 N at the tool, whatever is done).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.machine.force.damped import CriticallyDamped, Undamped
from skillframe.machine.force.identification import Identification, IdentificationSettings
from skillframe.machine.force.impulse import ImpulseFilter
from skillframe.signals.kalman import Gain, SteadyWrenchFilter, steady_gain

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic import Measured, Terms
    from skillframe.machine.law.vdc_actuator import Cylinders
    from skillframe.robot.chain import ClosedChain

__all__ = ["Estimate", "ForceEstimator", "ForceSettings", "MomentumRate", "force_from_residual", "standing_out"]


class Estimate(NamedTuple):
    """Force of the environment on the tool.

    Attributes:
        force: (N, 2) base x and z [N]; sigma: (N, 2) its standard deviation, from W [N].
        valid: (N,) two pistons or more have been sliding for long enough; else stiction leaves 400 N open and more.
        feedback: (N, 2) the force for whatever answers it, a law or a hand: it comes some 50 ms late, and has no gain
            to speak of at the frequencies at which a machine in contact rings.
        answered: (N, 2) what of the feedback stands out of its uncertainty (`standing_out`): for the law of a machine.
    """

    force: Float
    sigma: Float
    valid: NDArray[np.bool_]
    feedback: Float
    answered: Float


_SPEEDS = ("stiction_speed", "least_speed", "sliding_speed")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSettings:
    """How to estimate; what is not named otherwise is our choice, from trials with the crane.

    Attributes:
        corner: of L, two equal poles as published for this crane's derivatives [Hz].
        rate_corner: of the piston rates that friction is computed from [Hz].
        row_noise: standard deviation of the residual r of each joint while its piston slides (n,) [Nm or N], as
            measured in air with encoders of 1e-4 rad (m) and pressure sensors of 0.22 bar at 1 kHz; a machine's loop
            takes what follows from its own sensors (`residual_noise`).
        stiction_speed: a piston below it hides friction exp(-(v / stiction_speed)^2) of its Coulomb friction [m/s].
        least_speed, settle: a piston slides once it has gone one way faster than this [m/s] for this long [s].
        memory: and the force is valid so much later [s], when its filter, of a period of 0.33 s, holds nothing else.
        sliding_speed: friction is F_C tanh(v / sliding_speed) + F_v v [m/s].
        force_corner: of the wrench's Kalman filter (`impulse`) [Hz]; None leaves it out.
        sensor_corner: of the sensors' filters before, two equal poles as published [Hz]; their lag is made up for.
        feedback_corner: of the Kalman filter of the feedback (`kalman`) [Hz].
        doubted: so many sigmas of the feedback are answered by half, less than that by next to nothing.
        weighted: False gives every joint the same weight.
        identify: of friction and payload in air.
    """

    corner: float = 8.0
    rate_corner: float = 16.0
    row_noise: tuple[float, ...] = (220.0, 160.0, 170.0)
    stiction_speed: float = 4e-3
    least_speed: float = 6e-3
    settle: float = 0.4
    memory: float = 0.35
    sliding_speed: float = 2.5e-3
    force_corner: float | None = 3.0
    sensor_corner: float = 24.0
    feedback_corner: float = 2.5
    doubted: float = 2.0
    weighted: bool = True
    identify: IdentificationSettings = field(default_factory=IdentificationSettings)

    def __post_init__(self) -> None:
        for name in ("corner", "rate_corner", "sensor_corner", "feedback_corner", "doubted", *_SPEEDS):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise SkillframeError(f"force estimate: {name} must be positive, got {getattr(self, name)}")


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
    """Equation (2): the force (N, 2) that explains residuals (N, n) of variances (N, n) best, and its sigma (N, 2).

    Args:
        jacobian: J (N, 2, n) of the tool's point.
        residual: what is left for J^T f.
        variance: diagonal of W^-1.
    """
    weighted = jacobian / variance[:, None, :]
    a = weighted @ np.swapaxes(jacobian, -1, -2)
    determinant = a[:, 0, 0] * a[:, 1, 1] - a[:, 0, 1] * a[:, 1, 0]
    covariance = a[:, ::-1, ::-1] * _COFACTORS / determinant[:, None, None]  # inverse of a symmetric 2 x 2 matrix
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


_COFACTORS = np.array([[1.0, -1.0], [-1.0, 1.0]])


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
        raw: (N, 2) the force before its Kalman filter [N].
        residual: (N, n) what is left for J^T f [Nm or N].
        regressors: (N, n, 2k + 1) phi, to be read and not kept.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, count: int, dt: float, settings: ForceSettings | None = None
    ) -> None:
        self.settings, self._chain, self._cylinders, self._dt = settings or ForceSettings(), chain, cylinders, dt
        s = self.settings
        self.identification = Identification(count, len(cylinders.area_a), s.identify)
        self._left, self._filter = MomentumRate(dt), CriticallyDamped(s.corner, dt)
        self._rate_share = float(-np.expm1(-2.0 * np.pi * s.rate_corner * dt))
        self._wrench = None if s.force_corner is None else ImpulseFilter(s.force_corner, dt)
        self._undamped, self._feedback = Undamped(s.corner, dt), force_filter(s.feedback_corner, dt)
        self._noise: Float = np.square(np.array(s.row_noise))
        self._every, self._tick, self.calibrating = max(1, round(s.identify.period / dt)), 0, False
        self._columns: Float = np.zeros((count, len(s.row_noise), 2 * len(cylinders.area_a) + 4))
        self.raw: Float = np.zeros((count, 2))
        self.residual: Float = np.zeros((count, len(s.row_noise)))

    def calibrate(self, on: bool) -> None:
        """Say that the tool is in air (True), or that it may touch from now on (False): an explicit step of a task.

        Turning it on starts the identification again.
        """
        if on and not self.calibrating:
            self.identification.start()
        self.calibrating = on

    def start(self, measured: Measured) -> None:
        """Begin at a measurement, the machine at rest."""
        count = len(measured.z)
        self._left.start()
        self._filter.start()
        self._rate: Float = np.zeros((count, len(self._cylinders.area_a)))
        self._since: Float = np.zeros_like(self._rate)
        self._load = self._chain.load_gravity(measured.z)
        self._tick = 0

    def step(self, measured: Measured, terms: Terms) -> Estimate:
        """One estimate from one measurement and the model's terms there."""
        c = self._cylinders
        if self._tick % self._every == 0:
            self._load = self._chain.load_gravity(measured.z)
        before = self._rate
        self._rate = before + self._rate_share * (terms.piston_rate - self._rate)
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        push = c.area_a * measured.pressure_a - c.area_b * measured.pressure_b
        push -= c.coulomb_friction * shape + c.viscous_friction * terms.piston_rate
        known = pull(terms.arms, push) + terms.drift - terms.gravity
        momentum = (terms.mass @ measured.rate[..., None])[..., 0]
        columns = self._filter.step(self._fill(self._left.step(momentum, known), terms, shape))
        residual, jacobian, phi = columns[..., 0], np.swapaxes(columns[..., 1:3], -1, -2), columns[..., 3:]
        sliding = self._sliding(before)
        if self.calibrating and self._tick % self._every == 0:
            rows = pull(np.abs(terms.arms), np.where(sliding, 0.0, 1.0)) == 0.0
            self.identification.update(phi, residual, self._noise, rows)
        self.regressors = phi
        self.residual = residual - (phi @ self.identification.theta[..., None])[..., 0]
        self.raw, sigma = force_from_residual(jacobian, self.residual, self._variance(terms.arms, sliding))
        if self._tick == 0:
            self._begin()
        self._tick += 1
        valid = np.sum(self._since >= self.settings.settle + self.settings.memory, axis=-1) >= 2
        feedback = self._feedback.step(self.raw)
        answered = standing_out(feedback, sigma, self.settings.doubted)
        return Estimate(self._smooth(), sigma, valid, feedback, answered)

    def friction(self, terms: Terms) -> Float:
        """(N, k) of every cylinder as it is known now, nominal and what was identified [N]."""
        c, found = self._cylinders, self.identification
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        coulomb: Float = (c.coulomb_friction + found.coulomb) * shape
        return coulomb + (c.viscous_friction + found.viscous) * terms.piston_rate

    def _fill(self, left: Float, terms: Terms, shape: Float) -> Float:
        """(N, n, 3 + 2k + 1) all that passes L: what is left of p', J^T, and the columns of phi."""
        columns, k = self._columns, shape.shape[-1]
        spread = spread_of(terms.arms)
        columns[..., 0], columns[..., 1:3] = left, np.swapaxes(terms.jacobian, -1, -2)
        np.multiply(spread, -shape[:, None, :], out=columns[..., 3 : 3 + k])
        np.multiply(spread, -terms.piston_rate[:, None, :], out=columns[..., 3 + k : 3 + 2 * k])
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
        return self._noise + pull(np.square(arms), np.square(self._cylinders.coulomb_friction * share))

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


def force_gain(corner: float, dt: float) -> Gain:
    """Converged gain of a force's two components, `kalman`'s model with a corner [Hz]."""
    one = np.ones(2)
    return steady_gain(one, one * np.sqrt(dt) * (2.0 * np.pi * corner) ** 2, dt)


def force_filter(corner: float, dt: float) -> SteadyWrenchFilter:
    """The converged Kalman filter of a force's two components, `kalman`'s model with a corner [Hz]."""
    return SteadyWrenchFilter(force_gain(corner, dt), dt)


def spread_of(arms: Float) -> Float:
    """R^T (N, n, k) of moment arms (N, k, n), or of a diagonal (N, k)."""
    if arms.ndim == 2:
        return arms[:, :, None] * np.eye(arms.shape[-1])
    return np.swapaxes(arms, -1, -2)


def pull(arms: Float, force: Float) -> Float:
    """R^T F (N, n) of piston forces (N, k), with moment arms as in `spread_of`."""
    if arms.ndim == 2:
        return arms * force
    result: Float = (np.swapaxes(arms, -1, -2) @ force[..., None])[..., 0]
    return result
