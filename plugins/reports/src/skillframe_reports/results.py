"""A campaign's checked table `results.csv`, one row per trial and skill.

Figures are counted from the rows, not taken from a summary. `campaign.statistics` determines intervals and tests. In an
unfinished campaign, a skill's rows count up to its first missing trial. Without campaign.toml, the plan is assumed
fixed, which the intervals state.
"""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign import (
    JUDGED,
    LEFT_OUT,
    OUTCOME,
    SCORE,
    SECOND,
    SOURCE,
    TRUTH,
    Basis,
    Interval,
    Plan,
    Validity,
    cause_of,
    correction,
    holm,
    is_torn,
    is_trial,
    real_or_simulated,
    unbroken,
    validity_of,
)
from skillframe.errors import InputError
from skillframe.execution import SHARE_JOINTS
from skillframe_reports.markup import percent

REQUIRED = ("trial", "skill", "success")
FIXED = (*REQUIRED, "seed", "reason", "stream", SOURCE, LEFT_OUT, *OUTCOME, *JUDGED)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One trial of one skill.

    Attributes:
        values: other columns as numbers, NaN if empty or text.
        words: columns that name joints.
        refused: it began in collision, and is no trial.
    """

    trial: int
    skill: str
    success: bool
    failure: str
    values: Mapping[str, float]
    words: Mapping[str, str] = field(default_factory=dict)
    refused: bool = False


class Rate(NamedTuple):
    """Success count with its 95 % interval, or None."""

    successes: int
    trials: int
    interval: Interval | None

    @property
    def share(self) -> float:
        """Successes over trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def span(self) -> str:
        """The interval in words, or ""."""
        if self.interval is None:
            return ""
        return f"{percent(self.interval.low).removesuffix(' %')}-{percent(self.interval.high)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The whole table.

    Attributes:
        rows: the counted rows in the file's order.
        skills: labels in order of appearance.
        varied: names of the varied quantities.
        validity: basis of intervals and p-values.
        complete: all planned trials are present, as far as known.
        assumed: the plan is unknown; trials are assumed independent, their number fixed.
        notes: irregularities of the file.
        real: every row is a real trial; intervals then hold at every look.
        left_out: number of trials of each skill that a race eliminated.
        refused: number of each skill's starts in collision, which are not in `rows`.
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
    refused: Mapping[str, int] = field(default_factory=dict)

    def mark(self, skill: str) -> str:
        """Return the remark that must accompany a rate: elimination or refused starts, or ""."""
        left = f", left out after {self.left_out[skill]} trials" if skill in self.left_out else ""
        return left + (f", {self.refused[skill]} starts inside something refused" if skill in self.refused else "")

    def of(self, skill: str) -> list[ResultRow]:
        """Return a skill's rows."""
        return [row for row in self.rows if row.skill == skill]

    def rate(self, skill: str) -> Rate:
        """Return a skill's success rate."""
        return self.rate_of(self.of(skill))

    def rate_of(self, rows: Sequence[ResultRow]) -> Rate:
        """Return the success rate of rows that were chosen by their sampled parameters."""
        wins = sum(row.success for row in rows)
        return Rate(wins, len(rows), self.validity.interval(wins, len(rows)))

    @property
    def interval_name(self) -> str:
        """Name of the intervals, or "no interval"."""
        return self.said_of("").replace("  ", " ")

    @property
    def condition(self) -> str:
        """Unproved assumption of the intervals, or ""."""
        fixed = "" if self.real else " and their number was fixed beforehand"
        assumed = f" if the trials are independent{fixed}" if self.assumed else ""
        return assumed + (" as of independent samples" if self.validity.note else "")

    def said(self, rate: Rate) -> str:
        """Return a rate's interval with its name."""
        return self.said_of(rate.span) if rate.span else self.interval_name

    def said_of(self, span: str) -> str:
        """Return the same for an interval in words."""
        if self.validity.basis is Basis.NONE:
            return "no interval"
        kind = "Clopper-Pearson" if self.validity.basis is Basis.FIXED else "valid at every look"
        return f"95 % confidence interval {span} ({kind})"

    def compare(self, counts: Sequence[tuple[int, int]]) -> list[float | None]:
        """Return p-values of "both skills are equally good", one per pair, with Holm's correction."""
        single = [self.validity.p_value(first, second) for first, second in counts]
        known = [p for p in single if p is not None]
        return list(holm(known)) if len(known) == len(single) else list(single)

    def compared_by(self, pairs: int) -> str:
        """Return the test and correction in words, or why there are no p-values."""
        if self.validity.basis is Basis.NONE:
            return self.validity.test_method
        fixed = self.validity.basis is Basis.FIXED
        test = "McNemar's exact test" if fixed else "McNemar's test in the form that holds at every look"
        corrected = f", {correction(pairs)}" if pairs > 1 else ""
        return f"p{corrected}: chance of such a difference between equally good skills ({test}, two-sided)"

    def causes(self, skill: str) -> list[tuple[str, list[int]]]:
        """Return failures by cause, most frequent first, with their trials."""
        lost = [(cause_of(row.failure), row.trial) for row in self.of(skill) if not row.success]
        counts = Counter(cause for cause, _ in lost)
        order = sorted(counts, key=lambda cause: (-counts[cause], cause))
        return [(cause, [trial for c, trial in lost if c == cause]) for cause in order]

    def pairs(self, first: str, second: str) -> tuple[int, int, int, int]:
        """Return counts of trials of both skills: both succeed, only the first, only the second, neither."""
        a = {row.trial: row.success for row in self.of(first)}
        b = {row.trial: row.success for row in self.of(second)}
        counts = Counter((a[t], b[t]) for t in a.keys() & b.keys())
        return counts[True, True], counts[True, False], counts[False, True], counts[False, False]


