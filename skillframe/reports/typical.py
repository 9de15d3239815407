"""Which trial is typical: the one whose figure is nearest to the median, and of traces those that tell most.

The typical success is the one whose duration is nearest to the median duration of all successes of its skill (our
choice: every table has durations, and an odd one betrays an odd run). Of a tie the earlier trial counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from skillframe.campaign.typical import nearest_to_median
from skillframe.execution.trace import Trace
from skillframe.reports.markup import number
from skillframe.reports.results import ResultRow, Results

MOST_RUNS = 4
Found = tuple[Path, Trace]


def typical(rows: Sequence[ResultRow], column: str) -> ResultRow | None:
    """The row whose value is nearest to the column's median. None without a known value."""
    trial = nearest_to_median({row.trial: row.values.get(column, math.nan) for row in rows})
    return next((row for row in rows if row.trial == trial), None)


def typical_duration(results: Results | None, skill: str) -> float:
    """Median duration of a skill's successes [s], or NaN without a success."""
    rows = [] if results is None else [row for row in results.of(skill) if row.success]
    known = [v for row in rows if math.isfinite(v := row.values.get("duration_s", math.nan))]
    return median(known) if known else math.nan


def telling(found: Sequence[Found], results: Results | None) -> list[Found]:
    """Of a campaign's traces the typical success and the first failure of each skill, then others, up to four."""
    groups: dict[tuple[str, bool], list[Found]] = {}
    for path, trace in found:
        groups.setdefault((str(trace.meta.get("skill", "")), bool(trace.meta.get("success"))), []).append((path, trace))
    chosen = [_chosen(group, success, results) for (_, success), group in groups.items()][:MOST_RUNS]
    names = {path for path, _ in chosen}
    rest = [pair for pair in found if pair[0] not in names]
    return chosen if len(chosen) > 1 else [*chosen, *rest][: min(2, MOST_RUNS)]


def _chosen(group: Sequence[Found], success: bool, results: Results | None) -> Found:
    """The first of a skill's failures, or the success that is nearest to the typical duration."""
    middle = typical_duration(results, str(group[0][1].meta.get("skill", "")))
    if not success or math.isnan(middle):
        return group[0]
    return min(group, key=lambda pair: _off(pair[1], middle))


def _off(trace: Trace, middle: float) -> tuple[bool, float]:
    """How far a run is from the typical duration. Runs beside the campaign come last."""
    duration = trace.meta.get("duration_s")
    known = isinstance(duration, int | float) and math.isfinite(duration)
    return trace.meta.get("trial") is None, abs(float(duration) - middle) if known and duration else math.inf


def why_typical(trace: Trace, results: Results | None) -> str:
    """Why a success of the campaign is shown, in a sentence. "" for other runs."""
    middle = typical_duration(results, str(trace.meta.get("skill", "")))
    if not trace.meta.get("success") or trace.meta.get("trial") is None or math.isnan(middle):
        return ""
    return f"Of the successes that left a trace the one nearest to their median duration, {number(middle)} s."
