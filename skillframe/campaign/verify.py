"""Checks rows against their campaign, and results.csv against its hash, when they are read.

Everything in a row but its outcome follows from the campaign file: the seed, and the draws of that trial. A row whose
trial, skill, seed or draw is another one, a second row of one trial, and one whose `success` and `failure` contradict
each other are refused with the number of their line, for nobody can tell what else was changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.provenance import file_hash
from skillframe.campaign.rows import MEASURES, Row, plain_value
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import InputError

FIX = "put the file back as it was, or delete that line and resume: its trial runs again"
KEYS: dict[str, type | tuple[type, ...]] = {"trial": int, "skill": str}
KINDS = KEYS | {"seed": int, "success": bool, "failure": str}
KINDS |= dict.fromkeys(MEASURES, (int, float))
"""What the rows of every version of campaigns have; columns that came later may be missing."""


class Line(NamedTuple):
    """A row as stored.

    Attributes:
        number: of its line in the file, from 1.
        row: the row.
    """

    number: int
    row: Row


def check_shape(where: str, row: Row, kinds: Mapping[str, type | tuple[type, ...]] = KINDS) -> None:
    """Refuse a row without a key that every campaign's rows have, or with a value of another kind.

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
        InputError: names the first such line and what is wrong with it.
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
                problem = f"{name} is {line.row[name]!r}; trial {line.row['trial']} of this campaign draws {meant!r}"
                raise InputError(f"{path}: line {line.number}", problem, FIX)


def _problems(spec: CampaignSpec, row: Row) -> Iterator[str]:
    """What is wrong with a row, apart from its draws."""
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


def edited_results(folder: Path, summary: Mapping[str, Any] | None) -> str:
    """A sentence if results.csv is not the table that summary.json was written with, else "".

    A summary without the hash (by hand, or damaged) says nothing.
    """
    path = folder / "results.csv"
    hashes = (summary or {}).get("hashes")
    stated = hashes.get(path.name) if isinstance(hashes, dict) else None
    if not isinstance(stated, str) or not path.is_file() or file_hash(path) == stated:
        return ""
    return (
        "results.csv is not as the campaign wrote it: its SHA-256 is not the one in summary.json; "
        "skillframe campaign resume writes it again from rows.jsonl"
    )
