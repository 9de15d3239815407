"""An admittance law behind a late arm against a stiff wall, in one dimension: written from the equations, by itself.

    law, every h:      v <- v + h (f + push - D v) / (M + h D),  x_c <- x_c + h v        (K = 0 along the push)
    filter, every 1 ms (if any): the stationary Kalman filter of a value with a wandering slope, corner 25 Hz
    arm, every 1 ms:   x'' = w^2 (x_c(t - T) - x) - 2 zeta w x'    (position),  x'' = w (v(t - T) - x')  (velocity)
    wall:              f = -k x,  of which the law sees the last sample, filtered or not

The arm's step is the matrix exponential's. Linear in its state, so that the monodromy of one h is exact.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm, solve_discrete_are

TICK = 1e-3


class Loop(NamedTuple):
    """Rate of commands [Hz], delay [ms], inner loop's bandwidth [Hz] and damping, virtual mass, wall's stiffness."""

    rate: int = 500
    delay: int = 8
    bandwidth: float = 15.0
    mass: float = 5.0
    stiffness: float = 1e5
    velocity: bool = False
    zeta: float = 0.8
    filtered: bool = False

    @property
    def total_delay(self):
        w = 2 * np.pi * self.bandwidth
        return 1e-3 * self.delay + 0.5 / self.rate + (1.0 if self.velocity else 2.0 * self.zeta) / w


@cache
def arm_step(loop):
    """(2, 3) exact step of (x, x') for a held command."""
    w = 2 * np.pi * loop.bandwidth
    rows = [[0, 1, 0], [0, -w, w], [0, 0, 0]] if loop.velocity else [
        [0, 1, 0], [-w * w, -2 * loop.zeta * w, w * w], [0, 0, 0]]  # fmt: skip
    return expm(np.array(rows) * TICK)[:2]


@cache
def filter_gain():
    """(2,) gain of the Kalman filter with a corner of 25 Hz, from the algebraic Riccati equation; time in ticks."""
    walk = (2 * np.pi * 25.0 * TICK) ** 4  # q^2 h^3 / r^2
    step, noise = np.array([[1.0, 1.0], [0.0, 1.0]]), walk * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    spread = solve_discrete_are(step.T, np.array([[1.0], [0.0]]), noise, np.array([[1.0]]))
    return spread[:, 0] / (spread[0, 0] + 1.0)


def period(state, loop, damping, push=0.0, wall=True):
    """States (n, m) after one h: x, x', v, x_c, filter's value and slope, commands of delay + 1 ms, the oldest last."""
    x, speed, v, commanded, value, slope, *line = state
    ticks, step, (k1, k2) = round(1000 / loop.rate), arm_step(loop), filter_gain()
    h = ticks * TICK
    felt = []
    for tick in range(ticks):
        force = -loop.stiffness * x if wall is True else -loop.stiffness * np.maximum(x, 0.0)
        felt.append(force)
        error = force - (value + slope)
        value, slope = value + slope + k1 * error, slope + k2 * error
        if tick == 0:
            seen = value if loop.filtered else force
            v = v + h * (seen + push - damping * v) / (loop.mass + h * damping)
            commanded = commanded + h * v
        line = [v if loop.velocity else commanded, *line[:-1]]
        x, speed = step @ np.array([x, speed, line[-1]])
    return np.array([x, speed, v, commanded, value, slope, *line]), np.array(felt)


def spectral_radius(loop, damping):
    """Of one period; below 1 the loop is stable. A velocity's commanded place is no part of its loop."""
    size = 6 + loop.delay + 1
    matrix = period(np.eye(size), loop, damping)[0]
    keep = [i for i in range(size) if not (loop.velocity and i == 3)]
    return np.abs(np.linalg.eigvals(matrix[np.ix_(keep, keep)])).max()


def least_damping(loop):
    """The least D that is stable, by bisection to 1e-4."""
    low, high = 1e-3 * loop.stiffness * loop.total_delay, 3.0 * loop.stiffness * loop.total_delay
    while high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if spectral_radius(loop, middle) < 1.0 else (middle, high)
    return high


def formula(loop):
    """The design rule for D_min."""
    late = loop.stiffness * loop.total_delay
    return min(0.57 * late + 0.15 * np.sqrt(loop.stiffness * loop.mass), late)


def touch_down(loop, damping, push, seconds=0.6):
    """Largest contact force after meeting the wall (at x = 0) at the speed push / damping."""
    speed = push / damping
    away = -speed * (0.1 + loop.total_delay)
    ago = np.arange(loop.delay + 1) * TICK
    line = np.full(loop.delay + 1, speed) if loop.velocity else away - speed * ago
    state = np.array([away - speed * loop.total_delay, speed, speed, away, 0.0, 0.0, *line])
    peak = 0.0
    for _ in range(round((seconds + 0.2) * loop.rate)):
        state, felt = period(state, loop, damping, push, wall="one side")
        peak = max(peak, -felt.min())
    return peak
