"""The table of a campaign that runs now, or was killed: from its stored rows, for results.csv is written at the end."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.campaign.lock import holder
from skillframe.campaign.race import Race
from skillframe.campaign.rows import EXTRA, LEFT_OUT, Row, cell
from skillframe.campaign.spec import RaceKeys
from skillframe.campaign.store import RESULTS, ROWS, read_content
from skillframe.campaign.summary import SUMMARY, read_summary
from skillframe.config import build
from skillframe.document.source import parse_source
from skillframe.errors import SkillframeError


def runs_now(folder: Path) -> bool:
    """Whether a process is writing this campaign."""
    return holder(folder) is not None


def has_ended(folder: Path) -> bool:
    """Whether nothing will come to a folder by itself: the campaign is complete, or it keeps no rows at all.

    Raises:
        InputError: a damaged summary.json.
    """
    if not (folder / "campaign.toml").is_file() or ((folder / RESULTS).is_file() and not (folder / ROWS).is_file()):
        return True
    return not runs_now(folder) and (folder / SUMMARY).is_file() and read_summary(folder).get("complete") is True


def live_table(folder: Path, skills: Sequence[object], spec: Mapping[str, Any] | None = None) -> str | None:
    """The stored rows as the text of a results.csv. None where results.csv itself is to be read.

    Args:
        folder: of a campaign.
        skills: as its campaign.toml names them, for their order.
        spec: content of its campaign.toml, which says whether it is a race.

    Raises:
        InputError: damaged rows.
    """
    if not (folder / ROWS).is_file() or ((folder / RESULTS).is_file() and not runs_now(folder)):
        return None
    rows = list(read_content(folder).done.values())
    labels = _labels(folder, skills)
    return _text(_raced(rows, labels, spec or {}), labels) if rows else None


def _raced(rows: list[Row], labels: Sequence[str], spec: Mapping[str, Any]) -> list[Row]:
    """The rows of a race that its table will keep so far, those of skills that were left out with their mark."""
    keys, trials = spec.get("race"), spec.get("trials")
    if not isinstance(keys, dict) or not isinstance(trials, int) or not {row["skill"] for row in rows} <= set(labels):
        return rows
    race = Race(labels, trials, build(RaceKeys, keys, "race"))
    race.add(rows)
    gone, reach = race.left, race.reach
    kept = [row for row in rows if row["trial"] < reach[row["skill"]]]
    return [{**row, LEFT_OUT: gone[row["skill"]].after if row["skill"] in gone else ""} for row in kept]


def _labels(folder: Path, skills: Sequence[object]) -> list[str]:
    """What the skills are called in rows. None where one of them cannot be read."""
    try:
        return [parse_source(str(text), folder).label for text in skills]
    except SkillframeError:
        return []


def _text(rows: Sequence[Row], labels: Sequence[str]) -> str:
    order: Mapping[str, int] = {label: i for i, label in enumerate(labels)}
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in EXTRA]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)

    def place(row: Row) -> tuple[Any, ...]:
        return row["trial"], order.get(row["skill"], len(order)), row["skill"]

    writer.writerows([cell(row.get(name, "")) for name in names] for row in sorted(rows, key=place))
    return text.getvalue()
