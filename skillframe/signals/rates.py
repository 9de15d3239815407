"""A critically damped filter of second order whose state is the rate of what it is shown."""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.frames import Float


def rate_after(value: Any, rate: Any, shown: Any, w: Any, dt: Any) -> tuple[Any, Any]:
    """Value and rate of the filter w^2 / (s + w)^2 after a sample of dt [s]. Arrays or casadi expressions."""
    rate = rate + dt * (w**2 * (shown - value) - 2.0 * w * rate)
    return value + dt * rate, rate


class RateFilter:
    """The filter w^2 / (s + w)^2, element by element, by semi-implicit Euler, stable below w dt = 2 (sqrt(2) - 1).

    Args:
        corner: w / 2 pi [Hz]; dt: [s].

    Attributes:
        value, rate: of what was shown.
    """

    def __init__(self, corner: float, dt: float) -> None:
        self._w, self._dt = 2.0 * np.pi * corner, dt
        self.value: Float = np.zeros(0)
        self.rate: Float = np.zeros(0)

    def start(self, value: Float) -> None:
        """Stand still at a value."""
        self.value, self.rate = value.copy(), np.zeros_like(value)

    def step(self, value: Float) -> Float:
        """The rate after a sample."""
        self.value, self.rate = rate_after(self.value, self.rate, value, self._w, self._dt)
        return self.rate
