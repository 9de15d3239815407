"""Files of computed rows: `rows/<row>.json` for each when done, `reproduce.json` with all.

The contract has the keys of `reproduce.json`. Pictures are in the rows' files only.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.errors import InputError
from skillframe.extend import RowResult, RowType
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe_papers.jobs import Job

ROWS, TABLE, SUM = "rows", "reproduce.json", "sum"


def entry(row: RowType, job: Job, result: RowResult, wall_s: float, cpu_s: float) -> dict[str, Any]:
    """A computed row as JSON values, with wall and processor time."""
    return {
        "row": row.name, "summary": row.summary, "published": row.published, "source": row.source, "bar": row.bar,
        "ours": result.ours, "verdict": verdict(row, result), "difference": result.difference,
        "values_are": values_are(row, result), "calibrated": row.calibrated, "weak": row.weak,
        "values": {key: float(value) for key, value in result.values.items()},
        "table": {"head": list(result.head), "rows": [list(each) for each in result.rows]},
        "pictures": [picture._asdict() for picture in result.pictures],
        "command": job.command, "seed": job.seed, "quick": job.quick, "settings": dict(job.settings),
        "wall_s": round(wall_s, 2), "cpu_s": round(cpu_s, 2), "group": job.group, "topic": row.topic or row.group,
        "key": job.key,
    }  # fmt: skip


def values_are(row: RowType, result: RowResult) -> str:
    """Origin of the result, in a word."""
    if not result.computed:
        return "not computed"
    if row.calibrated:
        return "calibrated"
    return "predicted" if row.frozen else "chosen together"


def verdict(row: RowType, result: RowResult) -> str:
    """The verdict: a weak row cannot pass, but can fail."""
    return "reported" if row.weak and result.verdict == "pass" else result.verdict


def keep(folder: Path, found: Mapping[str, Any]) -> None:
    """Write one row's file atomically, with a checksum."""
    write_whole(path_of(folder, found["row"]), _text({**found, SUM: _sum(found)}))


def path_of(folder: Path, row: str) -> Path:
    """The file of a row."""
    return folder / ROWS / f"{row}.json"


def kept(folder: Path, job: Job) -> dict[str, Any] | None:
    """A row computed by an equal job, or None, also where the file is damaged."""
    try:
        found = read_json(path_of(folder, job.row), "compute the row again")
    except InputError:
        return None
    if not isinstance(found, dict) or found.get("key") != job.key:
        return None
    written = found.pop(SUM, None)
    return found if written == _sum(found) else None


def write_table(folder: Path, entries: Sequence[Mapping[str, Any]]) -> None:
    """Write `reproduce.json`."""
    write_whole(folder / TABLE, _text(table(entries)))


def table(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The rows without pictures and the store's own keys."""
    return [{key: value for key, value in each.items() if key not in ("pictures", "key")} for each in entries]


def _text(value: Any) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n").encode()


def _sum(found: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:16]
