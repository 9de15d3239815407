"""Simulate one FMU on its own: inputs from a table held over each step, every output recorded.

Times are k x step from the start, never a running sum, and the last step ends exactly at the stop time. Rows are given
one by one, so that an FMU that crashes or hangs takes none of them with it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from skillframe.errors import InputError
from skillframe.fmu.bindings import Instance, InstanceFailed
from skillframe.fmu.extract import forget, is_unpacked, unpack
from skillframe.fmu.inspection import FmuFacts, FmuVariable, inspect_fmu
from skillframe.fmu.values import values_of

MOST_COLUMNS = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to simulate.

    Attributes:
        path: the FMU; stop, step: end time and communication step [s]; parameters: by the FMU's names.
        input_names, input_rows: a table of inputs, each row time then values, held until the next row's time.
    """

    path: Path
    stop: float
    step: float
    parameters: dict[str, Any] = field(default_factory=dict)
    input_names: list[str] = field(default_factory=list)
    input_rows: list[list[float]] = field(default_factory=list)


def output_columns(facts: FmuFacts) -> list[str]:
    """Names of the columns: every output, arrays as name[1], name[2] ... (binary and clock outputs are left out)."""
    names: list[str] = []
    for v in _outputs(facts):
        names += [v.name] if v.size == 1 else [f"{v.name}[{i + 1}]" for i in range(v.size)]
    return names


def check_request(facts: FmuFacts, request: Request) -> None:
    """Refuse what cannot be simulated before anything is loaded.

    Raises:
        InputError, UnknownName: not runnable here, wrong names, values of another type, or impossible times.
    """
    facts.require_runnable()
    if not (0.0 < request.step <= request.stop < float("inf")):
        raise InputError("--step, --stop", f"{request.step:g} and {request.stop:g} s", "give 0 < step <= stop")
    if not facts.variable_step and not _even(request):
        problem = f"{request.stop:g} s is no whole number of steps of {request.step:g} s"
        raise InputError("--stop", f"{problem}, and {facts.path.name} takes steps of one length", "give a multiple")
    wide = sum(v.size for v in _outputs(facts))
    if wide > MOST_COLUMNS:
        raise InputError(facts.path, f"has outputs of {wide} values in all", f"{MOST_COLUMNS} are the most")
    for name, value in request.parameters.items():
        if any(v != v for v in values_of(facts.settable(name), value, facts.path.name)):
            raise InputError(f"{facts.path.name}: {name}", "is not a number (NaN)", "give a number")
    for name in request.input_names:
        if facts.variable(name, "input").size != 1:
            raise InputError(f"--input: {name}", "is an array", "leave it at its start value")


def simulate(request: Request, sandboxed: bool, limit_s: float = 30.0) -> Iterator[list[Any]]:
    """Rows, each time then outputs, from a child process if sandboxed.

    Raises:
        InputError, UnknownName: before the first row.
        InstanceFailed, ChildLost: when the FMU fails; rows until then have been given.
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
    """Steps from the start to the stop time."""
    return max(1, round(request.stop / request.step)) if _even(request) else int(request.stop / request.step) + 1


_TYPES: dict[str, tuple[type, ...]] = {"Boolean": (bool, int), "String": (str,)}
_TYPES |= dict.fromkeys(("Real", "Float64", "Float32"), (float,))


def _wrong(row: Any, facts: FmuFacts, request: Request, last: float) -> str:
    """Why a row that a child sent is none, or "": its length, its time, the types of its values, numbers not finite."""
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
    """As `simulate`, in this process."""
    instance = Instance(facts, facts.name)
    try:
        yield from _rows(instance, facts, request)
    finally:
        instance.close()


def _rows(instance: Instance, facts: FmuFacts, request: Request) -> Iterator[list[Any]]:
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
        _check_finite(instance, facts, row)
        yield row
        if ended is not None:
            raise InstanceFailed(instance.sentence(f"asked to end at {ended:.6g} s"))
    instance.end()


def _even(request: Request) -> bool:
    """Whether the stop time is a whole number of steps."""
    return abs(round(request.stop / request.step) * request.step - request.stop) <= 1e-9 * request.stop


def _inputs_at(request: Request, time: float) -> list[float]:
    """The row of the input table that holds at a time."""
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


def _check_finite(instance: Instance, facts: FmuFacts, row: list[Any]) -> None:
    for name, value in zip(output_columns(facts), row[1:], strict=True):
        if isinstance(value, float) and value - value != 0.0:
            raise InstanceFailed(instance.sentence(f"output {name} is {value} at {row[0]:.6g} s"))
