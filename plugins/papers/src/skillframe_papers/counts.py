"""Counts with their intervals: "34 of 36" is shown as "34 of 36 (81 to 99 %)".

The interval is the exact one of 95 % (Clopper and Pearson 1934), of each count by itself, as of independent trials.
Rows keep what they have counted; tables and pages show it so.
"""

from __future__ import annotations

import re

from skillframe.campaign.statistics import clopper_pearson

SAID = (
    "In brackets behind a count stands its exact interval of 95 % (Clopper and Pearson), of each count by itself and "
    "as of independent trials. What one policy or one set of demonstrations has in common makes it too narrow."
)
_COUNT = re.compile(r"(?<![.\d])\b(\d+) of (\d+)\b(?! \(\d+ to \d+ %\)| is \d+ to \d+ %)")


def with_intervals(text: object) -> str:
    """A text whose counts, "N of M", have their intervals behind them. Those that have one stay as they are."""
    return _COUNT.sub(_told, str(text))


def _told(found: re.Match[str]) -> str:
    hits, count = int(found[1]), int(found[2])
    if not 0 <= hits <= count or count == 0:
        return found[0]
    low, high = clopper_pearson(hits, count)
    return f"{found[0]} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"
