"""Which trial is typical: the one whose figure is nearest to the median, the earlier of two."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median


def nearest_to_median(values: Mapping[int, float]) -> int | None:
    """The trial whose value is nearest to the median of all that are numbers, or None without one.

    Args:
        values: by trial.
    """
    known = {trial: value for trial, value in values.items() if math.isfinite(value)}
    if not known:
        return None
    middle = median(known.values())
    return min(known, key=lambda trial: (abs(known[trial] - middle), trial))
