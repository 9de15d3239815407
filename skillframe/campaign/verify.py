"""Checks rows against their campaign when they are read.

A row's trial, skill, seed and samples follow from the campaign file. A row that deviates, a second row of one trial,
and one whose `success` contradicts its `failure` are refused with their line number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign.rows import MEASURES, Row, plain_value
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import InputError

FIX = "put the file back as it was, or delete that line and resume: its trial runs again"
KEYS: dict[str, type | tuple[type, ...]] = {"trial": int, "skill": str}
KINDS = KEYS | {"seed": int, "success": bool, "failure": str}
KINDS |= dict.fromkeys(MEASURES, (int, float))
"""Columns of rows of every version."""


class Line(NamedTuple):
    """A stored row.

    Attributes:
        number: of its line in the file, from 1.
        row: the row.
    """

    number: int
    row: Row


def check_shape(where: str, row: Row, kinds: Mapping[str, type | tuple[type, ...]] = KINDS) -> None:
    """Refuse a row that lacks a required key, or has a value of another type.

    Raises:
        InputError: names the line and the key.
    """
    for key, kind in kinds.items():
        if key not in row:
            raise InputError(where, f"has no {key!r}", FIX)
        if not isinstance(row[key], kind) or (isinstance(row[key], bool) and kind is not bool):
            raise InputError(where, f"{key} is {row[key]!r}", FIX)


def check_rows(path: Path, spec: CampaignSpec, lines: Sequence[Line]) -> None:
    """Refuse rows that are not of this campaign.

    Raises:
        InputError: names the first such line and what is wrong.
    """
    for line in lines:
        problem = next(_problems(spec, line.row), None)
        if problem:
            raise InputError(f"{path}: line {line.number}", problem, FIX)
    trials = sorted({line.row["trial"] for line in lines})
    drawn = {name: dict(zip(trials, values, strict=True)) for name, values in draws(spec, trials).items()}
    for line in lines:
        for name, values in drawn.items():
            meant = plain_value(values[line.row["trial"]])
            if line.row[name] != meant:
                problem = f"{name} is {line.row[name]!r}; trial {line.row['trial']} of this campaign samples {meant!r}"
                raise InputError(f"{path}: line {line.number}", problem, FIX)


def _problems(spec: CampaignSpec, row: Row) -> Iterator[str]:
    if row["skill"] not in spec.labels:
        yield f"its skill {row['skill']!r} is none of this campaign's ({', '.join(spec.labels)})"
    if not 0 <= row["trial"] < spec.trials:
        yield f"trial {row['trial']} is none of this campaign's (0 to {spec.trials - 1})"
    if row["seed"] != spec.seed:
        yield f"its seed is {row['seed']}, the campaign's {spec.seed}"
    if row["success"] == bool(row["failure"]):
        yield f"success is {str(row['success']).lower()}, but its failure says {row['failure']!r}"
    for name in spec.vary:
        if name not in row:
            yield f"has no {name!r}"
