"""One definition of a peak of the contact force, in the words that every page, table and command uses.

| column | words | held to |
|---|---|---|
| `peak_force_n` | peak contact force in the simulator: the largest of one control tick | twice the limit |
| `peak_force_10ms_n` | over 10 ms: the largest mean of the simulator's force over any 10 ms | the limit |
| `peak_force_filtered_n` | by the estimate: the largest that the controller's filtered estimate read | the limit |

"Peak" by itself is always the first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

PEAK = "peak contact force in the simulator"
MEAN = "contact force in the simulator over 10 ms"
ESTIMATE = "contact force by the controller's estimate"
DEFINED = "A peak is the largest contact force of one control tick in the simulator."
WORDS = {"peak_force_n": PEAK, "peak_force_10ms_n": "over 10 ms", "peak_force_filtered_n": "by the estimate"}


def said(values: Mapping[str, object], figure: Callable[[float], str]) -> list[str]:
    """The three of a trial that are known, each a phrase with its unit. They belong together in this order.

    Args:
        values: by column.
        figure: writes a number.
    """
    known = {column: value for column in WORDS if (value := _known(values.get(column))) is not None}
    return [f"{WORDS[column]} {figure(value)} N" for column, value in known.items()]


def _known(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
