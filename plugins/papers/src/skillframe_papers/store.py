"""What is kept of computed rows: `rows/<row>.json` for each as soon as it is there, `reproduce.json` with all of them.

`reproduce.json` holds a list; its keys are in the contract. Pictures stay in the files of the rows.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.errors import InputError
from skillframe.extend.records import RowResult, RowType
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe_papers.jobs import Job

ROWS, TABLE, SUM = "rows", "reproduce.json", "sum"


def entry(row: RowType, job: Job, result: RowResult, wall_s: float, cpu_s: float) -> dict[str, Any]:
    """A computed row as plain JSON values, with what it took: wall time and processor time."""
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
    """Where our figure comes from, in a word."""
    if not result.computed:
        return "not computed"
    if row.calibrated:
        return "calibrated"
    return "predicted" if row.frozen else "chosen together"


def verdict(row: RowType, result: RowResult) -> str:
    """The verdict that counts: reaching a weak row's threshold is no pass, but missing it is a failure."""
    return "reported" if row.weak and result.verdict == "pass" else result.verdict


def keep(folder: Path, found: Mapping[str, Any]) -> None:
    """Write one row's file, whole or not at all, with a checksum of what it says."""
    write_whole(path_of(folder, found["row"]), _text({**found, SUM: _sum(found)}))


def path_of(folder: Path, row: str) -> Path:
    """The file of a row."""
    return folder / ROWS / f"{row}.json"


def kept(folder: Path, job: Job) -> dict[str, Any] | None:
    """A row computed earlier by an equal job, or None. A file that is not as `keep` wrote it is none."""
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
    """The rows without their pictures and what only the store needs."""
    return [{key: value for key, value in each.items() if key not in ("pictures", "key")} for each in entries]


def _text(value: Any) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n").encode()


def _sum(found: Mapping[str, Any]) -> str:
    """Of a row as plain values. Damage may have put in what `keep` never writes."""
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:16]
