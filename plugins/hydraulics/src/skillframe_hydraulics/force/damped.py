r"""The filter L(s) = (K / (s + K))^2 with two equal poles, and its inverse.

With a = 1 - exp(-K h) for a sample time h both poles are m <- m + a (x - m), v <- v + a (m - v), so that

    m = v_before + (v - v_before) / a,     x = m_before + (m - m_before) / a                                      (1)

recover the input exactly. (1) multiplies noise by 1/a^2, and is followed by a better filter than L (`impulse`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skillframe.frames import Float


def share_of(corner: float, dt: float) -> float:
    """Share a for a corner K / 2 pi [Hz] and a sample time [s]."""
    return float(-np.expm1(-2.0 * np.pi * corner * dt))


def damped(middle: Any, value: Any, shown: Any, share: float) -> tuple[Any, Any]:
    """Both poles of L after a sample, as arrays or casadi expressions."""
    middle = middle + share * (shown - middle)
    return middle, value + share * (middle - value)


def undamped(middle: Any, before: Any, value: Any, inverse: float) -> tuple[Any, Any]:
    """Equation (1): the first pole now and the input of L, from the first pole and the output `before`.

    `inverse` is 1/a. Values are arrays or casadi expressions.
    """
    now = before + inverse * (value - before)
    return now, middle + inverse * (now - middle)


class CriticallyDamped:
    """L, for arrays of any shape, with a corner [Hz] and a sample time [s]."""

    def __init__(self, corner: float, dt: float) -> None:
        self._share = share_of(corner, dt)
        self._middle: Float | None = None
        self._value: Float = np.zeros(0)

    def start(self) -> None:
        """Reset: the next value is taken unfiltered."""
        self._middle = None

    def step(self, value: Float) -> Float:
        """Filtered value, a view."""
        if self._middle is None:
            self._middle, self._value = value.copy(), value.copy()
        self._middle, self._value = damped(self._middle, self._value, value, self._share)
        return self._value

    @property
    def behind(self) -> Float:
        """Output of the first pole less that of the second: half the lag behind a value that changes steadily."""
        return np.zeros(()) if self._middle is None else self._middle - self._value


def noise_passed(order: int, corners: Sequence[float], dt: float, damped: float | None = None) -> float:
    """Standard deviation of unit white noise, differentiated `order` times, behind filters.

    `corners` [Hz] are of `RateFilter`s, `damped` [Hz] is of L.
    """
    points = 4000
    back = np.exp(-2j * np.pi * (np.arange(points) + 0.5) / points / 2.0)  # 1/z at frequencies up to Nyquist's
    step, through = 1.0 - back, np.ones(points, dtype=complex)
    for corner in corners:
        w = 2.0 * np.pi * corner * dt
        through = through * w**2 / (step**2 + (2.0 * w * step + w**2) * back)
    through = through * (step / dt) ** order
    if damped is not None:
        share = share_of(damped, dt)
        through = through * (share / (1.0 - (1.0 - share) * back)) ** 2
    return float(np.sqrt(np.mean(np.abs(through) ** 2)))
