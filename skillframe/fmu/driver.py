"""`FmuBank`: trusted FMUs in this process, loaded once and reset between runs, and tests of an FMU's claims.

`probe` tries whether steps repeat from a saved state, and whether outputs follow inputs without a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.fmu.actuator import DISCARD, OK, STATUS_TEXT, ActuatorSpec, Capabilities, columns
from skillframe.fmu.bindings import Instance, InstanceFailed
from skillframe.fmu.facts import FLOATS, FmuFacts, FmuVariable
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.stepper import SlotTable, compiled_step, mapping, native_step, python_step, wire

STEP = 1e-3


def probe(facts: FmuFacts, spec: ActuatorSpec) -> Capabilities:
    """Capabilities of an FMU under a mapping, from two short instances.

    Raises:
        InstanceFailed: it does not start.
    """
    inputs, outputs = mapping(spec, facts)
    values = tuple(sorted((k, v) for k, v in spec.parameters.items() if isinstance(v, float | int | str)))
    rollback, refresh = _tried(facts.path, facts.digest, tuple(sorted(_refs(inputs))), tuple(_refs(outputs)), values)
    return Capabilities(
        acceleration="acceleration" in inputs, force_mean="force_mean" in outputs, work="work" in outputs,
        rollback=rollback, variable_step=facts.variable_step, refresh=refresh,
    )  # fmt: skip


def try_out(facts: FmuFacts) -> bool:
    """Do ten steps with default inputs. Returns whether a saved state repeats.

    Raises:
        InstanceFailed: it does not start or step.
    """
    outputs = tuple(
        (v.name, v.reference)
        for v in facts.variables.values()
        if v.causality == "output" and v.type in FLOATS and v.size == 1
    )
    instance = Instance(facts, facts.name)
    try:
        instance.start({}, {}, 0.0)
        repeats = facts.saves_state and _repeats(instance, outputs)
        for k in range(10):
            try:
                _advance(instance, k * STEP)
            except Exception as error:
                raise InstanceFailed(instance.sentence(f"failed at {k * STEP:g} s: {error}")) from None
        for (name, _), value in zip(outputs, _read(instance, outputs) if outputs else [], strict=True):
            if value - value != 0.0:
                raise InstanceFailed(instance.sentence(f"output {name} is {value} after {10 * STEP:g} s"))
        return repeats
    finally:
        instance.close()


def _refs(variables: dict[str, FmuVariable]) -> list[tuple[str, int]]:
    return [(name, v.reference) for name, v in variables.items()]


@lru_cache(maxsize=64)
def _tried(
    path: Path, digest: str, inputs: tuple[tuple[str, int], ...], outputs: tuple[tuple[str, int], ...],
    parameters: tuple[tuple[str, object], ...],
) -> tuple[bool, bool]:  # fmt: skip
    facts = inspect_fmu(path)
    instance = Instance(facts, facts.name)
    try:
        start = {reference: _start(facts, reference) for _, reference in inputs}
        instance.start(dict(parameters), start, 0.0)
        return _repeats(instance, outputs) if facts.saves_state else False, _follows(instance, dict(inputs), outputs)
    finally:
        instance.close()


def _start(facts: FmuFacts, reference: int) -> float:
    found = next(v for v in facts.variables.values() if v.reference == reference and v.causality == "input")
    return float(found.start or 0.0)


def _read(instance: Instance, outputs: tuple[tuple[str, int], ...]) -> list[float]:
    references = [reference for _, reference in outputs]
    return instance.get_values("Real" if instance.version == 2 else "Float64", references, len(references))


def _advance(instance: Instance, time: float) -> None:
    instance.do_step(time, STEP)


def _repeats(instance: Instance, outputs: tuple[tuple[str, int], ...]) -> bool:
    try:
        instance.save()
        results = []
        for _ in range(2):
            _advance(instance, 0.0)
            _advance(instance, STEP)
            results.append(_read(instance, outputs))
            instance.restore()
        return results[0] == results[1]
    except Exception:
        return False


def _follows(instance: Instance, inputs: dict[str, int], outputs: tuple[tuple[str, int], ...]) -> bool:
    moved = [reference for name, reference in inputs.items() if name in ("position", "velocity")]
    if not moved:
        return False
    try:
        before = _read(instance, outputs)
        real = "Real" if instance.version == 2 else "Float64"
        shifted = [1e-3 + v for v in instance.get_values(real, moved, len(moved))]
        instance.set_values(real, moved, shifted)
        return before != _read(instance, outputs)
    except Exception:
        raise InstanceFailed(instance.sentence("fails when outputs are read between steps")) from None


class FmuBank:
    """A bank of FMU instances (see `Actuators`), stepped by one C call if `compiled` and possible.

    Raises:
        InputError, UnknownName: not runnable here, or a mapping does not fit.
        InstanceFailed: a library does not load.
    """

    def __init__(
        self, specs: Sequence[ActuatorSpec], facts: Sequence[FmuFacts], trials: int = 1, compiled: bool = True
    ) -> None:
        self.inputs, self.outputs = columns(specs)
        self.count = trials * len(specs)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        self.notes: tuple[str, ...] = ()
        self._specs, self._facts = list(specs), list(facts)
        self._time = 0.0
        self._problems: dict[int, str] = {}
        self._capabilities: dict[int, Capabilities] = {}
        names = [spec.name or fact.name for spec, fact in zip(specs, facts, strict=True)]
        self._instances = [
            Instance(facts[k], names[k])
            for trial in range(trials) for k in range(len(specs))
        ]  # fmt: skip
        wirings = [wire(x, self._spec(i), self.inputs, self.outputs) for i, x in enumerate(self._instances)]
        self._table = SlotTable(wirings, self.u, self.y)
        fast = compiled_step(self._table, self.active) if compiled else None
        self.compiled = fast is not None
        self.native = native_step(self._table) if self.compiled else None
        """Address and number of the slots, and address of the C step function, or None."""
        self._step = fast or python_step(self._table, self.active)

    def _spec(self, index: int) -> ActuatorSpec:
        return self._specs[index % len(self._specs)]

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Reset every instance and initialise it at `u`, with `parameters` of each added to the specs'.

        Raises:
            InstanceFailed, UnknownName, InputError: an FMU refuses, or a parameter is unknown or of wrong type.
        """
        self.active[:] = 1
        self._problems.clear()
        self._time = time
        for i, wiring in enumerate(self._table.wirings):
            chosen = {**self._spec(i).parameters, **(parameters[i] if parameters else {})}
            inputs = {r: float(self.u[i, c]) for r, c in zip(wiring.in_refs, wiring.in_columns, strict=True)}
            wiring.instance.start(chosen, inputs, time)
        self.refresh()

    def step(self, time: float, step: float) -> bool:
        """See `Actuators.step`."""
        return self.settle(time, self._step(time, step))

    def refresh(self) -> bool:
        """See `Actuators.refresh`."""
        return self.settle(self._time, self._step(self._time, 0.0))

    def settle(self, time: float, worst: int) -> bool:
        """Record failures at `time` for a worst status. Returns True if there are none."""
        self._time = time
        if worst < DISCARD:
            return True
        for i, status in enumerate(self._table.statuses()):
            self.status[i] = status
            if self.active[i] and status >= DISCARD:
                self._problems[i] = self._instances[i].sentence(f"{STATUS_TEXT[status]} at {self._time:.6g} s")
                self.active[i] = status == DISCARD  # it may be retried with a shorter step
        return False

    def save(self) -> None:
        """See `Actuators.save`."""
        for i in np.flatnonzero(self.active):
            self._instances[i].save()

    def restore(self) -> None:
        """See `Actuators.restore`. Clears statuses."""
        for i in np.flatnonzero(self.active):
            self._instances[i].restore()
            self._problems.pop(int(i), None)
            self.status[i] = OK

    def capabilities(self, index: int) -> Capabilities:
        """Capabilities from mapping and `probe`."""
        kind = index % len(self._specs)
        if kind not in self._capabilities:
            self._capabilities[kind] = probe(self._facts[kind], self._specs[kind])
        return self._capabilities[kind]

    def problem(self, index: int) -> str:
        """See `Actuators.problem`."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """See `Actuators.close`."""
        for instance in self._instances:
            instance.close()
        self._instances = []
