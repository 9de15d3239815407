"""Update the committed tables: `make reproduced`, `python -m skillframe_papers.refresh OUT`.

The rows of OUT, a folder of `skillframe reproduce`, replace those of the same number in the full or quick table, from
which the docs are built. Prints computing times.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe_papers import committed, store
from skillframe_papers.jobs import in_order


def merged(old: Sequence[Mapping[str, Any]], new: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Rows by number, new ones in place of old."""
    rows = {each["row"]: each for each in (*old, *new)}
    return [rows[name] for name in in_order(list(rows))]


def times(new: Sequence[Mapping[str, Any]], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Processor and wall time, a line for each new row and one for all."""
    each = [f"row {e['row']}: {e['verdict']}, {e['cpu_s']:.0f} s of processor time, {e['wall_s']:.0f} s" for e in new]
    minutes = sum(e["cpu_s"] for e in rows) / 60.0
    return [*each, f"all {len(rows)} rows: {minutes:.1f} minutes of processor time"]


def refresh(out: Path, folder: Path = committed.FOLDER) -> list[str]:
    """Put a folder's rows into the committed table.

    Args:
        out: folder of `skillframe reproduce`.
        folder: of the committed tables.

    Returns:
        times of rows, a line each.

    Raises:
        InputError: no table in `out`, or a damaged one.
    """
    new = read_json(out / store.TABLE, f"type first: skillframe reproduce --out {out}")
    lines = []
    for quick, name in ((False, "reproduce.json"), (True, "quick.json")):
        chosen = [each for each in new if each["quick"] == quick]
        if not chosen:
            continue
        rows = merged(read_json(folder / name, "install skillframe-papers again"), chosen)
        text = json.dumps(rows, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"
        write_whole(folder / name, text.encode())
        lines += times(chosen, rows)
    return lines


if __name__ == "__main__":
    print("\n".join(refresh(Path(sys.argv[1]))))