def read_results(
    path: Path, declared: Sequence[str] = (), plan: Plan | None = None, text: str | None = None
) -> Results:
    """Return the table of a campaign.

    Args:
        path: results.csv, or the origin of `text`.
        declared: quantities under [vary] in the campaign file; without them, numeric columns that differ.
        plan: what was fixed before the first trial; None if unknown.
        text: the table, if it is not in that file.

    Raises:
        InputError: not a results table, or an unreadable cell.
    """
    try:
        text = path.read_text(encoding="utf-8") if text is None else text
        table = list(csv.reader(io.StringIO(text), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
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
    columns = [name for name in head if not name.startswith((SCORE, SECOND))]
    known = [name for name in declared if name in columns]
    names = known or [name for name in columns if name not in FIXED and ("." in name or not declared)]
    varied = tuple(name for name in names if _differs([row.values.get(name, math.nan) for row in rows]))
    validity = Validity(basis=Basis.EVERY_LOOK if real else Basis.FIXED)
    complete = plan is None or len(rows) == plan.trials * plan.skills
    if plan is not None:
        validity = validity_of(plan, complete=complete)
        reach = {s: len(rows) if complete else unbroken(r.trial for r in rows if r.skill == s) for s in skills}
        counted = tuple(row for row in rows if row.trial < reach[row.skill])  # up to the first missing trial
        if left := len(rows) - len(counted):
            notes.append(
                f"{left} finished runs are not counted: trials before them are missing, and which end first is no "
                "chance."
            )
        rows = counted
    if refused := [row for row in rows if row.refused]:
        notes.append(
            f"{len(refused)} of {len(rows)} starts ({percent(len(refused) / len(rows))}) are inside something, and no "
            "trials: every figure here is of the other starts of the declared ranges alone. The first: trial "
            f"{refused[0].trial} {refused[0].failure}."
        )
    rows = tuple(row for row in rows if not row.refused)
    return Results(
        rows=rows, skills=skills, varied=varied, validity=validity, complete=complete, assumed=plan is None,
        notes=tuple(notes), real=real, left_out=left_out_of((row.skill, row.values.get(LEFT_OUT)) for row in rows),
        refused=Counter(row.skill for row in refused),
    )  # fmt: skip


def left_out_of(marks: Iterable[tuple[str, float | None]]) -> dict[str, int]:
    """Return the trials of skills that a race eliminated, from each row's skill and mark."""
    return {skill: int(after) for skill, after in marks if after is not None and math.isfinite(after)}


def _whole_rows(
    path: Path, table: list[list[str]], head: list[str], text: str
) -> tuple[list[tuple[int, list[str]]], list[str]]:
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
    success, refused = TRUTH.get(cells["success"].strip().lower()), not is_trial(cells)
    try:
        trial = int(cells["trial"])
    except ValueError:
        raise InputError(f"{path}: row {number}: trial", f"is {cells['trial']!r}", "give a whole number") from None
    if success is None and not refused:
        raise InputError(f"{path}: row {number}: success", f"is {cells['success']!r}", "give 1 or 0")
    values = {key: _float(cell) for key, cell in cells.items() if key not in ("trial", "skill", "success", "failure")}
    return ResultRow(
        trial=trial, skill=cells["skill"], success=bool(success), failure=cells.get("failure", ""), values=values,
        words={key: cells[key] for key in SHARE_JOINTS if key in cells}, refused=refused,
    )  # fmt: skip


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _differs(values: Sequence[float]) -> bool:
    finite = [v for v in values if math.isfinite(v)]
    return len(finite) > 0.5 * len(values) and min(finite) < max(finite)
