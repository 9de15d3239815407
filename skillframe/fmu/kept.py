"""Banks of actuators kept between runs: opening FMUs takes some tenths of a second, resetting them none to speak of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skillframe.fmu.actuator import Actuators

_KEPT: dict[tuple[Any, ...], Actuators] = {}
KEPT_AT_MOST = 2


def kept(key: tuple[Any, ...], make: Callable[[], Actuators]) -> Actuators:
    """The bank of a key. The same one again if it was among the last asked for."""
    if key not in _KEPT:
        while len(_KEPT) >= KEPT_AT_MOST:
            _KEPT.pop(next(iter(_KEPT))).close()
        _KEPT[key] = make()
    return _KEPT[key]
