"""Directions and speeds in words."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from skillframe.frames import Float

NEAR_AXIS = radians(15.0)


def direction_words(direction: Float) -> str:
    """A direction: "-z" if within 15 degrees of an axis, else its components."""
    k = int(np.argmax(np.abs(direction)))
    if np.arccos(min(1.0, abs(float(direction[k])))) <= NEAR_AXIS:
        return ("-" if direction[k] < 0.0 else "+") + "xyz"[k]
    return "(" + ", ".join(f"{x + 0.0:.2f}" for x in np.round(direction, 2)) + ")"


def axis_words(axis: Float) -> str:
    """The same for an axis, which has no sign."""
    return direction_words(axis).removeprefix("-").removeprefix("+") if _near(axis) else direction_words(axis)


def _near(axis: Float) -> bool:
    return direction_words(axis)[0] in "+-"


def exact_words(direction: Float) -> str:
    """Components, and the angle to the nearest axis."""
    k = int(np.argmax(np.abs(direction)))
    off = degrees(np.arccos(min(1.0, abs(float(direction[k])))))
    name = ("-" if direction[k] < 0.0 else "+") + "xyz"[k]
    components = ", ".join(f"{x + 0.0:.3f}" for x in np.round(direction, 3))
    return f"({components}), {off:.1f} degrees from {name}"


def listed(words: list[str]) -> str:
    """A list in words: "a", "a and b", "a, b and c"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
