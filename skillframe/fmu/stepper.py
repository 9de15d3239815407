"""Value references of a mapping, and steps by one C call (stepper.c) or, without a compiler, by ctypes calls.

Slots hold prepared addresses, because fmpy's lists would cost more time than the FMU.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.fmu.actuator import DISCARD, ENDED, INPUTS, NOT_FINITE, OUTPUTS, ActuatorSpec
from skillframe.fmu.bindings import Instance
from skillframe.fmu.build import build_source
from skillframe.fmu.facts import FLOATS, FmuFacts, FmuVariable, values_of

Float = NDArray[np.float64]
Step = Callable[[float, float], int]


class Wiring(NamedTuple):
    """An instance's real variables and their columns in `u` and `y`."""

    instance: Instance
    in_refs: list[int]
    in_columns: list[int]
    out_refs: list[int]
    out_columns: list[int]


class Slot(ctypes.Structure):
    """Struct of stepper.c."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in (
            "component", "set", "get", "step", "in_refs", "out_refs", "in_columns", "out_columns", "u", "y")),
        *((name, ctypes.c_int64) for name in ("n_in", "n_out", "version", "status")),
    ]  # fmt: skip


@lru_cache(maxsize=1)
def stepper_library() -> ctypes.CDLL | None:
    """Built stepper, or None."""
    path = build_source(Path(__file__).with_name("stepper.c"))
    return ctypes.CDLL(str(path)) if path else None


class SlotTable:
    """Slots of a bank, with the arrays they point into."""

    def __init__(self, wirings: Sequence[Wiring], u: Float, y: Float) -> None:
        self._keep: list[NDArray[np.generic]] = []
        self.wirings, self.u, self.y = wirings, u, y
        self.slots = (Slot * max(len(wirings), 1))()
        for slot, wiring, row_u, row_y in zip(self.slots, wirings, u, y, strict=False):
            instance = wiring.instance
            slot.component, slot.version = instance.component, instance.version
            slot.set = instance.address("fmi2SetReal", "fmi3SetFloat64")
            slot.get = instance.address("fmi2GetReal", "fmi3GetFloat64")
            slot.step = instance.address("fmi2DoStep", "fmi3DoStep")
            slot.in_refs, slot.out_refs = (self._pin(refs, np.uint32) for refs in (wiring.in_refs, wiring.out_refs))
            slot.in_columns = self._pin(wiring.in_columns, np.int64)
            slot.out_columns = self._pin(wiring.out_columns, np.int64)
            slot.u, slot.y = row_u.ctypes.data, row_y.ctypes.data
            slot.n_in, slot.n_out = len(wiring.in_refs), len(wiring.out_refs)

    def _pin(self, numbers: list[int], dtype: type[np.generic]) -> int:
        array = np.array(numbers or [0], dtype=dtype)
        self._keep.append(array)
        return int(array.ctypes.data)

    def statuses(self) -> list[int]:
        """Status of every slot."""
        return [int(self.slots[i].status) for i in range(len(self.wirings))]


def compiled_step(table: SlotTable, active: NDArray[np.uint8]) -> Step | None:
    """C function (time, step) -> worst status over all slots, or None."""
    library = stepper_library()
    if library is None:
        return None
    function = library.skillframe_step
    function.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_double, ctypes.c_double]
    slots, count, flags = ctypes.addressof(table.slots), len(table.wirings), active.ctypes.data
    return lambda time, step: function(slots, count, flags, time, step)  # type: ignore[no-any-return]


def native_step(table: SlotTable) -> tuple[int, int, int] | None:
    """Address and number of the slots, and address of their C step function, or None."""
    library = stepper_library()
    if library is None:
        return None
    function = ctypes.cast(library.skillframe_step, ctypes.c_void_p).value or 0
    return ctypes.addressof(table.slots), len(table.wirings), function


def python_step(table: SlotTable, active: NDArray[np.uint8]) -> Step:
    """`compiled_step` by cached ctypes calls."""
    now, length = ctypes.c_double(), ctypes.c_double()
    cells = [(i, _cell(table, i, now, length)) for i in range(len(table.wirings))]
    flags, slots = active.data, table.slots

    def step_all(time: float, step: float) -> int:
        worst, now.value, length.value = 0, time, step
        moving = step > 0.0
        for i, step_cell in cells:
            if flags[i]:
                status = step_cell(moving)
                if status >= DISCARD:
                    slots[i].status = status
                if status > worst:
                    worst = status
        return worst

    return step_all


def _cell(table: SlotTable, index: int, now: ctypes.c_double, length: ctypes.c_double) -> Callable[[bool], int]:
    """One slot as a closure over ctypes objects, which avoids conversions."""
    slot, wiring = table.slots[index], table.wirings[index]
    put, take, go = (ctypes.PYFUNCTYPE(ctypes.c_int)(address) for address in (slot.set, slot.get, slot.step))
    gather, values = _moved(table.u[index], wiring.in_columns)
    scatter, taken = _moved(table.y[index], wiring.out_columns)
    component, three, numbers = ctypes.c_void_p(slot.component), slot.version == 3, taken.data
    n_in, n_out = ctypes.c_size_t(slot.n_in), ctypes.c_size_t(slot.n_out)
    put_args = [component, ctypes.c_void_p(slot.in_refs), n_in, ctypes.c_void_p(values.ctypes.data), *[n_in] * three]
    take_args = [component, ctypes.c_void_p(slot.out_refs), n_out, ctypes.c_void_p(taken.ctypes.data), *[n_out] * three]
    flags, last = (ctypes.c_bool * 3)(), ctypes.c_double()
    base, yes = ctypes.addressof(flags), ctypes.c_int(1)
    outcome = [*(ctypes.c_void_p(base + k) for k in range(3)), ctypes.byref(last)] if three else []
    go_args = [component, now, length, yes, *outcome]

    def advance(moving: bool) -> int:
        if gather:
            gather[0][:] = gather[1][gather[2]]
        status: int = put(*put_args)
        if moving and status < DISCARD:
            status = go(*go_args) or status
            if three and (flags[1] or flags[2]):
                status = max(status, DISCARD if flags[2] else ENDED)
        if status >= DISCARD:
            return status
        status = take(*take_args) or status
        if scatter:
            scatter[1][scatter[2]] = scatter[0]
        total = sum(numbers)
        return status if total - total == 0.0 or status >= DISCARD else NOT_FINITE

    return advance


_Move = tuple[Float, Float, NDArray[np.int64]] | None


def _moved(row: Float, chosen: list[int]) -> tuple[_Move, Float]:
    if chosen and chosen == list(range(chosen[0], chosen[0] + len(chosen))):
        return None, row[chosen[0] : chosen[0] + len(chosen)]
    buffer = np.zeros(len(chosen))
    return (buffer, row, np.array(chosen, dtype=np.int64)), buffer


def mapping(spec: ActuatorSpec, facts: FmuFacts) -> tuple[dict[str, FmuVariable], dict[str, FmuVariable]]:
    """Mapped inputs and outputs of an FMU.

    Raises:
        UnknownName: a mapped name that the FMU lacks.
        InputError: no input, no force, a variable that is no real scalar, or a parameter of the wrong type.
    """
    chosen_in = spec.inputs or {n: n for n in INPUTS if n in facts.names("input")}
    chosen_out = spec.outputs or {n: n for n in OUTPUTS if n in facts.names("output")}
    inputs = {ours: _scalar(facts, theirs, "input") for ours, theirs in chosen_in.items()}
    outputs = {ours: _scalar(facts, theirs, "output") for ours, theirs in chosen_out.items()}
    where = f"{spec.name or facts.name} ({facts.path.name})"
    if not inputs:
        known = ", ".join(facts.names("input")) or "none"
        raise InputError(where, f"no input is mapped (it has: {known})", 'add inputs = { command = "..." }')
    if "force" not in outputs:
        known = ", ".join(facts.names("output")) or "none"
        raise InputError(where, f"no output is mapped to force (it has: {known})", 'add outputs = { force = "..." }')
    for name in spec.parameters:
        values_of(facts.variable(name, "parameter"), spec.parameters[name], where)
    return inputs, outputs


def _scalar(facts: FmuFacts, name: str, causality: str) -> FmuVariable:
    variable = facts.variable(name, causality)
    if variable.type not in FLOATS or variable.size != 1:
        what = f"an array of {variable.size}" if variable.size != 1 else f"of type {variable.type}"
        raise InputError(
            f"{facts.path.name}: {name}", f"is {what}; a mapped variable is one real number", "map another"
        )
    return variable


def wire(instance: Instance, spec: ActuatorSpec, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Wiring:
    """Wiring of one instance.

    Raises:
        UnknownName, InputError: as `mapping`; more than 64 variables.
    """
    ins, outs = mapping(spec, instance.facts)
    if max(len(ins), len(outs)) > 64:  # as in stepper.c
        raise InputError(instance.name, "more than 64 variables are mapped", "map fewer")
    return Wiring(
        instance,
        [v.reference for v in ins.values()], [inputs.index(name) for name in ins],
        [v.reference for v in outs.values()], [outputs.index(name) for name in outs],
    )  # fmt: skip
