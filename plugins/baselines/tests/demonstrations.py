"""Demonstrations of known shape: a tool that comes down from either side of its goal while it is pressed."""

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.frames import quaternion_from_matrix, rotation_matrix

GOAL = np.array([0.4, 0.1, 0.2])
UPSIDE = np.array([np.pi, 0.0, 0.0])


def approach(side, duration=2.0, rate=200.0, pace=1.0, seed=0, end=(0.0, 0.0, 0.0)):
    """A smooth descent of 50 mm with 40 mm to one side and a tilt of 0.2 rad, at rest at both ends.

    Args:
        side: 1 or -1.
        duration: seconds.
        rate: samples per second.
        pace: 1 for minimum jerk; above 1 late, below 1 early.
        seed: of the wrench's noise.
        end: displacement of the goal [m].
    """
    time = np.linspace(0.0, duration, round(duration * rate) + 1)
    u = (time / duration) ** pace
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    position = GOAL + np.array(end) + np.outer(1.0 - s, [0.04 * side, 0.0, 0.05])
    rotation = rotation_matrix(np.outer(1.0 - s, [0.0, 0.2 * side, 0.0])) @ rotation_matrix(UPSIDE)
    wrench = np.random.default_rng(seed).normal(size=(len(time), 6)) * np.repeat([0.05, 0.002], 3)
    wrench[:, 2] += 8.0 * s
    quaternion = quaternion_from_matrix(rotation)
    return Demonstration(time=time, position=position, quaternion=quaternion, wrench=wrench)


def both_sides():
    """One demonstration from each side, at different paces and of different length."""
    return [approach(1.0, pace=1.3), approach(-1.0, duration=2.6, seed=1)]
