"""Table of trials of several policies: one row per trial and policy, in the order in which they ran.

    trial,policy,success
    0,peg.skill.json,1
    0,replay,0

A campaign's results.csv is such a table. Rows of one trial number share their sampled parameters and form pairs.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign import LEFT_OUT, TRUTH, is_torn, is_trial, real_or_simulated
from skillframe.demonstration import read_text
from skillframe.errors import InputError

POLICY = ("policy", "skill", "method")
"""Accepted names of the policy column."""
STREAM = "stream"
"""Column that says how a row's parameters were chosen."""
SAMPLED = ("", "fresh", "explore")
"""Streams that are random samples, unlike rows that a search picked."""


class Trial(NamedTuple):
    """One row.

    Attributes:
        trial: its number, or another name.
        policy: name of the policy.
        success: whether it succeeded.
        score: its figure; NaN without a score.
    """

    trial: str
    policy: str
    success: bool
    score: float = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """A table.

    Attributes:
        rows: in the table's order.
        policies: in order of appearance.
        doubts: sentences on shortcomings of the table.
        real: every row is marked as a trial of a real robot.
        left_out: number of trials of each policy that a race eliminated.
    """

    rows: tuple[Trial, ...]
    policies: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    real: bool = False
    left_out: Mapping[str, int] = field(default_factory=dict)


def read_trials(path: Path, draws: Sequence[str] = (), score: str | None = None) -> Trials:
    """Return the trials in a file.

    Args:
        path: text with a header, separated by commas, semicolons or tabs. Columns `trial`, `policy` (or `skill`,
            `method`) and `success` (1 or 0, true or false); others are ignored.
        draws: columns of sampled parameters, which must agree between the policies of a trial.
        score: column of a figure, which every trial must have.

    Raises:
        InputError: the file is no such table, a policy ran a trial twice, parameters differ, a search picked rows, real
            and simulated trials are mixed, or a score is missing.
    """
    head, body, torn = cells_of(path)
    columns = dict[str, int]()
    for name in ("trial", "success", *draws, *([score] if score else [])):
        if name not in head:
            raise InputError(path, f"has no column {name}", f"its columns are {', '.join(head)}")
        columns[name] = head.index(name)
    policy = next((head.index(name) for name in POLICY if name in head), None)
    if policy is None:
        raise InputError(path, "has no column policy", f"call one of its columns {', '.join(POLICY)}")
    _check_sampled(path, head, body)
    whole, body = body, [(n, cells) for n, cells in body if is_trial(dict(zip(head, cells, strict=True)))]
    refused = {cells[columns["trial"]] for n, cells in whole} - {cells[columns["trial"]] for n, cells in body}
    real = real_or_simulated(path, head, body)
    rows = tuple(
        Trial(
            cells[columns["trial"]], cells[policy], success_of(path, n, cells[columns["success"]]),
            _score(path, n, score, cells[columns[score]]) if score else math.nan,
        )
        for n, cells in body
    )  # fmt: skip
    numbers = [n for n, _ in body]
    seen: dict[tuple[str, str], int] = {}
    for row, number in zip(rows, numbers, strict=True):
        before = seen.setdefault((row.trial, row.policy), number)
        if before != number:
            raise InputError(
                f"{path}: row {number}", f"is trial {row.trial} of {row.policy} again, after row {before}",
                "a trial that is repeated because of how it ended counts once: keep the first",
            )  # fmt: skip
    _check_draws(path, rows, [[cells[columns[name]] for name in draws] for _, cells in body], draws, numbers)
    policies = tuple(dict.fromkeys(row.policy for row in rows))
    if len(policies) < 2:
        raise InputError(path, f"holds {len(policies)} policy", "compare needs two or more")
    left = _left_out(path, head, body, policy)
    doubts = [
        *(["the last row was cut short and is left out"] if torn else []),
        *_doubts(rows, policies, left, refused),
    ]
    if gone := len(whole) - len(body):
        doubts.append(f"{gone} of {len(whole)} rows are starts inside something: no trials, and in no figure here")
    return Trials(rows=rows, policies=policies, doubts=tuple(doubts), real=real, left_out=left)


def _left_out(path: Path, head: list[str], body: list[tuple[int, list[str]]], policy: int) -> dict[str, int]:
    if LEFT_OUT not in head:
        return {}
    at, found = head.index(LEFT_OUT), dict[str, int]()
    for n, cells in body:
        if cells[at] and not cells[at].isdecimal():
            raise InputError(f"{path}: row {n}", f"{LEFT_OUT} is {cells[at]!r}", "give a number of trials, or nothing")
        if cells[at]:
            found[cells[policy]] = int(cells[at])
    return found


