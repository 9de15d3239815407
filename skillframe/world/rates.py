"""The one place that relates rates: control, contact, skill, trace. Non-integer ratios are refused."""

from __future__ import annotations

from skillframe.errors import SkillframeError


def ratio(fast_hz: float, slow_hz: float, fast: str, slow: str) -> int:
    """How many ticks of the fast clock make one of the slow one.

    Raises:
        SkillframeError: a rate that is not positive, or a ratio that is not a whole number of at least one.
    """
    for name, rate in ((fast, fast_hz), (slow, slow_hz)):
        if not 0.0 < rate < float("inf"):
            raise SkillframeError(f"{name} at {rate:g} Hz is no rate; give samples per second, above 0")
    value = fast_hz / slow_hz
    count = round(value)
    if count < 1 or abs(value - count) > 1e-9 * value:
        raise SkillframeError(
            f"{fast} at {fast_hz:g} Hz is not a whole multiple of {slow} at {slow_hz:g} Hz; choose rates that divide"
        )
    return count
