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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.either import absolute, both, dot, exp, square_sum, where
from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.machine.force.identification import IdentificationSettings
from skillframe.machine.law.vdc_actuator import pressure_force
from skillframe.signals.kalman import Gain, steady_gain


class Estimate(NamedTuple):
    """Force of the environment on the tool.

    Attributes:
        force: (N, 2) base x and z [N]; sigma: (N, 2) its standard deviation, from W [N].
        level: (N, k) of every piston: 1 once it slides, 2 once the estimate's memory holds nothing else, 0 else.
        feedback: (N, 2) the force for whatever answers it, a law or a hand: it comes some 50 ms late, and has no gain
            to speak of at the frequencies at which a machine in contact rings.
        answered: (N, 2) what of the feedback stands out of its uncertainty (`standing_out`): for the law of a machine.
    """

    force: Float
    sigma: Float
    level: Float
    feedback: Float
    answered: Float

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether (N,) two pistons or more slide for long enough. Else stiction leaves 400 N open and more."""
        found: NDArray[np.bool_] = (self.level > 1.0).sum(axis=-1) >= 2
        return found


_SPEEDS = ("stiction_speed", "least_speed", "sliding_speed")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSettings:
    """How to estimate. What is not named otherwise is our choice, from trials with the crane.

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


# The formulas of one sample: arrays over machines or casadi expressions of one (`either`).


def unaccounted(momentum: Any, before: Any, known: Any, dt: float) -> Any:
    """What known forces leave of p' (..., n), the difference of p over a sample of dt [s]."""
    return (momentum - before) / dt - known


def sliding_push(c: Any, pressures: tuple[Any, Any], shape: Any, speed: Any) -> Any:
    """F_p - F_f (..., k) [N] of pistons.

    Args:
        c: the cylinders.
        pressures: of both chambers (..., k) [Pa].
        shape: of Coulomb friction (..., k), from -1 to 1.
        speed: of the pistons (..., k) [m/s].
    """
    return pressure_force(c, *pressures) - c.coulomb_friction * shape - c.viscous_friction * speed


def slid_since(since: Any, rate: Any, before: Any, s: ForceSettings, dt: float) -> Any:
    """For how long pistons (..., k) have been going one way [s], from their filtered rates now and before [m/s]."""
    going = both(absolute(rate) > s.least_speed, rate * before > 0.0)
    return where(going, since + dt, 0.0)


def hidden_friction(c: Any, rate: Any, sliding: Any, s: ForceSettings) -> Any:
    """Coulomb friction (..., k) [N] that pistons may hide, all of it where they do not slide."""
    return c.coulomb_friction * where(sliding, exp(-((rate / s.stiction_speed) ** 2)), 1.0)


def force_from_residual(x: Any, z: Any, residual: Any, variance: Any) -> tuple[Any, Any, Any, Any]:
    """Equation (2): the force that explains residuals (..., n) of variances (..., n) best.

    Args:
        x: J's first row (..., n), of the tool's point along base x.
        z: its second, along base z.
        residual: what is left for J^T f.
        variance: diagonal of W^-1.

    Returns:
        Components (...) of the force along x and z [N], and the variance of each [N^2].
    """
    by_x, by_z = x / variance, z / variance
    xx, xz, zx, zz = dot(by_x, x), dot(by_x, z), dot(by_z, x), dot(by_z, z)
    felt_x, felt_z, determinant = dot(by_x, residual), dot(by_z, residual), xx * zz - xz * zx
    along_x, along_z = (zz * felt_x - xz * felt_z) / determinant, (xx * felt_z - zx * felt_x) / determinant
    return along_x, along_z, zz / determinant, xx / determinant


def standing_out(force: Any, sigma: Any, doubted: float) -> Any:
    """What of forces (..., 2) stands out of their sigma: f d^4 / (1 + d^4), d^2 the sum of (f_i / (doubted sigma_i))^2.

    Our choice, because a law that answers a force which standing pistons only seem to show sets them moving, and the
    force turns round: with its tool in the air the crane swung by 60 mm/s where it should have stood. The fourth power
    leaves 8 kN as they are, to 0.1 %.
    """
    power = square_sum(force / (doubted * sigma)) ** 2
    return force * (power / (1.0 + power))


def force_gain(corner: float, dt: float) -> Gain:
    """Converged gain of a force's two components, `kalman`'s model with a corner [Hz]."""
    one = np.ones(2)
    return steady_gain(one, one * np.sqrt(dt) * (2.0 * np.pi * corner) ** 2, dt)


def joint_force(arms: Float, force: Float) -> Float:
    """R^T F (N, n) of piston forces (N, k) with moment arms R (N, k, n)."""
    result: Float = (np.swapaxes(arms, -1, -2) @ force[..., None])[..., 0]
    return result
