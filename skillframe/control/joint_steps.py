r"""Joint velocities, within the arm's limits, for a twist of the centre of compliance.

    q' = z + J^T (J J^T + l^2 1)^-1 (v - J z),     z = k (q_home - q_c) for arms with more than six joints

This is Nakamura and Hanafusa's damped least squares: l is 1e-3, and near a singularity l^2 = l_0^2 (1 - (s/s_0)^2),
with s the smallest singular value of J. Then q' is scaled to the fastest joint's limit, a joint at the end of its range
stops and the others are solved again, and a command waits while it is further ahead of the joints than the delay
explains. The controller continues from the resulting twist, which prevents windup.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.ticks import compiled_steps
from skillframe.frames import Float

POSTURE = 0.5
"""k [1/s]."""
LEASH_SLACK = 5e-3
"""Lead [rad or m] of a command that is allowed for sensor error and sag."""


class JointRange(NamedTuple):
    """Limits of n joints.

    Attributes:
        velocity: (n,) [rad/s or m/s].
        lower, upper: (n,) [rad or m], infinite where none is given.
    """

    velocity: Float
    lower: Float
    upper: Float


class JointSteps:
    """Joint velocities of N independent arms, whose redundant joints return to `start` (N, n).

    `delay` is T_tot of the arm [s], `dt` the time between two commands [s].
    """

    def __init__(self, start: Float, limits: JointRange, delay: float, dt: float) -> None:
        self._home, self._limits, self._dt = start.copy(), limits, dt
        self._leash = limits.velocity * delay + LEASH_SLACK
        self._scale = np.repeat([1.0, 0.2], 3)[:, None]  # m, makes rotation comparable with translation
        self._every, self._step = max(1, round(0.04 / dt)), 0  # s, in which the posture hardly changes
        self._compiled = compiled_steps(self._home, (*limits, self._leash), POSTURE, dt)

    def velocities(self, twist: Float, jacobian: Float, command: Float, measured: Float) -> tuple[Float, Float]:
        """Joint velocities (N, n) for twists (N, 6), and the twists (N, 6) that they make.

        Twists are of the centre of compliance in base axes, the Jacobian (N, 6, n) is at the commanded joints.
        """
        if self._step % self._every == 0:
            scaled = jacobian * self._scale
            self._squared = _damping(scaled)
            self._inverse = self._inverted(scaled)
        self._step += 1
        compiled = self._compiled
        speed = None if compiled is None else compiled.speed(twist, jacobian, self._inverse, command, measured)
        if speed is None:
            spare = POSTURE * (self._home - command) if jacobian.shape[-1] > 6 else np.zeros_like(command)
            left = twist - (jacobian @ spare[..., None])[..., 0]
            speed = self._held_to_speed(spare + (self._inverse @ left[..., None])[..., 0])
            stuck = self._at_end(command, speed)
            if np.count_nonzero(stuck):
                speed = self._around(jacobian, twist, spare, command, speed, stuck)
            ahead = command - measured
            far = np.abs(ahead) > self._leash
            if np.count_nonzero(far):
                speed[(far & (ahead * speed > 0.0)).any(-1)] = 0.0
        return speed, (jacobian @ speed[..., None])[..., 0]

    def _inverted(self, scaled: Float) -> Float:
        """Damped inverses (N, n, 6) of scaled Jacobians. Columns of zeros give rows of zeros."""
        gram = scaled @ scaled.mT
        gram[:, range(6), range(6)] += self._squared[:, None]
        result: Float = scaled.mT @ np.linalg.inv(gram) * self._scale[:, 0]
        return result

    def _held_to_speed(self, speed: Float) -> Float:
        share = np.abs(speed) / self._limits.velocity
        if share.max() <= 1.0:
            return speed
        result: Float = speed / np.maximum(share.max(-1), 1.0)[:, None]
        return result

    def _at_end(self, command: Float, speed: Float) -> NDArray[np.bool_]:
        """Joints (N, n) that a step would move past the end of their range."""
        ahead = command + self._dt * speed
        over, under = ahead > self._limits.upper, ahead < self._limits.lower
        result: NDArray[np.bool_] = over | under
        return (over & (speed > 0.0)) | (under & (speed < 0.0)) if np.count_nonzero(result) else result

    def _around(
        self, jacobian: Float, twist: Float, spare: Float, command: Float, speed: Float, stuck: NDArray[np.bool_]
    ) -> Float:
        rows: NDArray[np.bool_] = np.asarray(stuck.any(-1))
        held = stuck.copy()
        for _ in range(held.shape[-1]):
            free = np.where(held[:, None], 0.0, jacobian)
            own = np.where(held, 0.0, spare)
            left = twist - (free @ own[..., None])[..., 0]
            again = self._held_to_speed(own + (self._inverted(free * self._scale) @ left[..., None])[..., 0])
            speed = np.where(rows[..., None], again, speed)
            more = self._at_end(command, speed) & ~held
            if not np.count_nonzero(more):
                break
            held |= more
            rows |= more.any(-1)
        return np.where(held, 0.0, speed)


def _damping(jacobian: Float) -> Float:
    """l^2 (N,) for scaled Jacobians (N, 6, n). Jacobians that are not finite count as regular."""
    gram = jacobian @ jacobian.mT
    sound = np.asarray(np.isfinite(gram).all(axis=(-1, -2), keepdims=True))
    least = np.linalg.eigvalsh(np.where(sound, gram, np.eye(6)))[..., 0]
    near = 1.0 - np.clip(least, 0.0, None) / 0.05**2  # s_0
    return np.maximum(0.05**2 * near, (1e-3) ** 2)  # l far from singularities, l_0
