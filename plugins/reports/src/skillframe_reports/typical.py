"""Typical trials: those nearest to a median, and the most informative traces.

The typical success has the duration nearest to the median of its skill's successes, since every table has durations and
unusual ones indicate unusual runs. The earlier trial wins ties.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from skillframe.campaign import nearest_to_median
from skillframe.execution import Trace
from skillframe_reports.markup import number
from skillframe_reports.results import ResultRow, Results

Found = tuple[Path, Trace]


def typical(rows: Sequence[ResultRow], column: str) -> ResultRow | None:
    """Return the row nearest to the column's median, or None."""
    trial = nearest_to_median({row.trial: row.values.get(column, math.nan) for row in rows})
    return next((row for row in rows if row.trial == trial), None)


def typical_duration(results: Results | None, skill: str) -> float:
    """Return the median duration of a skill's successes [s], or NaN."""
    rows = [] if results is None else [row for row in results.of(skill) if row.success]
    known = [v for row in rows if math.isfinite(v := row.values.get("duration_s", math.nan))]
    return median(known) if known else math.nan


def telling(found: Sequence[Found], results: Results | None) -> list[Found]:
    """Return the typical success and first failure of each skill, then others, up to four."""
    groups: dict[tuple[str, bool], list[Found]] = {}
    for path, trace in found:
        groups.setdefault((str(trace.meta.get("skill", "")), bool(trace.meta.get("success"))), []).append((path, trace))
    chosen = [_chosen(group, success, results) for (_, success), group in groups.items()][:4]
    names = {path for path, _ in chosen}
    rest = [pair for pair in found if pair[0] not in names]
    return chosen if len(chosen) > 1 else [*chosen, *rest][:2]


def _chosen(group: Sequence[Found], success: bool, results: Results | None) -> Found:
    middle = typical_duration(results, str(group[0][1].meta.get("skill", "")))
    if not success or math.isnan(middle):
        return group[0]
    return min(group, key=lambda pair: _off(pair[1], middle))


def _off(trace: Trace, middle: float) -> tuple[bool, float]:
    """Distance from the typical duration. Runs outside the campaign come last."""
    duration = trace.meta.get("duration_s")
    known = isinstance(duration, int | float) and math.isfinite(duration)
    return trace.meta.get("trial") is None, abs(float(duration) - middle) if known and duration else math.inf


def why_typical(trace: Trace, results: Results | None) -> str:
    """Return why a success is shown, or ""."""
    middle = typical_duration(results, str(trace.meta.get("skill", "")))
    if not trace.meta.get("success") or trace.meta.get("trial") is None or math.isnan(middle):
        return ""
    return f"Of the successes that left a trace the one nearest to their median duration, {number(middle)} s."
