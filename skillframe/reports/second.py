"""What a run's second parts did, in words: "gear.angle 3.1 degrees"."""

from __future__ import annotations

import math
from collections.abc import Mapping

LENGTHS = ("travel", "moved")


def told_of_second(second: Mapping[str, float | None]) -> list[str]:
    """A few words for each quantity of a trace's `second` [m or rad]. Null is "unknown"."""
    return [f"{name} {_told(name, value)}" for name, value in second.items()]


def _told(name: str, value: float | None) -> str:
    if not isinstance(value, int | float):
        return "unknown"
    if name.rpartition(".")[2] in LENGTHS:
        return f"{1000.0 * value:.2f} mm"
    return f"{math.degrees(value):.1f} degrees"
