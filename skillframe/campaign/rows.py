"""One row per trial and skill: its columns, their text form, and comparison of rows.

A row is a flat dict: `trial`, `skill`, `seed`, the varied quantities, `OUTCOME`, `JUDGED`, scores, displacements of
second parts, and in rows.jsonl `status` and `reason`. A row whose `ended_by` is "start" is no trial (`is_trial`): it
began in penetration, and its measures are NaN. Rows of version 0.1 have no `JUDGED`. NaN and infinities are stored as
text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import InputError
from skillframe.execution.trace import SHARE_JOINTS
from skillframe.files.documents import shown
from skillframe.skill import Ended

Row = dict[str, Any]  #: a trial by column
MEASURES = ("duration_s", "peak_force_n", "final_error_m", "final_error_rad")
OUTCOME = ("success", "failure", *MEASURES)  #: columns of a trial's outcome
JUDGED_MEASURES = (
    "peak_force_filtered_n", "peak_torque_share", "peak_speed_share", "peak_force_10ms_n", "peak_range_share",
    "distance_to_collision_m",
)  # fmt: skip
ENDS = ("goal_reached", "ended_itself")
"""Both parts of an end: the goal was reached, and the skill ended the trial by itself."""
JUDGED = (
    *JUDGED_MEASURES[:3], "ended_by", *JUDGED_MEASURES[3:5], *SHARE_JOINTS, *ENDS, *JUDGED_MEASURES[5:],
)  # fmt: skip
"""Columns added after version 0.1."""
EXTRA = ("status", "reason")
#: how a file may write true and false
TRUTH = {"1": True, "true": True, "1.0": True, "0": False, "false": False, "0.0": False}
SOURCE, REAL = "source", "real"  #: column that says where a trial ran, and its value for a real robot
"""Column for the origin of a row, and its value for a real robot."""
ENDED_BY = "ended_by"
REFUSED = Ended.START.value
"""`ended_by` of a row that is no trial. Its `success` is empty in results.csv."""
LEFT_OUT = "left_out_after"
"""Column of a race's results.csv: trials that a skill ran before it was left out; empty for the others."""
SCORE = "score."  #: prefix of the columns of scores
SECOND = "second."
"""Prefix of columns of second parts: how far each had moved at the end."""
TRACE = "trace"
"""Key of a row's trace as the bytes of a trace file, removed before the row is stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkJob:
    """Some trials of one skill, the job of a worker.

    Attributes:
        spec: `CampaignSpec.plain()`.
        folder: of the campaign.
        skill: index of the skill.
        trials: trial numbers.
        traces: whether each row carries its trace, as `TRACE`.
    """

    spec: dict[str, Any]
    folder: str
    skill: int
    trials: tuple[int, ...]
    traces: bool = False

    @property
    def size(self) -> int:
        """Number of its rows."""
        return len(self.trials)


def trials_of(job: ChunkJob, spec: CampaignSpec) -> str:
    """The job in words: "trials 0 to 15 of peg.skill.json"."""
    first, last = job.trials[0], job.trials[-1]
    numbers = f"trial {first}" if first == last else f"trials {first} to {last}"
    return f"{numbers} of {spec.labels[job.skill]}"


def columns(spec: CampaignSpec, rows: Iterable[Row] = ()) -> list[str]:
    """Columns of results.csv. Those of second parts are known from the rows alone."""
    second = sorted({name for row in rows for name in row if name.startswith(SECOND)})
    left_out = [LEFT_OUT] if spec.race else []
    return ["trial", "skill", "seed", *spec.vary, *OUTCOME, *JUDGED, *score_columns(spec), *second, *left_out]


def score_columns(spec: CampaignSpec) -> list[str]:
    """Columns of the campaign's scores."""
    return [SCORE + name for name in spec.scores]


def is_trial(row: Mapping[str, Any]) -> bool:
    """Whether a row is a trial, and not a start in penetration."""
    return row.get(ENDED_BY) != REFUSED


def refused(row: Row) -> Row:
    """The row of a refused start: its measures become NaN."""
    measured = (name for name in row if name in (*MEASURES, *JUDGED_MEASURES) or name.startswith((SCORE, SECOND)))
    return row | dict.fromkeys(measured, math.nan)


