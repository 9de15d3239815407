"""The one place that relates rates: control, contact, skill, trace; non-integer ratios are refused."""

from __future__ import annotations

from skillframe.errors import SkillframeError


def ratio(fast_hz: float, slow_hz: float, fast: str, slow: str) -> int:
    """How many ticks of the fast clock make one of the slow one.

    Raises:
        SkillframeError: the ratio is not a whole number of at least one.
    """
    value = fast_hz / slow_hz
    count = round(value)
    if count < 1 or abs(value - count) > 1e-9 * value:
        raise SkillframeError(
            f"{fast} at {fast_hz:g} Hz is not a whole multiple of {slow} at {slow_hz:g} Hz; choose rates that divide"
        )
    return count
