"""Simulation of one FMU from an input to an output table, with inputs held over each step and all outputs recorded.

Times are k x step, without a running sum, and end exactly at the stop time.
"""

from __future__ import annotations

import csv
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.errors import InputError
from skillframe.files import writing_whole
from skillframe.fmu.bindings import Instance, InstanceFailed
from skillframe.fmu.build import find_fmu
from skillframe.fmu.child import ChildLost
from skillframe.fmu.extract import forget, is_allowed, is_unpacked, unpack
from skillframe.fmu.facts import FmuFacts, FmuVariable, values_of
from skillframe.fmu.inspection import inspect_fmu


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A simulation.

    Attributes:
        path: the FMU; stop, step: end time and communication step [s]; parameters: by the FMU's names.
        input_names, input_rows: input table, rows of time and values, each held until the next.
    """

    path: Path
    stop: float
    step: float
    parameters: dict[str, Any] = field(default_factory=dict)
    input_names: list[str] = field(default_factory=list)
    input_rows: list[list[float]] = field(default_factory=list)


def output_columns(facts: FmuFacts) -> list[str]:
    """Names of all outputs but binary and clock ones, arrays as name[1], name[2] ..."""
    names: list[str] = []
    for v in _outputs(facts):
        names += [v.name] if v.size == 1 else [f"{v.name}[{i + 1}]" for i in range(v.size)]
    return names


def check_request(facts: FmuFacts, request: Request) -> None:
    """Refuse an invalid request before loading.

    Raises:
        InputError, UnknownName: not runnable here, wrong names or types, or impossible times.
    """
    facts.require_runnable()
    if not (0.0 < request.step <= request.stop < float("inf")):
        raise InputError("--step, --stop", f"{request.step:g} and {request.stop:g} s", "give 0 < step <= stop")
    if not facts.variable_step and not _even(request):
        problem = f"{request.stop:g} s is no whole number of steps of {request.step:g} s"
        raise InputError("--stop", f"{problem}, and {facts.path.name} takes steps of one length", "give a multiple")
    wide = sum(v.size for v in _outputs(facts))
    if wide > 100_000:
        raise InputError(facts.path, f"has outputs of {wide} values in all", "100000 are the most")
    for name, value in request.parameters.items():
        if any(v != v for v in values_of(facts.settable(name), value, facts.path.name)):
            raise InputError(f"{facts.path.name}: {name}", "is not a number (NaN)", "give a number")
    for name in request.input_names:
        if facts.variable(name, "input").size != 1:
            raise InputError(f"--input: {name}", "is an array", "leave it at its start value")


def simulate(request: Request, sandboxed: bool, limit_s: float = 30.0) -> Iterator[list[Any]]:
    """Yield rows of time and outputs, from a child process if sandboxed.

    Raises:
        InputError, UnknownName: before the first row.
        InstanceFailed, ChildLost: the FMU fails, after the rows until then.
    """
    facts = inspect_fmu(request.path)
    check_request(facts, request)
    if not sandboxed:
        yield from run(facts, request)
        return
    from skillframe.fmu.child import Child, SandboxLimits
    from skillframe.fmu.sandbox import loading

    last, before = -1.0, is_unpacked(facts.path)
    unpack(facts.path)
    child = Child(facts.path, facts.name, SandboxLimits(start_s=limit_s))
    try:
        child.tell(b"m", {**loading(facts), "request": {**asdict(request), "path": ""}})
        what, count = "simulating", 0
        while row := child.heard(limit_s, what):
            problem = _wrong(row, facts, request, last) or ("too many rows" if count > _count(request) else "")
            if problem:
                raise child.liar(problem, what)
            last, count = row[0], count + 1
            what = "simulating" if last < request.stop else "being freed after its last step"
            yield row
        if last != request.stop:
            raise child.liar("the end", f"simulating from {max(last, 0.0):.6g} s")
    finally:
        child.close()
        if last < 0.0 and not before:
            forget(facts.path)


def _count(request: Request) -> int:
    return max(1, round(request.stop / request.step)) if _even(request) else int(request.stop / request.step) + 1


_TYPES: dict[str, tuple[type, ...]] = {"Boolean": (bool, int), "String": (str,)}
_TYPES |= dict.fromkeys(("Real", "Float64", "Float32"), (float,))


def _wrong(row: Any, facts: FmuFacts, request: Request, last: float) -> str:
    types: list[tuple[type, ...]] = [(float, int)]
    types += [_TYPES.get(v.type, (int,)) for v in _outputs(facts) for _ in range(v.size)]
    if not isinstance(row, list) or len(row) != len(types):
        return "a row of another length"
    if not all(type(value) in kinds for value, kinds in zip(row, types, strict=True)):
        return "a row of other types"
    if not last <= row[0] <= request.stop:
        return f"a row of {row[0]:.6g} s"
    if any(value - value != 0.0 for value in row if isinstance(value, float)):
        return "numbers that are not finite"
    return ""


def run(facts: FmuFacts, request: Request) -> Iterator[list[Any]]:
    """`simulate` in this process."""
    instance = Instance(facts, facts.name)
    try:
        names = request.input_names
        start = dict(zip(names, _inputs_at(request, 0.0), strict=False))
        instance.start({**request.parameters, **start}, {}, 0.0)
        setters = [facts.variables[name] for name in names]
        yield [0.0, *_read(instance, facts)]
        count = _count(request)
        for k in range(count):
            time, end = k * request.step, min((k + 1) * request.step, request.stop) if k + 1 < count else request.stop
            try:
                for variable, value in zip(setters, _inputs_at(request, time), strict=False):
                    instance.set_value(variable.name, value)
                ended = instance.do_step(time, end - time)
                row = [end if ended is None else ended, *_read(instance, facts)]
            except Exception as error:
                raise InstanceFailed(instance.sentence(f"failed at {time:.6g} s: {error}")) from None
            for name, value in zip(output_columns(facts), row[1:], strict=True):
                if isinstance(value, float) and value - value != 0.0:
                    raise InstanceFailed(instance.sentence(f"output {name} is {value} at {row[0]:.6g} s"))
            yield row
            if ended is not None:
                raise InstanceFailed(instance.sentence(f"terminated the simulation at {ended:.6g} s"))
        instance.end()
    finally:
        instance.close()


def _even(request: Request) -> bool:
    return abs(round(request.stop / request.step) * request.step - request.stop) <= 1e-9 * request.stop


def _inputs_at(request: Request, time: float) -> list[float]:
    if not request.input_rows:
        return []
    times = [row[0] for row in request.input_rows]
    return request.input_rows[max(0, bisect_right(times, time + 1e-12) - 1)][1:]


def _outputs(facts: FmuFacts) -> list[FmuVariable]:
    return [v for v in facts.variables.values() if v.causality == "output" and v.type not in ("Binary", "Clock")]


def _read(instance: Instance, facts: FmuFacts) -> list[Any]:
    values: list[Any] = []
    for v in _outputs(facts):
        got = instance.get_values(v.type, [v.reference], v.size)
        values += [x.decode("utf-8", "replace") if isinstance(x, bytes) else x for x in got]
    return values


class RecordedRun(NamedTuple):
    """Columns, number of rows, and the problem that ended the run, or ""."""

    columns: list[str]
    rows: int
    problem: str


def simulate_to_csv(
    file: str, stop: float, step: float, out: Path, *, table: Path | None = None,
    settings: dict[str, Any] | None = None, limit_s: float = 30.0,
) -> RecordedRun:  # fmt: skip
    """Simulate an FMU (a name or a file) and write time and all outputs.

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
    columns = ["time", *output_columns(facts)]
    found = simulate(request, not is_allowed(path), limit_s)
    count, problem = 0, ""
    other: BaseException | None = None
    with writing_whole(out) as part, part.open("w", newline="", encoding="utf-8") as opened:
        writer = csv.writer(opened)
        writer.writerow(columns)
        try:
            for row in found:
                writer.writerow(row)
                count += 1
        except (InstanceFailed, ChildLost) as error:
            problem = str(error)
        except OSError:
            raise
        except BaseException as error:
            other = error
    if other is not None:
        raise other
    return RecordedRun(columns, count, problem)


def read_inputs(path: Path, facts: FmuFacts) -> tuple[list[str], list[list[float]]]:
    """Input table: CSV with a column `time` and one per input.

    Raises:
        InputError: no time, no rows, invalid numbers, or time does not increase.
        UnknownName: a column is no input.
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
        variable = facts.variables[name]
        values = [row[column] for row in rows]
        for value in values if variable.size == 1 and variable.type != "String" else ():
            values_of(variable, value, path)
        if variable.type == "String":
            raise InputError(
                f"{path}: {variable.name}", "is text, and a table holds numbers", "leave it at its start value"
            )
    return others, rows


def _cell(text: str) -> float | int:
    number = float(text)
    inexact = abs(number) > 2.0**53
    return int(text) if inexact and text.strip().lstrip("+-").isdecimal() else number
