"""How near a skill's trials came to their limits: the typical and the worst trial of each, by number.

A share is a figure over its limit, so that forces, motors and time stand in one order. The limits are those that end a
trial: the robot's force limit holds for the controller's estimate and for the simulator's mean over 10 ms, and twice it
for the simulator's peak in one control tick (`skillframe.control.contact`); shares of motors are of the URDF's limits.
Columns of a distance have no limit but zero.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from skillframe.campaign.spec import DURATION_S
from skillframe.reports.markup import Markup, join, note, number, percent, table, tag
from skillframe.reports.peaks import DEFINED, ESTIMATE, MEAN, PEAK
from skillframe.reports.results import ResultRow, Results
from skillframe.reports.sources import Chapter
from skillframe.reports.typical import typical
from skillframe.reports.who import setup_of, table_of

SHARE, DISTANCE = re.compile(r"peak_(\w+)_share"), re.compile(r"(\w*(?:distance|clearance)\w*)_m")
SHARES = {"torque": "torque asked of the busiest joint", "speed": "speed of the fastest joint"}
OWN = ("final_error_m",)


class Margin(NamedTuple):
    """One figure that has a limit.

    Attributes:
        column: of results.csv.
        what: in words.
        unit: for people, with `factor` from the column's.
        limit: in the column's unit; 0 for a distance, of which less is worse.
        said: the limit in words, where the figure alone would not do.
    """

    column: str
    what: str
    unit: str
    factor: float
    limit: float
    said: str = ""


def margins_of(chapter: Chapter, rows: Sequence[ResultRow]) -> list[Margin]:
    """What has a limit and is known of a skill's trials, nearest to its limit first."""
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
    known = [margin for margin in found if _known(rows, margin)]
    return sorted(known, key=lambda margin: -_nearness(_worst(rows, margin), margin))


def _known(rows: Sequence[ResultRow], margin: Margin) -> list[ResultRow]:
    return [row for row in rows if math.isfinite(row.values.get(margin.column, math.nan))]


def _worst(rows: Sequence[ResultRow], margin: Margin) -> ResultRow:
    sign = 1.0 if margin.limit else -1.0
    return max(_known(rows, margin), key=lambda row: (sign * row.values[margin.column], -row.trial))


def _nearness(row: ResultRow, margin: Margin) -> float:
    """Share of the limit. A distance counts as far as long as it is positive."""
    value = row.values[margin.column]
    return value / margin.limit if margin.limit else (1.0 if value <= 0.0 else 0.0)


def margins_table(chapter: Chapter, results: Results, skill: str) -> Markup:
    """The limits of a skill's trials, and which was nearest."""
    rows = results.of(skill)
    margins = margins_of(chapter, rows)
    missing = _missing(chapter, rows)
    if not margins:
        return join(
            [tag("h3", "Which limits were nearest"), note(missing or "The table holds nothing that has a limit.")]
        )
    body = []
    for margin in margins:
        middle = typical(rows, margin.column)
        body.append(
            (
                margin.what,
                _limit(margin),
                "–" if middle is None else _cell(middle, margin),
                _cell(_worst(rows, margin), margin),
            )
        )
    first = margins[0]
    lead = tag(
        "p", f"Nearest of {skill}'s {len(rows)} trials: ", tag("strong", first.what), ", ",
        *_words(_worst(rows, first), first), f". Typical is the trial nearest to the median of that column. {DEFINED}",
    )  # fmt: skip
    head = ("what", "limit", "typical trial", "worst trial")
    return join([
        tag("h3", "Which limits were nearest"), lead, table(head, body, numeric=9, class_="margins"),
        note(missing) if missing else "",
    ])  # fmt: skip


def _limit(margin: Margin) -> str:
    return margin.said or f"{number(margin.factor * margin.limit)} {margin.unit}"


def _cell(row: ResultRow, margin: Margin) -> Markup:
    return join([tag("strong", _share(row, margin)), " ", tag("span", _where(row, margin), class_="faint")])


def _words(row: ResultRow, margin: Margin) -> list[object]:
    return [_share(row, margin) + (" of its limit" if margin.limit else ""), f" in trial {row.trial}", _lost(row)]


def _share(row: ResultRow, margin: Margin) -> str:
    value = row.values[margin.column]
    return percent(value / margin.limit) if margin.limit else f"{number(margin.factor * value)} {margin.unit}"


def _where(row: ResultRow, margin: Margin) -> str:
    figure = "" if not margin.limit or margin.unit == "%" else f"{number(row.values[margin.column])} {margin.unit}, "
    return f"{figure}trial {row.trial}{_lost(row)}"


def _lost(row: ResultRow) -> str:
    return "" if row.success else " (failed)"


def _missing(chapter: Chapter, rows: Sequence[ResultRow]) -> str:
    """What nobody can say of this table."""
    lacks = [] if chapter.force_limit else ["the force limit (the folder holds no robot.toml that gives one)"]
    for kind in SHARES:
        if not any(math.isfinite(row.values.get(f"peak_{kind}_share", math.nan)) for row in rows):
            lacks.append(f"the joints' share of {kind} (no limit in the URDF, or not in the table)")
    return f"Not known: {'; '.join(lacks)}." if lacks else ""
