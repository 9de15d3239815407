"""A campaign's table `results.csv`: one row a trial and skill, checked. What varied is what the contract leaves open.

Figures are counted from the rows, never taken over from a summary. Which interval and which test they get, and when
they get none, is decided as for summary.json (`campaign.validity`). Of an unfinished campaign a skill's rows count up
to the first trial that is missing. Without a campaign.toml the plan is taken for fixed, and the intervals say so.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign.claims.trials import SOURCE, is_torn, real_or_simulated
from skillframe.campaign.rows import JUDGED, LEFT_OUT, OUTCOME, SCORE, SECOND, TRUTH
from skillframe.campaign.statistics import Interval, correction, holm
from skillframe.campaign.validity import Basis, Plan, Validity, unbroken, validity_of
from skillframe.errors import InputError
from skillframe.execution.tracemeta import SHARE_JOINTS
from skillframe.reports.markup import percent

REQUIRED = ("trial", "skill", "success")
FIXED = (*REQUIRED, "seed", "reason", "stream", SOURCE, LEFT_OUT, *OUTCOME, *JUDGED)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One trial of one skill.

    Attributes:
        values: every other column as a number, NaN where it is empty or text.
        words: the columns that name joints.
    """

    trial: int
    skill: str
    success: bool
    failure: str
    values: Mapping[str, float]
    words: Mapping[str, str] = field(default_factory=dict)


class Rate(NamedTuple):
    """How often it worked, with its 95 % interval, or None where there is none."""

    successes: int
    trials: int
    interval: Interval | None

    @property
    def share(self) -> float:
        """Successes by trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def span(self) -> str:
        """The interval in words, or "" where there is none."""
        return "" if self.interval is None else f"{percent(self.interval.low)} to {percent(self.interval.high)}"


def cause_of(failure: str) -> str:
    """A failure without the clauses that hold figures, which differ from trial to trial.

    "force limit: 80.1 N is above 80 N (at 2.2 s)" and its like are all "force limit"; a link that "is 79 mm inside
    the fixture" loses its depth.
    """
    failure = failure.partition("; ")[0]  # what to do about it is no part of the cause
    clauses = re.split(r"(: |, )", re.sub(r"\s*\(at [^)]*\)|\d+ mm (?=inside the fixture)", "", failure).strip())
    kept = clauses[0]
    for separator, clause in zip(clauses[1::2], clauses[2::2], strict=True):
        kept += "" if re.search(r"\d", clause) else separator + clause
    return kept or "no cause given"


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The whole table.

    Attributes:
        rows: those that count, in the file's order.
        skills: labels in order of appearance.
        varied: names of the quantities that differ between trials.
        validity: what intervals and p-values rest on.
        complete: all planned trials are in the table, as far as the plan is known.
        assumed: nothing is known of the plan; the trials are taken for independent, their number for fixed.
        notes: what was odd about the file.
        real: every row is a trial of a real robot. Such a table grows, so its intervals hold at every look.
        left_out: how many trials the skills ran that a race left out.
    """

    rows: tuple[ResultRow, ...]
    skills: tuple[str, ...]
    varied: tuple[str, ...]
    validity: Validity
    complete: bool = True
    assumed: bool = False
    notes: tuple[str, ...] = ()
    real: bool = False
    left_out: Mapping[str, int] = field(default_factory=dict)

    def mark(self, skill: str) -> str:
        """What a rate of a skill that a race left out is never shown without, or ""."""
        return f", left out after {self.left_out[skill]} trials" if skill in self.left_out else ""

    def of(self, skill: str) -> list[ResultRow]:
        """A skill's rows."""
        return [row for row in self.rows if row.skill == skill]

    def rate(self, skill: str) -> Rate:
        """A skill's success rate."""
        return self.rate_of(self.of(skill))

    def rate_of(self, rows: Sequence[ResultRow]) -> Rate:
        """Success rate of some rows of one skill, picked by what was drawn for them."""
        wins = sum(row.success for row in rows)
        return Rate(wins, len(rows), self.validity.interval(wins, len(rows)))

    @property
    def interval_name(self) -> str:
        """What the intervals are, in words, or "no interval"."""
        if self.validity.basis is Basis.NONE:
            return "no interval"
        fixed = self.validity.basis is Basis.FIXED
        return ("exact 95 % interval" if fixed else "95 % interval, valid at every look") + self.condition

    @property
    def condition(self) -> str:
        """What the intervals assume and nobody has shown, or "" if there is nothing."""
        fixed = "" if self.real else " and their number was fixed beforehand"
        assumed = f" if the trials are independent{fixed}" if self.assumed else ""
        return assumed + (" as of independent draws" if self.validity.note else "")

    def said(self, rate: Rate) -> str:
        """A rate's interval with its name, or that there is none."""
        return f"{self.interval_name}: {rate.span}" if rate.span else self.interval_name

    def compare(self, counts: Sequence[tuple[int, int]]) -> list[float | None]:
        """p-values of "both skills are equally good", one a pair, corrected for their number (Holm).

        Args:
            counts: of each pair of skills, trials that only the first and only the second succeeded in.
        """
        single = [self.validity.p_value(first, second) for first, second in counts]
        known = [p for p in single if p is not None]
        return list(holm(known)) if len(known) == len(single) else list(single)

    def compared_by(self, pairs: int) -> str:
        """The test and the correction for the number of pairs, in words, or why there are no p-values."""
        if self.validity.basis is Basis.NONE:
            return self.validity.test_method
        fixed = self.validity.basis is Basis.FIXED
        test = "McNemar's exact test" if fixed else "McNemar's test in the form that holds at every look"
        corrected = f", {correction(pairs)}" if pairs > 1 else ""
        return f"p{corrected}: chance of such a difference between equally good skills ({test}, two-sided)"

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


