"""The table of a campaign that runs now, or was killed: from its stored rows, for results.csv is written at the end."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.campaign.lock import holder
from skillframe.campaign.rows import EXTRA, Row, cell
from skillframe.campaign.store import RESULTS, ROWS, read_content
from skillframe.campaign.summary import SUMMARY, read_summary
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


def live_table(folder: Path, skills: Sequence[object]) -> str | None:
    """The stored rows as the text of a results.csv. None where results.csv itself is to be read.

    Args:
        folder: of a campaign.
        skills: as its campaign.toml names them, for their order.

    Raises:
        InputError: damaged rows.
    """
    if not (folder / ROWS).is_file() or ((folder / RESULTS).is_file() and not runs_now(folder)):
        return None
    rows = list(read_content(folder).done.values())
    return _text(rows, _labels(folder, skills)) if rows else None


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
