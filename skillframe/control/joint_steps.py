r"""From a twist of the centre of compliance to joint velocities that an arm can make: the step of an admittance law.

    q' = z + J^T (J J^T + l^2 1)^-1 (v - J z),     z = k (q_home - q_c) for arms with more than six joints

l is 1e-3, and near a singularity l^2 = l_0^2 (1 - (s/s_0)^2) with the smallest singular value s of J, its turning rows
times 0.2 m (Nakamura and Hanafusa's damped least squares; the figures are ours). Then, in this order, and ours:

- the whole of q' is scaled so that the fastest joint is at its limit, which keeps the direction;
- a joint at the end of its range is held, and the others are solved for again;
- a command that runs further ahead of the measured joints than the delay explains is held, until they follow.

What the law goes on with is the twist that these velocities make: otherwise it would wind up against a limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.ticks import compiled_steps
from skillframe.frames import Float

TURN_LENGTH = 0.2
"""[m] that makes a turn comparable with a way."""
LEAST_DAMPING, SINGULAR_DAMPING, SINGULAR_BELOW = 1e-3, 0.05, 0.05
"""l far from singularities, l_0 and s_0."""
REFRESH_S = 0.04
"""[s] between two inverses: the posture hardly changes in 40 ms, and the law goes on with what is really made."""
POSTURE = 0.5
"""k [1/s]."""
LEASH_SLACK = 5e-3
"""[rad or m] that a command may be ahead besides: sensors, sag."""


class JointRange(NamedTuple):
    """Limits of n joints.

    Attributes:
        velocity: (n,) [rad/s or m/s]; lower, upper: (n,) [rad or m]. Infinite where none is given.
    """

    velocity: Float
    lower: Float
    upper: Float


class JointSteps:
    """Joint velocities of N arms. Rows are independent of each other.

    Args:
        start: (N, n) joints where the trials begin, which is also the posture that spare joints return to.
        limits: of the joints.
        delay: T_tot of the arm [s].
        dt: [s] between two commands.
    """

    def __init__(self, start: Float, limits: JointRange, delay: float, dt: float) -> None:
        self._home, self._limits, self._dt = start.copy(), limits, dt
        self._leash = limits.velocity * delay + LEASH_SLACK
        self._scale = np.repeat([1.0, TURN_LENGTH], 3)[:, None]
        self._every, self._step = max(1, round(REFRESH_S / dt)), 0
        self._compiled = compiled_steps(self._home, (*limits, self._leash), POSTURE, dt)

    def velocities(self, twist: Float, jacobian: Float, command: Float, measured: Float) -> tuple[Float, Float]:
        """Joint velocities (N, n) for twists (N, 6), and the twists (N, 6) that they make.

        Args:
            twist: wanted, of the centre of compliance, base axes.
            jacobian: (N, 6, n) at the commanded joints.
            command: (N, n) commanded joints.
            measured: (N, n) joints.
        """
        if self._step % self._every == 0:
            scaled = jacobian * self._scale
            self._squared = _damping(scaled)
            self._inverse = self._inverted(scaled)
        self._step += 1
        speed = self._free(twist, jacobian, command, measured)
        if speed is None:
            speed = self._limited(twist, jacobian, command, measured)
        return speed, (jacobian @ speed[..., None])[..., 0]

    def _free(self, twist: Float, jacobian: Float, command: Float, measured: Float) -> Float | None:
        """Joint velocities where it is sure that none is at a limit."""
        compiled = self._compiled
        return None if compiled is None else compiled.speed(twist, jacobian, self._inverse, command, measured)

    def _limited(self, twist: Float, jacobian: Float, command: Float, measured: Float) -> Float:
        """Joint velocities within all limits."""
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
        return speed

    def _inverted(self, scaled: Float) -> Float:
        """(N, n, 6) damped inverses of Jacobians whose turning rows are scaled. Columns of zeros give rows of zeros."""
        gram = scaled @ scaled.mT
        gram[:, range(6), range(6)] += self._squared[:, None]
        result: Float = scaled.mT @ np.linalg.inv(gram) * self._scale[:, 0]
        return result

    def _held_to_speed(self, speed: Float) -> Float:
        """Rows scaled so that no joint is above its limit."""
        share = np.abs(speed) / self._limits.velocity
        if share.max() <= 1.0:
            return speed
        result: Float = speed / np.maximum(share.max(-1), 1.0)[:, None]
        return result

    def _at_end(self, command: Float, speed: Float) -> NDArray[np.bool_]:
        """(N, n) joints that a step would carry over the end of their range."""
        ahead = command + self._dt * speed
        over, under = ahead > self._limits.upper, ahead < self._limits.lower
        result: NDArray[np.bool_] = over | under
        return (over & (speed > 0.0)) | (under & (speed < 0.0)) if np.count_nonzero(result) else result

    def _around(
        self, jacobian: Float, twist: Float, spare: Float, command: Float, speed: Float, stuck: NDArray[np.bool_]
    ) -> Float:
        """Velocities of the rows that are stuck, without the joints that are. A joint that gets stuck then as well."""
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
    """(N,) l^2 for Jacobians (N, 6, n) whose turning rows are scaled. What is not finite counts as regular."""
    gram = jacobian @ jacobian.mT
    sound = np.asarray(np.isfinite(gram).all(axis=(-1, -2), keepdims=True))
    least = np.linalg.eigvalsh(np.where(sound, gram, np.eye(6)))[..., 0]
    near = 1.0 - np.clip(least, 0.0, None) / SINGULAR_BELOW**2
    return np.maximum(SINGULAR_DAMPING**2 * near, LEAST_DAMPING**2)