def read_results(path: Path, declared: Sequence[str] = (), plan: Plan | None = None) -> Results:
    """The table of a campaign.

    Args:
        path: results.csv.
        declared: quantities that the campaign file names under [vary]; without them, numeric columns that differ.
        plan: what was fixed before the first trial; None if unknown.

    Raises:
        InputError: not a results table, or a cell that cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, f"cannot be read as a table ({error})", "give a campaign's results.csv") from None
    return results_of(text, path, declared, plan)


def results_of(text: str, path: Path, declared: Sequence[str] = (), plan: Plan | None = None) -> Results:
    """As `read_results`, from the text of a table. `path` is where it comes from."""
    try:
        table = list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise InputError(path, f"cannot be read as a table ({error})", "give a campaign's results.csv") from None
    head = table[0] if table else []
    missing = [name for name in REQUIRED if name not in head]
    if missing:
        raise InputError(
            path, f"has no column {', '.join(missing)}", "give a results.csv written by skillframe campaign"
        )
    body, notes = _whole_rows(path, table[1:], head, text)
    rows = tuple(_row(path, number, dict(zip(head, cells, strict=True))) for number, cells in body)
    skills = tuple(dict.fromkeys(row.skill for row in rows))
    real = real_or_simulated(path, head, body)
    varied, validity = _varied(head, rows, declared), Validity(basis=Basis.EVERY_LOOK if real else Basis.FIXED)
    complete = plan is None or len(rows) == plan.trials * plan.skills
    if plan is not None:
        validity = validity_of(plan, complete=complete)
        counted = rows if complete else _counted(rows)
        rows, notes = counted, notes + _left_out(len(rows) - len(counted))
    return Results(
        rows=rows, skills=skills, varied=varied, validity=validity, complete=complete, assumed=plan is None,
        notes=tuple(notes), real=real, left_out=left_out_of((row.skill, row.values.get(LEFT_OUT)) for row in rows),
    )  # fmt: skip


def left_out_of(marks: Iterable[tuple[str, float | None]]) -> dict[str, int]:
    """How many trials skills ran that a race left out, from each row's skill and mark."""
    return {skill: int(after) for skill, after in marks if after is not None and math.isfinite(after)}


def _counted(rows: tuple[ResultRow, ...]) -> tuple[ResultRow, ...]:
    """The rows of each skill up to the first trial that is missing."""
    reach = {skill: unbroken(r.trial for r in rows if r.skill == skill) for skill in {r.skill for r in rows}}
    return tuple(row for row in rows if row.trial < reach[row.skill])


def _left_out(count: int) -> list[str]:
    said = f"{count} finished runs are not counted: trials before them are missing, and which end first is no chance."
    return [said] if count else []


def _whole_rows(
    path: Path, table: list[list[str]], head: list[str], text: str
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Numbered rows of full width. A last line that a kill cut short is left out and said."""
    body = [(number, cells) for number, cells in enumerate(table, start=2) if cells]
    width = len(head)
    torn = bool(body) and (len(body[-1][1]) < width or is_torn(head, body[-1][1], text))
    notes = ["The last row of results.csv was cut short and is left out."] if torn else []
    body = body[:-1] if notes else body
    for number, cells in body:
        if len(cells) != width:
            raise InputError(f"{path}: row {number}", f"has {len(cells)} cells, the header {width}", "fix that row")
    return body, notes


def _row(path: Path, number: int, cells: dict[str, str]) -> ResultRow:
    success = TRUTH.get(cells["success"].strip().lower())
    try:
        trial = int(cells["trial"])
    except ValueError:
        raise InputError(f"{path}: row {number}: trial", f"is {cells['trial']!r}", "give a whole number") from None
    if success is None:
        raise InputError(f"{path}: row {number}: success", f"is {cells['success']!r}", "give 1 or 0")
    values = {key: _float(cell) for key, cell in cells.items() if key not in ("trial", "skill", "success", "failure")}
    return ResultRow(
        trial=trial, skill=cells["skill"], success=success, failure=cells.get("failure", ""), values=values,
        words={key: cells[key] for key in SHARE_JOINTS if key in cells},
    )  # fmt: skip


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _varied(head: Sequence[str], rows: Sequence[ResultRow], declared: Sequence[str]) -> tuple[str, ...]:
    head = [name for name in head if not name.startswith((SCORE, SECOND))]
    known = [name for name in declared if name in head]
    names = known or [name for name in head if name not in FIXED and ("." in name or not declared)]
    return tuple(name for name in names if _differs([row.values.get(name, math.nan) for row in rows]))


def _differs(values: Sequence[float]) -> bool:
    finite = [v for v in values if math.isfinite(v)]
    return len(finite) > 0.5 * len(values) and min(finite) < max(finite)
