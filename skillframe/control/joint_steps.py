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

from skillframe.frames import Float

TURN_LENGTH = 0.2
"""[m] that makes a turn comparable with a way."""
LEAST_DAMPING, SINGULAR_DAMPING, SINGULAR_BELOW = 1e-3, 0.05, 0.05
"""l far from singularities, l_0 and s_0."""
REFRESH = 20
"""Steps between two looks for singularities."""
POSTURE = 0.5
"""k [1/s]."""
LEASH_SLACK = 5e-3
"""[rad or m] that a command may be ahead besides: sensors, sag."""


class Range(NamedTuple):
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

    def __init__(self, start: Float, limits: Range, delay: float, dt: float) -> None:
        self._home, self._limits, self._dt = start.copy(), limits, dt
        self._leash = limits.velocity * delay + LEASH_SLACK
        self._scale = np.repeat([1.0, TURN_LENGTH], 3)[:, None]
        self._squared = np.full(len(start), LEAST_DAMPING**2)
        self._step = 0

    def velocities(self, twist: Float, jacobian: Float, command: Float, measured: Float) -> tuple[Float, Float]:
        """Joint velocities (N, n) for twists (N, 6), and the twists (N, 6) that they make.

        Args:
            twist: wanted, of the centre of compliance, base axes.
            jacobian: (N, 6, n) at the commanded joints.
            command: (N, n) commanded joints.
            measured: (N, n) joints.
        """
        scaled = jacobian * self._scale
        if self._step % REFRESH == 0:
            self._squared = _damping(scaled)
        self._step += 1
        spare = POSTURE * (self._home - command) if jacobian.shape[-1] > 6 else np.zeros_like(command)
        wanted = twist[..., None] * self._scale
        speed = self._held_to_speed(self._solve(scaled, wanted, spare))
        stuck = self._at_end(command, speed)
        if np.count_nonzero(stuck):
            speed = self._around(scaled, wanted, spare, command, speed, stuck)
        ahead = command - measured
        late = ((np.abs(ahead) > self._leash) & (ahead * speed > 0.0)).any(-1)
        if np.count_nonzero(late):
            speed[late] = 0.0
        return speed, (jacobian @ speed[..., None])[..., 0]

    def _solve(self, jacobian: Float, wanted: Float, spare: Float) -> Float:
        """Damped least squares, (N, n); columns of zeros stay at rest."""
        turned = jacobian.mT
        gram = jacobian @ turned
        gram[:, range(6), range(6)] += self._squared[:, None]
        left = wanted - jacobian @ spare[..., None]
        result: Float = spare + (turned @ np.linalg.solve(gram, left))[..., 0]
        return result

    def _held_to_speed(self, speed: Float) -> Float:
        """Rows scaled so that no joint is above its limit."""
        share = (np.abs(speed) / self._limits.velocity).max(-1)
        return speed / np.maximum(share, 1.0)[:, None]

    def _at_end(self, command: Float, speed: Float) -> NDArray[np.bool_]:
        """(N, n) joints that a step would carry over the end of their range."""
        ahead = command + self._dt * speed
        over: NDArray[np.bool_] = (ahead > self._limits.upper) & (speed > 0.0)
        return over | ((ahead < self._limits.lower) & (speed < 0.0))

    def _around(
        self, jacobian: Float, wanted: Float, spare: Float, command: Float, speed: Float, stuck: NDArray[np.bool_]
    ) -> Float:
        """Velocities of the rows that are stuck, without the joints that are; a joint that gets stuck then as well."""
        rows = stuck.any(-1)
        held = stuck.copy()
        for _ in range(held.shape[-1]):
            free = np.where(held[:, None], 0.0, jacobian)
            again = self._held_to_speed(self._solve(free, wanted, np.where(held, 0.0, spare)))
            speed = np.where(rows[:, None], again, speed)
            more = self._at_end(command, speed) & ~held
            if not np.count_nonzero(more):
                break
            held |= more
            rows |= more.any(-1)
        return np.where(held, 0.0, speed)


def _damping(jacobian: Float) -> Float:
    """(N,) l^2 for Jacobians (N, 6, n) whose turning rows are scaled. What is not finite counts as regular."""
    gram = jacobian @ jacobian.mT
    sound = np.asarray(np.isfinite(gram).all(axis=(-1, -2)))
    least = np.linalg.eigvalsh(np.where(sound[:, None, None], gram, np.eye(6)))[:, 0]
    near = 1.0 - np.clip(least, 0.0, None) / SINGULAR_BELOW**2
    return np.maximum(SINGULAR_DAMPING**2 * near, LEAST_DAMPING**2)
