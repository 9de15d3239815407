r"""The filter L(s) = (K / (s + K))^2, two equal poles, and what went into it from what came out, sample by sample.

With the share a = 1 - exp(-K h) of a sample time h both poles are m <- m + a (x - m), v <- v + a (m - v), so that

    m = v_before + (v - v_before) / a,     x = m_before + (m - m_before) / a                                      (1)

give the input back exactly. Alone (1) is of no use: it multiplies noise by 1/a^2; it is one half of a filter whose
other half smooths better than L (`impulse`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.frames import Float


def share_of(corner: float, dt: float) -> float:
    """Share a for a corner K / 2 pi [Hz] and a sample time [s]."""
    return float(-np.expm1(-2.0 * np.pi * corner * dt))


def damped(middle: Any, value: Any, shown: Any, share: float) -> tuple[Any, Any]:
    """Both poles of L after a sample, the second one's value last. Arrays or casadi expressions."""
    middle = middle + share * (shown - middle)
    return middle, value + share * (middle - value)


def undamped(middle: Any, before: Any, value: Any, inverse: float) -> tuple[Any, Any]:
    """Equation (1), arrays or casadi expressions.

    Args:
        middle: the first pole, before.
        before: what L said before.
        value: what L says now.
        inverse: 1/a.

    Returns:
        The first pole now, and what L was shown.
    """
    now = before + inverse * (value - before)
    return now, middle + inverse * (now - middle)


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
        self._middle, self._value = damped(self._middle, self._value, value, self._share)
        return self._value
