r"""Kalman filter of a force from twice differentiated positions, whose noise grows with frequency squared.

The measurement is the double integral Y of the force with white noise r; the force has a random-walk slope:

    Y' = P,   P' = f,   f' = s,   s' = white noise q,        Z = Y + white noise r                                (1)

The converged filter (Kalman and Bucy, J. Basic Eng. 83, 1961) has the poles of a fourth-order Butterworth filter at
\(w = (q / r)^{1/4}\), with gains

    k = (c_1 w, c_2 w^2, c_1 w^3, w^4),    c_1 = 2 sqrt(1 + sqrt(1/2)),   c_2 = 2 + sqrt(2)                       (2)

It follows a ramp without lag, and noise falls by 1/frequency^3. Only errors of Y and P are stored, which stay bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float


def gains(corner: float) -> Float:
    """Gains of equation (2) for w / 2 pi [Hz]."""
    w, first, second = 2.0 * np.pi * corner, 2.0 * np.sqrt(1.0 + np.sqrt(0.5)), 2.0 + np.sqrt(2.0)
    return np.array([first * w, second * w**2, first * w**3, w**4])


def sampled_gains(corner: float, dt: float) -> tuple[float, ...]:
    """The gains for a sample of dt [s].

    Raises:
        SkillframeError: the corner is above a twentieth of the sampling rate, where continuous gains fail.
    """
    if corner * dt > 0.05:
        raise SkillframeError(f"force filter: a corner of {corner:g} Hz needs {20.0 * corner:g} samples a second")
    return tuple(float(k) for k in dt * gains(corner))


class Impulse(NamedTuple):
    """The filter's state, arrays or casadi expressions: f [N], s [N/s], and the errors of P and Y."""

    force: Any
    slope: Any
    once: Any
    twice: Any

    def after(self, shown: Any, dt: float, gain: Sequence[float]) -> Impulse:
        """The state after a sample of the force, with `sampled_gains`."""
        to_twice, to_once, to_force, to_slope = gain
        left = shown - self.force
        error = self.twice + dt * self.once + (0.5 * dt * dt) * left
        return Impulse(
            force=self.force + dt * self.slope + to_force * error, slope=self.slope + to_slope * error,
            once=self.once + dt * left - to_once * error, twice=error - to_twice * error,
        )  # fmt: skip
