"""Margins of a skill's trials to their limits: typical and worst trial of each.

Figures are divided by their limits, which makes forces, motors and time comparable. The robot's force limit applies to
the controller's estimate and the simulator's mean over 10 ms, twice the limit to the simulator's peak in one control
tick (`skillframe.control.contact`). Motor shares refer to URDF limits. Distances are limited by zero.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from skillframe.campaign import DURATION_S
from skillframe.execution import DEFINED, ESTIMATE, MEAN, PEAK
from skillframe_reports.markup import Markup, join, note, number, percent, table, tag
from skillframe_reports.results import ResultRow, Results
from skillframe_reports.setup_section import setup_of, table_of
from skillframe_reports.sources import Chapter
from skillframe_reports.typical import typical

SHARE, DISTANCE = re.compile(r"peak_(\w+)_share"), re.compile(r"(\w*(?:distance|clearance)\w*)_m")
SHARES = {"torque": "torque commanded to the most loaded joint", "speed": "speed of the fastest joint"}
OWN = ("final_error_m",)


class Margin(NamedTuple):
    """A figure with a limit.

    Attributes:
        column: of results.csv.
        what: in words.
        unit: for display, with `factor` from the column's.
        factor: from the column's unit to `unit`.
        limit: in the column's unit; 0 for a distance.
        said: the limit in words, if the figure is not enough.
    """

    column: str
    what: str
    unit: str
    factor: float
    limit: float
    said: str = ""


def margins_of(chapter: Chapter, rows: Sequence[ResultRow]) -> list[Margin]:
    """Return the known figures with limits of a skill's trials, nearest first."""
    limit, longest = chapter.force_limit, chapter.spec.get("duration_s", DURATION_S)
    found = []
    if limit:
        found += [
            Margin("peak_force_10ms_n", MEAN, "N", 1.0, limit),
            Margin("peak_force_filtered_n", ESTIMATE, "N", 1.0, limit),
        ]
        above = table_of(setup_of(chapter), "limits").get("transient")
        found += [Margin("peak_force_n", PEAK, "N", 1.0, above * limit)] if isinstance(above, int | float) else []
    columns = dict.fromkeys(name for row in rows for name in row.values)
    for name in columns:
        if share := SHARE.fullmatch(name):
            what = SHARES.get(share[1], f"{share[1].replace('_', ' ')} of the nearest joint")
            found.append(Margin(name, what, "%", 100.0, 1.0, "the URDF's"))
        elif (distance := DISTANCE.fullmatch(name)) and name not in OWN:
            found.append(Margin(name, distance[1].replace("_", " "), "mm", 1e3, 0.0, "touching"))
    if isinstance(longest, int | float) and longest > 0:
        found.append(Margin("duration_s", "simulated time", "s", 1.0, float(longest)))
    nearness = {}  # share of the limit; a distance counts 1 if it is not positive
    for margin in found:
        if _known(rows, margin):
            value = _worst(rows, margin).values[margin.column]
            nearness[margin] = value / margin.limit if margin.limit else float(value <= 0.0)
    return sorted(nearness, key=lambda margin: -nearness[margin])


def _known(rows: Sequence[ResultRow], margin: Margin) -> list[ResultRow]:
    return [row for row in rows if math.isfinite(row.values.get(margin.column, math.nan))]


def _worst(rows: Sequence[ResultRow], margin: Margin) -> ResultRow:
    sign = 1.0 if margin.limit else -1.0
    return max(_known(rows, margin), key=lambda row: (sign * row.values[margin.column], -row.trial))


def margins_table(chapter: Chapter, results: Results, skill: str) -> Markup:
    """Return a table of a skill's limits, nearest first."""
    rows = results.of(skill)
    title, margins = tag("h3", "Which limits were nearest"), margins_of(chapter, rows)
    lacks = [] if chapter.force_limit else ["the force limit (the folder holds no robot.toml that gives one)"]
    for share in SHARES:
        if not any(math.isfinite(row.values.get(f"peak_{share}_share", math.nan)) for row in rows):
            lacks.append(f"the joints' share of {share} (no limit in the URDF, or not in the table)")
    missing = f"Not known: {'; '.join(lacks)}." if lacks else ""
    if not margins:
        return join([title, note(missing or "The table holds nothing that has a limit.")])
    body = []
    for margin in margins:
        middle = typical(rows, margin.column)
        limit = margin.said or f"{number(margin.factor * margin.limit)} {margin.unit}"
        shown = "–" if middle is None else _cell(middle, margin)
        body.append((margin.what, limit, shown, _cell(_worst(rows, margin), margin)))
    first = margins[0]
    row = _worst(rows, first)
    lead = tag(
        "p", f"Nearest of {skill}'s {len(rows)} trials: ", tag("strong", first.what), ", ",
        _share(row, first) + (" of its limit" if first.limit else ""), f" in trial {row.trial}",
        "" if row.success else " (failed)", f". Typical is the trial nearest to the median of that column. {DEFINED}",
    )  # fmt: skip
    head = ("what", "limit", "typical trial", "worst trial")
    listed = table(head, body, numeric=9, class_="margins")
    return join([title, lead, listed, note(missing) if missing else ""])


def _cell(row: ResultRow, margin: Margin) -> Markup:
    figure = "" if not margin.limit or margin.unit == "%" else f"{number(row.values[margin.column])} {margin.unit}, "
    where = tag("span", f"{figure}trial {row.trial}{'' if row.success else ' (failed)'}", class_="faint")
    return join([tag("strong", _share(row, margin)), " ", where])


def _share(row: ResultRow, margin: Margin) -> str:
    value = row.values[margin.column]
    return percent(value / margin.limit) if margin.limit else f"{number(margin.factor * value)} {margin.unit}"
