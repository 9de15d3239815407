"""`FmuBank`: trusted FMUs driven inside this process, loaded once and reset between runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skillframe.fmu.actuator import DISCARD, OK, STATUS_TEXT, ActuatorSpec, Capabilities
from skillframe.fmu.bindings import Instance
from skillframe.fmu.inspection import FmuFacts
from skillframe.fmu.probe import probe
from skillframe.fmu.stepper import SlotTable, compiled_step, native_step, python_step
from skillframe.fmu.wiring import columns, wire


class FmuBank:
    """A bank of FMU instances (see `Actuators`), stepped by one C call where there is a compiler.

    Args:
        specs: the robot's actuators; facts: of their files.
        trials: each trial gets its own instances, trial by trial.
        compiled: False forces the ctypes path.

    Raises:
        InputError, UnknownName: not runnable here, or a mapping that does not fit.
        InstanceFailed: a library that does not load.
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
        """Address of the slots, their number, and address of the C function that steps them, where there is one."""
        self._step = fast or python_step(self._table, self.active)

    def _spec(self, index: int) -> ActuatorSpec:
        return self._specs[index % len(self._specs)]

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Reset every instance and initialise it at `u`.

        Args:
            time: start time [s].
            parameters: one mapping per instance, on top of the specs' own.

        Raises:
            InstanceFailed, UnknownName, InputError: an FMU refuses, or a parameter is not there or not of its type.
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
        """Advance from `time` by `step` [s] with inputs `u`. Returns True if every active instance went well."""
        return self.settle(time, self._step(time, step))

    def refresh(self) -> bool:
        """Outputs at the present inputs. No time passes."""
        return self.settle(self._time, self._step(self._time, 0.0))

    def settle(self, time: float, worst: int) -> bool:
        """See to those that failed at `time`, the worst with this status. Returns True if none did."""
        self._time = time
        if worst < DISCARD:
            return True
        for i, status in enumerate(self._table.statuses()):
            self.status[i] = status
            if self.active[i] and status >= DISCARD:
                self._problems[i] = self._instances[i].sentence(f"{STATUS_TEXT[status]} at {self._time:.6g} s")
                self.active[i] = status == DISCARD  # a refused step may be tried again, shorter
        return False

    def save(self) -> None:
        """Remember the state of every active instance."""
        for i in np.flatnonzero(self.active):
            self._instances[i].save()

    def restore(self) -> None:
        """Return to the last `save`. Statuses are cleared."""
        for i in np.flatnonzero(self.active):
            self._instances[i].restore()
            self._problems.pop(int(i), None)
            self.status[i] = OK

    def capabilities(self, index: int) -> Capabilities:
        """What one instance can do: its mapping, and what `probe` found out about its file."""
        kind = index % len(self._specs)
        if kind not in self._capabilities:
            self._capabilities[kind] = probe(self._facts[kind], self._specs[kind])
        return self._capabilities[kind]

    def problem(self, index: int) -> str:
        """Why an instance failed, one sentence, or empty if it did not."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """Free every instance."""
        for instance in self._instances:
            instance.close()
        self._instances = []
