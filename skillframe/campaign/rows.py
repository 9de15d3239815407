"""One row a trial and skill: its columns, its text form, and what two of them have to have in common.

A row is a flat dict: `trial`, `skill`, `seed`, every varied quantity, then `OUTCOME` and `JUDGED`, then the scores that
the campaign asks for, then how far second parts of the fixture moved; a stored row also keeps `status` and `reason`. A
row of version 0.1 has no `JUDGED`: those cells stay empty. Numbers that JSON does not know (NaN, infinities) are stored
as text and read back as numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.execution.tracemeta import SHARE_JOINTS
from skillframe.files.documents import shown

Row = dict[str, Any]
MEASURES = ("duration_s", "peak_force_n", "final_error_m", "final_error_rad")
OUTCOME = ("success", "failure", *MEASURES)
JUDGED_MEASURES = (
    "peak_force_filtered_n", "peak_torque_share", "peak_speed_share", "peak_force_10ms_n", "peak_range_share",
    "distance_to_collision_m",
)  # fmt: skip
ENDS = ("goal_reached", "ended_itself")
"""The two halves of an end: the goal held, and the skill itself ended the trial."""
JUDGED = (
    *JUDGED_MEASURES[:3], "ended_by", *JUDGED_MEASURES[3:5], *SHARE_JOINTS, *ENDS, *JUDGED_MEASURES[5:],
)  # fmt: skip
"""What came after version 0.1: what the estimate read, what motors were asked for, and what ended the trial."""
EXTRA = ("status", "reason")
TRUTH = {"1": True, "true": True, "1.0": True, "0": False, "false": False, "0.0": False}
"""How a table may say whether a trial succeeded."""
LEFT_OUT = "left_out_after"
"""Column of a race's results.csv: how many trials a skill ran that was left out; empty for the others."""
SCORE = "score."
"""Begins the columns of scores."""
SECOND = "second."
"""Begins the columns of second parts: how far each had moved at the end."""
TRACE = "trace"
"""Key of a row's trace as the bytes of a trace file, taken out before the row is stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkJob:
    """Some trials of one skill: what a worker is handed.

    Attributes:
        spec: `CampaignSpec.plain()`.
        folder: the campaign's folder, where the spec's relative paths start.
        skill: index of the skill.
        trials: trial numbers.
        traces: whether every row brings its trace, as `TRACE`.
    """

    spec: dict[str, Any]
    folder: str
    skill: int
    trials: tuple[int, ...]
    traces: bool = False

    @property
    def size(self) -> int:
        """How many rows it gives."""
        return len(self.trials)


def trials_of(job: ChunkJob, spec: CampaignSpec) -> str:
    """The job in words: "trials 0 to 15 of peg.skill.json"."""
    first, last = job.trials[0], job.trials[-1]
    numbers = f"trial {first}" if first == last else f"trials {first} to {last}"
    return f"{numbers} of {spec.labels[job.skill]}"


def columns(spec: CampaignSpec, rows: Iterable[Row] = ()) -> list[str]:
    """The columns of results.csv. Those of second parts are the world's, so they are known from its rows alone."""
    second = sorted({name for row in rows for name in row if name.startswith(SECOND)})
    left_out = [LEFT_OUT] if spec.race else []
    return ["trial", "skill", "seed", *spec.vary, *OUTCOME, *JUDGED, *score_columns(spec), *second, *left_out]


def score_columns(spec: CampaignSpec) -> list[str]:
    """The columns of the scores that a campaign asks for."""
    return [SCORE + name for name in spec.scores]


def rows_of(spec: CampaignSpec, skill: int, trials: tuple[int, ...], outcomes: Mapping[str, Any]) -> list[Row]:
    """Rows out of arrays of outcomes, in the order of the trials.

    Args:
        spec: the campaign.
        skill: index of the skill.
        trials: n trial numbers.
        outcomes: `OUTCOME` and, where there are, `JUDGED`, `EXTRA`, columns of scores and of second parts, each (n,).
    """
    drawn = draws(spec, trials)
    second = [name for name in outcomes if name.startswith(SECOND)]
    given = {name: outcomes[name] for name in (*_outcome_names(spec), *second) if name in outcomes}
    return [
        {"trial": trial, "skill": spec.labels[skill], "seed": spec.seed}
        | {name: plain_value(values[i]) for name, values in {**drawn, **given}.items()}
        for i, trial in enumerate(trials)
    ]


def _outcome_names(spec: CampaignSpec) -> tuple[str, ...]:
    return (*OUTCOME, *JUDGED, *EXTRA, *score_columns(spec))


def dead_row(spec: CampaignSpec, skill: int, trial: int, failure: str) -> Row:
    """The row of a trial that left no outcome."""
    measures = {name: [math.nan] for name in (*MEASURES, *JUDGED_MEASURES, *score_columns(spec))}
    outcome = {"success": [False], "failure": [failure], "ended_by": ["lost"], **measures}
    outcome |= {name: [False] for name in ENDS}
    return rows_of(spec, skill, (trial,), outcome)[0]


def plain_value(value: Any) -> Any:
    """A numpy scalar as Python's own. A skill's words as text that can be stored."""
    value = value.item() if isinstance(value, np.generic) else value
    return shown(value) if isinstance(value, str) else value


def encode(value: Any) -> Any:
    """A value for JSON: non-finite numbers as text."""
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value


def decode(row: Row) -> Row:
    """A row as it was before `encode`."""
    measures = (*MEASURES, *JUDGED_MEASURES)

    def is_number(key: str) -> bool:
        return key in measures or key.startswith((SCORE, SECOND))

    return {key: float(v) if is_number(key) and isinstance(v, str) else v for key, v in row.items()}


def absent(name: str) -> Any:
    """What a table says in a column that a row does not have."""
    return math.nan if name.startswith(SECOND) else ""


def cell(value: Any) -> str:
    """A value in results.csv: 1 and 0 for true and false, numbers that round-trip exactly."""
    if isinstance(value, bool):
        return str(int(value))
    return repr(value) if isinstance(value, float) else str(value)


def differences(stored: Row, again: Row) -> dict[str, tuple[Any, Any]]:
    """Columns of a stored row that are not bit-identical when it runs again. Two NaN are the same.

    Columns that the stored row lacks came with a later version.
    """
    names = [n for n in stored if n != TRACE]
    return {n: (stored[n], again.get(n)) for n in names if not _same(stored[n], again.get(n))}


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return np.float64(a).tobytes() == np.float64(b).tobytes() or (math.isnan(a) and math.isnan(b))
    return bool(a == b)
