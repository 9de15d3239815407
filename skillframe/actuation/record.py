"""Write a simulation of one FMU to CSV, row by row as it comes, so that a failure leaves what was reached."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.actuation.allow import is_allowed
from skillframe.actuation.bindings import InstanceFailed
from skillframe.actuation.child import ChildLost
from skillframe.actuation.inspection import inspect_fmu
from skillframe.actuation.library import find_fmu
from skillframe.actuation.simulate import Request, check_request, output_columns, read_inputs, simulate


class Recorded(NamedTuple):
    """Columns and number of rows written; the problem that ended the run early, or ""."""

    columns: list[str]
    rows: int
    problem: str


def simulate_to_csv(
    file: str, stop: float, step: float, out: Path, *, table: Path | None = None,
    settings: dict[str, Any] | None = None, limit_s: float = 30.0,
) -> Recorded:  # fmt: skip
    """Simulate an FMU (a name or a file) and write time and every output.

    Raises:
        InputError, UnknownName: before anything is written.
    """
    path = find_fmu(file)
    facts = inspect_fmu(path)
    names, rows = read_inputs(table, facts) if table else ([], [])
    request = Request(path=path, stop=stop, step=step, parameters=settings or {}, input_names=names, input_rows=rows)
    check_request(facts, request)
    columns = ["time", *output_columns(facts)]
    count, problem = 0, ""
    part = out.with_name(out.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as file_out:
        writer = csv.writer(file_out)
        writer.writerow(columns)
        try:
            for block in simulate(request, sandboxed=not is_allowed(path), limit_s=limit_s):
                writer.writerows(block)
                count += len(block)
        except (InstanceFailed, ChildLost) as error:
            problem = str(error)
    os.replace(part, out)
    return Recorded(columns, count, problem)