def rows_of(spec: CampaignSpec, skill: int, trials: tuple[int, ...], outcomes: Mapping[str, Any]) -> list[Row]:
    """Rows, in the order of the trials, from arrays (n,) of `OUTCOME`, `JUDGED`, `EXTRA`, scores and second parts."""
    drawn = draws(spec, trials)
    second = [name for name in outcomes if name.startswith(SECOND)]
    given = {
        name: outcomes[name] for name in (*OUTCOME, *JUDGED, *EXTRA, *score_columns(spec), *second) if name in outcomes
    }
    return [
        {"trial": trial, "skill": spec.labels[skill], "seed": spec.seed}
        | {name: plain_value(values[i]) for name, values in {**drawn, **given}.items()}
        for i, trial in enumerate(trials)
    ]


def dead_row(spec: CampaignSpec, skill: int, trial: int, failure: str) -> Row:
    """The row of a trial that left no outcome."""
    measures = {name: [math.nan] for name in (*MEASURES, *JUDGED_MEASURES, *score_columns(spec))}
    outcome = {"success": [False], "failure": [failure], "ended_by": ["lost"], **measures}
    outcome |= {name: [False] for name in ENDS}
    return rows_of(spec, skill, (trial,), outcome)[0]


def plain_value(value: Any) -> Any:
    """A numpy scalar as a Python value, and text in storable characters."""
    value = value.item() if isinstance(value, np.generic) else value
    return shown(value) if isinstance(value, str) else value


def encode(value: Any) -> Any:
    """A value for JSON: non-finite numbers as text."""
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value


def decode(row: Row) -> Row:
    """The inverse of `encode` for a row."""
    measures = (*MEASURES, *JUDGED_MEASURES)

    def is_number(key: str) -> bool:
        return key in measures or key.startswith((SCORE, SECOND))

    return {key: float(v) if is_number(key) and isinstance(v, str) else v for key, v in row.items()}


def absent(name: str) -> Any:
    """Default of a column that a row lacks."""
    return math.nan if name.startswith(SECOND) else ""


def cell_of(row: Row, name: str) -> str:
    """Text of a row in a column of results.csv."""
    return "" if name == "success" and not is_trial(row) else cell(row.get(name, absent(name)))


def cell(value: Any) -> str:
    """Text of a value in results.csv: 1 or 0 for a bool, exact for a number."""
    if isinstance(value, bool):
        return str(int(value))
    return repr(value) if isinstance(value, float) else str(value)


def differences(stored: Row, again: Row) -> dict[str, tuple[Any, Any]]:
    """Columns of a stored row that are not bit-identical in another run. Two NaN are equal."""
    names = [n for n in stored if n != TRACE]
    return {n: (stored[n], again.get(n)) for n in names if not _same(stored[n], again.get(n))}


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return np.float64(a).tobytes() == np.float64(b).tobytes() or (math.isnan(a) and math.isnan(b))
    return bool(a == b)


def is_torn(head: Sequence[str], last: Sequence[str], text: str) -> bool:
    """Whether a table of real trials was cut short: no line end, and an incomplete last mark."""
    if head[-1] != SOURCE or text.endswith(("\n", "\r")):
        return False
    return len(last) < len(head) or (last[-1] != REAL and REAL.startswith(last[-1]))


def real_or_simulated(path: Path, head: Sequence[str], body: Sequence[tuple[int, Sequence[str]]]) -> bool:
    """Whether all rows are marked as trials of a real robot.

    Raises:
        InputError: real and simulated trials in one table.
    """
    if SOURCE not in head or not body:
        return False
    at = head.index(SOURCE)
    marks = [cells[at].lower() == REAL for _, cells in body]
    for (n, cells), mark in zip(body, marks, strict=True):
        if mark != marks[0]:
            before = f"{body[0][1][at]!r}, and row {n} {cells[at]!r}"
            raise InputError(
                f"{path}: row {n}", f"mixes real and simulated trials (row {body[0][0]} is {before})",
                "no claim holds for both: keep them in two tables",
            )  # fmt: skip
    return marks[0]


def cause_of(failure: str) -> str:
    """A failure without clauses that hold figures, which differ between trials.

    "force limit: 80.1 N is above 80 N (at 2.2 s)" becomes "force limit"; "is 79 mm inside the fixture" loses its depth.
    """
    failure = failure.partition("; ")[0]  # the advice is no part of the cause
    clauses = re.split(r"(: |, )", re.sub(r"\s*\(at [^)]*\)|\d+ mm (?=inside the fixture)", "", failure).strip())
    kept = clauses[0]
    for separator, clause in zip(clauses[1::2], clauses[2::2], strict=True):
        kept += "" if re.search(r"\d", clause) else separator + clause
    return kept or "no cause given"