def cells_of(path: Path) -> tuple[list[str], list[tuple[int, list[str]]], bool]:
    """Return the header, the numbered rows, and whether a torn last row was left out.

    Raises:
        InputError: the file is no table.
    """
    text = read_text(path)
    first = text.splitlines()[0]
    parted = max(",;\t", key=first.count)
    try:
        table = [[cell.strip() for cell in cells] for cells in csv.reader(io.StringIO(text), delimiter=parted)]
    except csv.Error as error:
        raise InputError(path, f"cannot be read as a table ({error})", "give CSV with a header") from None
    head, body = table[0], [(n, cells) for n, cells in enumerate(table[1:], start=2) if any(cells)]
    torn = bool(body) and is_torn(head, body[-1][1], text)
    body = body[:-1] if torn else body
    twice = next((name for name in head if name and head.count(name) > 1), None)
    if twice is not None:
        raise InputError(path, f"has two columns {twice}", "rename one of them")
    for n, cells in body:
        if len(cells) != len(head):
            raise InputError(f"{path}: row {n}", f"has {len(cells)} cells, the header {len(head)}", "fix that row")
    return head, body, torn


def success_of(path: Path, number: int, cell: str) -> bool:
    """Return whether a trial succeeded.

    Raises:
        InputError: the cell is not a truth value.
    """
    found = TRUTH.get(cell.lower())
    if found is None:
        raise InputError(f"{path}: row {number}", f"success is {cell!r}", "write 1 or 0, true or false")
    return found


def _score(path: Path, number: int, name: str, cell: str) -> float:
    try:
        found = float(cell)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise InputError(
            f"{path}: row {number}", f"{name} is {cell!r}",
            "give each trial a number, failed ones the worst there is: left out, they would favour who fails more",
        )  # fmt: skip
    return found


def _check_sampled(path: Path, head: list[str], body: list[tuple[int, list[str]]]) -> None:
    if STREAM not in head:
        return
    at = head.index(STREAM)
    for n, cells in body:
        if cells[at] not in SAMPLED:
            raise InputError(
                f"{path}: row {n}", f"is of the stream {cells[at]!r}, whose trials were picked by how others ended",
                "such rows are no sample: leave them out",
            )  # fmt: skip


def _check_draws(
    path: Path, rows: Sequence[Trial], drawn: Sequence[list[str]], names: Sequence[str], numbers: Sequence[int]
) -> None:
    first: dict[str, tuple[int, list[str]]] = {}
    for row, number, values in zip(rows, numbers, drawn, strict=True):
        before, expected = first.setdefault(row.trial, (number, values))
        for name, value, other in zip(names, values, expected, strict=True):
            if value != other:
                raise InputError(
                    f"{path}: row {number}", f"{name} is {value} in trial {row.trial}, and {other} in row {before}",
                    "use one trial number for one sample",
                )  # fmt: skip


def _doubts(
    rows: Sequence[Trial], policies: Sequence[str], left: Mapping[str, int], refused: Set[str]
) -> list[str]:  # fmt: skip
    every = dict.fromkeys(row.trial for row in rows)
    ran = {policy: {row.trial for row in rows if row.policy == policy} for policy in policies}
    said = []
    for policy in policies:
        most = left.get(policy, math.inf)
        missing = [
            trial for trial in every if trial not in ran[policy] and not (trial.isdecimal() and int(trial) >= most)
        ]
        if missing:
            said.append(f"{policy} did not run {_named(missing)}")
    numbers = sorted(int(trial) for trial in every if trial.isdecimal())
    known = {*numbers, *(int(trial) for trial in refused if trial.isdecimal())}
    gaps = sorted(set(range(numbers[0], numbers[-1])) - known) if numbers else []
    if gaps:
        said.append(f"nobody ran {_named([str(n) for n in gaps])}")
    if said:
        said.append("if a trial was left out because of how it ended, no figure here holds")
    return said


def _named(trials: Sequence[str]) -> str:
    shown, left = ", ".join(trials[:5]), len(trials) - 5
    more = f" and {left} more" if left > 0 else ""
    return f"trial {shown}" if len(trials) == 1 else f"trials {shown}{more}"
