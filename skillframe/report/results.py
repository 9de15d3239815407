"""A campaign's table `results.csv`: one row a trial and skill, checked; what varied is what the contract leaves open.

Figures are counted from the rows, never taken over from a summary. Where the number of trials was fixed and all of
them ran, a rate's 95 % interval is Clopper and Pearson's exact one and pairs are compared by McNemar's exact test; a
campaign that could stop early, or is read before its end, gets the forms that hold at every look
(`campaign.statistics`).
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign import statistics
from skillframe.errors import InputError

REQUIRED = ("trial", "skill", "success")
FIXED = (*REQUIRED, "seed", "failure", "reason", "duration_s", "peak_force_n", "final_error_m", "final_error_rad")
TRUTH = {"1": True, "true": True, "1.0": True, "0": False, "false": False, "0.0": False}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One trial of one skill; `values` holds every other numeric column, NaN where it is empty or text."""

    trial: int
    skill: str
    success: bool
    failure: str
    values: Mapping[str, float]


class Rate(NamedTuple):
    """How often it worked, with its exact 95 % interval."""

    successes: int
    trials: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Successes by trials."""
        return self.successes / self.trials if self.trials else math.nan


def cause_of(failure: str) -> str:
    """A failure without the clauses that hold figures, which differ from trial to trial.

    "force limit: 80.1 N is above 80 N (at 2.2 s)" and its like are all "force limit".
    """
    clauses = re.split(r"(: |, )", re.sub(r"\s*\(at [^)]*\)", "", failure).strip())
    kept = clauses[0]
    for separator, clause in zip(clauses[1::2], clauses[2::2], strict=True):
        kept += "" if re.search(r"\d", clause) else separator + clause
    return kept or "no cause given"


def rate_of(rows: Sequence[Row], fixed: bool = True) -> Rate:
    """Success rate of rows; without rows the interval is all of 0 to 1.

    Args:
        rows: of one skill.
        fixed: whether their number was fixed beforehand.
    """
    wins, interval = sum(row.success for row in rows), (0.0, 1.0)
    if rows:
        interval = (statistics.clopper_pearson if fixed else statistics.confidence_sequence)(wins, len(rows))
    return Rate(wins, len(rows), *interval)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The whole table.

    Attributes:
        rows: in the file's order.
        skills: labels in order of appearance.
        varied: names of the quantities that differ between trials.
        fixed: the number of trials was fixed beforehand and all of them ran.
        notes: what was odd about the file.
    """

    rows: tuple[Row, ...]
    skills: tuple[str, ...]
    varied: tuple[str, ...]
    fixed: bool = True
    notes: tuple[str, ...] = ()

    def of(self, skill: str) -> list[Row]:
        """A skill's rows."""
        return [row for row in self.rows if row.skill == skill]

    def rate(self, skill: str) -> Rate:
        """A skill's success rate."""
        return rate_of(self.of(skill), self.fixed)

    @property
    def interval_name(self) -> str:
        """What the intervals are, in words."""
        return "exact 95 % interval" if self.fixed else "95 % interval, valid at every look"

    def compare(self, only_first: int, only_second: int) -> float:
        """p-value of "both skills are equally good" from the trials where they differ."""
        test = statistics.mcnemar if self.fixed else statistics.mcnemar_sequential
        return float(test(only_first, only_second))

    def causes(self, skill: str) -> list[tuple[str, list[int]]]:
        """Failures by cause, most frequent first, each with its trials."""
        lost = [(cause_of(row.failure), row.trial) for row in self.of(skill) if not row.success]
        counts = Counter(cause for cause, _ in lost)
        order = sorted(counts, key=lambda cause: (-counts[cause], cause))
        return [(cause, [trial for c, trial in lost if c == cause]) for cause in order]

    def pairs(self, first: str, second: str) -> tuple[int, int, int, int]:
        """Trials of both skills on the same draws: both succeed, only the first, only the second, neither."""
        a = {row.trial: row.success for row in self.of(first)}
        b = {row.trial: row.success for row in self.of(second)}
        counts = Counter((a[t], b[t]) for t in a.keys() & b.keys())
        return counts[True, True], counts[True, False], counts[False, True], counts[False, False]


def read_results(path: Path, declared: Sequence[str] = (), planned: int | None = None) -> Results:
    """The table of a campaign.

    Args:
        path: results.csv.
        declared: quantities that the campaign file names under [vary]; without them, numeric columns that differ.
        planned: trials per skill that were fixed beforehand; 0 if the campaign could stop early, None if unknown.

    Raises:
        InputError: not a results table, or a cell that cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
        table = list(csv.reader(io.StringIO(text), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(path, f"cannot be read as a table ({error})", "give a campaign's results.csv") from None
    head = table[0] if table else []
    missing = [name for name in REQUIRED if name not in head]
    if missing:
        raise InputError(
            path, f"has no column {', '.join(missing)}", "give a results.csv written by skillframe campaign"
        )
    body, notes = _whole_rows(path, table[1:], len(head), text)
    rows = tuple(_row(path, number, dict(zip(head, cells, strict=True))) for number, cells in body)
    skills = tuple(dict.fromkeys(row.skill for row in rows))
    fixed = planned is None or all(sum(row.skill == skill for row in rows) == planned for skill in skills)
    return Results(rows=rows, skills=skills, varied=_varied(head, rows, declared), fixed=fixed, notes=tuple(notes))


def _whole_rows(
    path: Path, table: list[list[str]], width: int, text: str
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Numbered rows of full width; a last line that a kill cut short is left out and said."""
    body = [(number, cells) for number, cells in enumerate(table, start=2) if cells]
    torn = bool(body) and (len(body[-1][1]) < width or not text.endswith("\n"))
    notes = ["The last row of results.csv was cut short and is left out."] if torn and len(body[-1][1]) < width else []
    body = body[:-1] if notes else body
    for number, cells in body:
        if len(cells) != width:
            raise InputError(f"{path}: row {number}", f"has {len(cells)} cells, the header {width}", "mend that row")
    return body, notes


def _row(path: Path, number: int, cells: dict[str, str]) -> Row:
    success = TRUTH.get(cells["success"].strip().lower())
    try:
        trial = int(cells["trial"])
    except ValueError:
        raise InputError(f"{path}: row {number}: trial", f"is {cells['trial']!r}", "give a whole number") from None
    if success is None:
        raise InputError(f"{path}: row {number}: success", f"is {cells['success']!r}", "give 1 or 0")
    values = {key: _float(cell) for key, cell in cells.items() if key not in ("trial", "skill", "success", "failure")}
    return Row(trial=trial, skill=cells["skill"], success=success, failure=cells.get("failure", ""), values=values)


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _varied(head: Sequence[str], rows: Sequence[Row], declared: Sequence[str]) -> tuple[str, ...]:
    known = [name for name in declared if name in head]
    names = known or [name for name in head if name not in FIXED and ("." in name or not declared)]
    return tuple(name for name in names if _differs([row.values.get(name, math.nan) for row in rows]))


def _differs(values: Sequence[float]) -> bool:
    finite = [v for v in values if math.isfinite(v)]
    return len(finite) > 0.5 * len(values) and min(finite) < max(finite)
