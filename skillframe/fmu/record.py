"""One FMU from a table of inputs to a table of outputs, written as it comes: a failure leaves what was reached."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.errors import InputError
from skillframe.files import writing_whole
from skillframe.fmu.allow import is_allowed
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.child import ChildLost
from skillframe.fmu.inspection import FmuFacts, FmuVariable, inspect_fmu
from skillframe.fmu.library import find_fmu
from skillframe.fmu.simulate import Request, check_request, output_columns, simulate
from skillframe.fmu.values import values_of

EXACT = 2.0**53


class RecordedRun(NamedTuple):
    """Columns and number of rows written, and the problem that ended the run early, or ""."""

    columns: list[str]
    rows: int
    problem: str


def simulate_to_csv(
    file: str, stop: float, step: float, out: Path, *, table: Path | None = None,
    settings: dict[str, Any] | None = None, limit_s: float = 30.0,
) -> RecordedRun:  # fmt: skip
    """Simulate an FMU (a name or a file) and write time and every output.

    Raises:
        InputError, UnknownName: before anything is written.
    """
    path = find_fmu(file)
    facts = inspect_fmu(path)
    names, rows = read_inputs(table, facts) if table else ([], [])
    request = Request(path=path, stop=stop, step=step, parameters=settings or {}, input_names=names, input_rows=rows)
    check_request(facts, request)
    if out.is_dir():
        raise InputError(out, "is a folder", "give --out the name of a file")
    return _write(out, ["time", *output_columns(facts)], simulate(request, not is_allowed(path), limit_s))


def _write(out: Path, columns: list[str], rows: Iterator[list[Any]]) -> RecordedRun:
    """Rows as they come. Whatever ends them, those that were reached are kept."""
    count, problem = 0, ""
    other: BaseException | None = None
    with writing_whole(out) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        try:
            for row in rows:
                writer.writerow(row)
                count += 1
        except (InstanceFailed, ChildLost) as error:
            problem = str(error)
        except OSError:  # a full disk: there is no table
            raise
        except BaseException as error:  # raised again once the table is in its place
            other = error
    if other is not None:
        raise other
    return RecordedRun(columns, count, problem)


def read_inputs(path: Path, facts: FmuFacts) -> tuple[list[str], list[list[float]]]:
    """An input table: CSV with a column `time` and one per input.

    Raises:
        InputError: no time, no rows, something that is no number, or time that does not grow.
        UnknownName: a column that is no input.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in csv.reader(file, skipinitialspace=True) if line]
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}", "give a CSV file") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(path, "is not text in UTF-8", "give a CSV file") from None
    if not lines or "time" not in (names := [n.strip() for n in lines[0]]):
        raise InputError(path, "has no column time", "give a CSV with a header: time, then inputs by name")
    if len(lines) < 2:
        raise InputError(path, "has a header and no rows", "add rows")
    at = names.index("time")
    others = [n for i, n in enumerate(names) if i != at]
    for name in others:
        if names.count(name) > 1:
            raise InputError(f"{path}: {name}", "is the name of two columns", "keep one")
        facts.variable(name, "input")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            values = [_cell(x) for x in line]
        except (ValueError, OverflowError):
            raise InputError(f"{path}: line {number}", "holds something that is no number", "correct it") from None
        if len(values) != len(names) or any(x - x != 0.0 for x in values):
            raise InputError(f"{path}: line {number}", f"needs {len(names)} finite numbers", "correct it")
        rows.append([values[at], *(v for i, v in enumerate(values) if i != at)])
        if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
            raise InputError(f"{path}: line {number}", "time does not grow", "sort and remove repeated rows")
    for column, name in enumerate(others, start=1):
        _convertible(path, facts.variables[name], [row[column] for row in rows])
    return others, rows


def _cell(text: str) -> float | int:
    """A number. Whole ones are exact, since a double holds no more than 53 bits of them."""
    number = float(text)
    return int(text) if abs(number) > EXACT and text.strip().lstrip("+-").isdecimal() else number


def _convertible(path: Path, variable: FmuVariable, values: list[float]) -> None:
    """Every value of a column can be one of the input's type. An array is refused later, by name."""
    for value in values if variable.size == 1 and variable.type != "String" else ():
        values_of(variable, value, path)
    if variable.type == "String":
        raise InputError(
            f"{path}: {variable.name}", "is text, and a table holds numbers", "leave it at its start value"
        )
