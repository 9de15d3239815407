r"""Force of the environment on a hydraulic machine's tool, estimated from chamber pressures and encoders.

In minimal coordinates, with the momentum \(p = M_z \dot z\) and pistons that push \(F_p = A_a p_a - A_b p_b\) less
friction \(F_f\), a machine moves by \(\dot p = R^T (F_p - F_f) + C_z^T \dot z - g_z - \delta m\, g_1 + J^T f\). So

    r = L(s) [ p' - R^T (F_p - F_f) - C_z^T zd + g_z ] = L(s) [ J^T f - dm g_1 - R^T dF_f ], L(s) = (K / (s + K))^2  (1)
    f = (J W J^T)^-1 J W (r - phi theta),     sigma^2 = diag (J W J^T)^-1                                           (2)

Filtering p' by L needs only differences of p, no acceleration (De Luca and Mattone, ICRA 2003; for cylinders Koivumaki
and Mattila, T-RO 31(4), 2015). Errors theta of friction and payload are identified in air (`identification`).
Regressors phi and J pass the same filter, so that nothing lags behind. W lowers the weight of a joint whose piston
sticks or has just reversed, by the friction that may be hidden there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.signals import Gain, steady_gain
from skillframe_hydraulics.force.identification import IdentificationSettings
from skillframe_hydraulics.law.vdc_actuator import pressure_force
from skillframe_hydraulics.symbolic_or_numeric import absolute, both, exp, square_sum, where


class Estimate(NamedTuple):
    """Force of the environment on the tool.

    Attributes:
        force: (N, m) along the task's axes [N]; sigma: (N, m) its standard deviation, from W [N].
        level: (N, n) of every freedom: 1 if all pistons that move it slide, 2 if they have done so for the filter's
            memory, else 0.
        feedback: (N, m) force for feedback, 50 ms late, with little gain at the frequencies at which contact rings.
        answered: (N, m) the part of the feedback above its uncertainty (`standing_out`), for the machine's controller.
    """

    force: Float
    sigma: Float
    level: Float
    feedback: Float
    answered: Float

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether as many freedoms as the force has components slide for long enough (N,). Else stiction hides it."""
        found: NDArray[np.bool_] = (self.level > 1.0).sum(axis=-1) >= self.force.shape[-1]
        return found


_SPEEDS = ("stiction_speed", "least_speed", "sliding_speed")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSettings:
    """Settings of the estimate, tuned for the shipped crane unless published.

    Attributes:
        corner: of L, two equal poles as published for this crane's derivatives [Hz].
        rate_corner: of the piston rates that friction is computed from [Hz].
        row_noise: standard deviation of the residual r of each joint while its piston slides (n,) [Nm or N], here for
            encoders of 1e-4 rad (m) and pressure sensors of 0.22 bar at 1 kHz; see `residual_noise`.
        stiction_speed: a slower piston hides friction exp(-(v / stiction_speed)^2) of its Coulomb friction [m/s].
        least_speed, settle: a piston slides after moving one way faster than this [m/s] for this long [s].
        memory: time after which the force is then valid, longer than its filter's period of 0.33 s [s].
        sliding_speed: friction is F_C tanh(v / sliding_speed) + F_v v [m/s].
        force_corner: of the wrench's Kalman filter (`impulse`) [Hz]; None for no filter.
        sensor_corner: of the sensors' filters, two equal poles as published [Hz]; their lag is compensated.
        feedback_corner: of the Kalman filter of the feedback (`signals`) [Hz].
        doubted: number of sigmas at which half of the feedback is answered.
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


# Formulas of one sample, for arrays over machines or casadi expressions (`symbolic_or_numeric`).


def unaccounted(momentum: Any, before: Any, known: Any, dt: float) -> Any:
    """Unexplained part of p' (..., n), from the difference of p over a sample of dt [s]."""
    return (momentum - before) / dt - known


def sliding_push(c: Any, pressures: tuple[Any, Any], shape: Any, speed: Any) -> Any:
    """Force F_p - F_f (..., k) [N] of pistons, for the `shape` of Coulomb friction from -1 to 1."""
    return pressure_force(c, *pressures) - c.coulomb_friction * shape - c.viscous_friction * speed


def slid_since(since: Any, rate: Any, before: Any, s: ForceSettings, dt: float) -> Any:
    """Time for which pistons (..., k) have moved one way [s], from their present and last filtered rates [m/s]."""
    going = both(absolute(rate) > s.least_speed, rate * before > 0.0)
    return where(going, since + dt, 0.0)


def hidden_friction(c: Any, rate: Any, sliding: Any, s: ForceSettings) -> Any:
    """Coulomb friction (..., k) [N] that pistons may hide, all of it while they do not slide."""
    return c.coulomb_friction * where(sliding, exp(-((rate / s.stiction_speed) ** 2)), 1.0)


def force_from_residual(jacobian: ca.SX, residual: ca.SX, variance: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Equation (2): force (m,) [N] and its variances (m,) [N^2], from residuals (n,) of variances (n,).

    `jacobian` is J (m, n). The inverse is written by cofactors, without a pivot that depends on numbers.
    """
    weighted = jacobian / ca.repmat(variance.T, jacobian.shape[0], 1)
    normal = weighted @ jacobian.T
    cofactors, determinant = ca.adj(normal), ca.det(normal)
    return (cofactors @ (weighted @ residual)) / determinant, ca.diag(cofactors) / determinant


def standing_out(force: Any, sigma: Any, doubted: float) -> Any:
    """The part of forces (..., m) above sigma: f d^4 / (1 + d^4), d^2 the sum of (f_i / (doubted sigma_i))^2.

    A controller that answers the apparent force of standing pistons sets them moving, which reverses that force: the
    tool would oscillate in the air. The fourth power changes a force of 8 kN by less than 0.1 %.
    """
    power = square_sum(force / (doubted * sigma)) ** 2
    return force * (power / (1.0 + power))


def force_gain(corner: float, dt: float, components: int = 2) -> Gain:
    """Converged gain for a force's components, by the model of `signals` with a corner [Hz]."""
    one = np.ones(components)
    return steady_gain(one, one * np.sqrt(dt) * (2.0 * np.pi * corner) ** 2, dt)


def joint_force(arms: Float, force: Float) -> Float:
    """R^T F (N, n) of piston forces (N, k) with moment arms R (N, k, n)."""
    result: Float = (np.swapaxes(arms, -1, -2) @ force[..., None])[..., 0]
    return result
