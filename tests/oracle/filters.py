"""The filters of the force estimate over arrays, a second time: L, its inverse, and the impulse's Kalman filter."""

from __future__ import annotations

import numpy as np
from skillframe_hydraulics.force.damped import share_of
from skillframe_hydraulics.force.impulse import sampled_gains

from skillframe.frames import Float


class CriticallyDamped:
    """L, for arrays of any shape.

    Args:
        corner: [Hz].
        dt: sample time [s].
    """

    def __init__(self, corner: float, dt: float) -> None:
        self._share = share_of(corner, dt)
        self._middle: Float | None = None
        self._value: Float = np.zeros(0)

    def start(self) -> None:
        """Forget the past: the next value is taken over as it is."""
        self._middle = None

    def step(self, value: Float) -> Float:
        """Filtered value, to be read and not kept."""
        if self._middle is None:
            self._middle, self._value = value.copy(), value.copy()
        left = value - self._middle
        left *= self._share
        self._middle += left
        np.subtract(self._middle, self._value, out=left)
        left *= self._share
        self._value += left
        return self._value


class Undamped:
    """Equation (1): the inverse of `CriticallyDamped`; arguments as there."""

    def __init__(self, corner: float, dt: float) -> None:
        self._inverse = 1.0 / share_of(corner, dt)

    def start(self, value: Float) -> None:
        """Begin where L was taken over at a value."""
        self._middle: Float = value.copy()
        self._value: Float = value.copy()

    def step(self, value: Float) -> Float:
        """What L was given when it answered with a value."""
        middle = self._value + self._inverse * (value - self._value)
        result = self._middle + self._inverse * (middle - self._middle)
        self._middle, self._value = middle, value.copy()
        return np.asarray(result)


class ImpulseFilter:
    """The converged filter for N forces in lock-step, each component for itself.

    Args:
        corner: w / 2 pi [Hz], at most a twentieth of the sampling rate: (2) is the gain in continuous time.
        dt: sample time [s].

    Raises:
        SkillframeError: the corner is too high.
    """

    def __init__(self, corner: float, dt: float) -> None:
        self._gains, self._dt = sampled_gains(corner, dt), dt

    def start(self, force: Float) -> None:
        """Begin at a force (N, m) with no slope."""
        self._force: Float = force.copy()
        self._slope, self._once, self._twice = (np.zeros_like(force) for _ in range(3))

    def step(self, force: Float) -> Float:
        """The filtered force (N, m) after a sample of it."""
        h, (to_twice, to_once, to_force, to_slope) = self._dt, self._gains
        left = force - self._force
        error = self._twice + h * self._once + (0.5 * h * h) * left
        self._once = self._once + h * left - to_once * error
        self._twice = error - to_twice * error
        self._force = self._force + h * self._slope + to_force * error
        self._slope = self._slope + to_slope * error
        return self._force

    def ahead(self, time: float) -> Float:
        """The force (N, m) that the slope promises for `time` [s] after the last sample, f + s time."""
        return np.asarray(self._force + time * self._slope)
