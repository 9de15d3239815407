"""The hydraulic cylinder in Python, with the FMU's interface and equations: a fallback and a check of the C source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, UnknownName
from skillframe.fmu import DISCARD, OK, OUTPUTS, ActuatorSpec, Capabilities, VariableTable, columns, rows
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.cylinder.macro_step import GIVEN, MEMORY, RESULT, SHOWN
from skillframe_hydraulics.cylinder.routines import Routines

_STATES, _SHOWN = slice(0, len(eq.STATES)), slice(len(RESULT) - len(SHOWN), None)
_MEMORY = slice(len(eq.STATES), len(eq.STATES) + len(MEMORY))


class ReferenceBank:
    """A bank of hydraulic cylinders in Python (see `Actuators`).

    Args:
        specs: the robot's actuators, all "hydraulic_cylinder"; table: of fmus/hydraulic_cylinder.
        trials: number of trials, each with its own cylinders.
        symbolic: False computes in numpy, for comparison.
    """

    def __init__(
        self, specs: Sequence[ActuatorSpec], table: VariableTable, trials: int = 1, *, symbolic: bool = True
    ) -> None:
        self.inputs, self.outputs = columns(specs)
        self.count = trials * len(specs)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        self.notes: tuple[str, ...] = (
            "no C compiler: hydraulic_cylinder runs as its Python reference, the same equations in casadi's"
            " interpreter, five to seven times slower (pip install ziglang is one way to get a compiler)",
        )
        self._specs = [specs[i % len(specs)] for i in range(self.count)]
        self._defaults = {row.name: row.entry.start for row in rows(table) if row.causality == "parameter"}
        self._input_defaults = {row.name: row.entry.start for row in rows(table) if row.causality == "input"}
        known_outputs = {row.name for row in rows(table) if row.causality == "output"}
        self._problems: dict[int, str] = {}
        self._symbolic = symbolic
        into, out_of = [], []
        for i, spec in enumerate(self._specs):
            for theirs in spec.inputs.values():
                if theirs not in self._input_defaults:
                    raise UnknownName("input of hydraulic_cylinder", theirs, self._input_defaults)
            names = {theirs: ours for ours, theirs in reversed(spec.inputs.items())}
            for j, theirs in enumerate(GIVEN[:-1]):
                ours = names.get(theirs, "" if spec.inputs else theirs)
                if ours in self.inputs:
                    into.append((i, j, self.inputs.index(ours)))
            for ours, theirs in (spec.outputs or {n: n for n in OUTPUTS}).items():
                if theirs not in known_outputs:
                    raise UnknownName("output of hydraulic_cylinder", theirs, known_outputs)
                out_of.append((i, self.outputs.index(ours), SHOWN.index(theirs)))
        start = [float(self._input_defaults[name]) for name in GIVEN[:-1]]
        self._start: NDArray[np.float64] = np.tile([*start, 0.0], (self.count, 1))
        self._into, self._out_of = (np.array(found, dtype=np.int64).reshape(-1, 3).T for found in (into, out_of))

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Initialise every cylinder in static equilibrium at `u`. See `Actuators`.

        Raises:
            UnknownName, InputError: an unknown parameter, or one that is not a number.
        """
        self.active[:] = 1
        self._problems.clear()
        chosen = [{**spec.parameters, **(parameters[i] if parameters else {})} for i, spec in enumerate(self._specs)]
        for spec, values in zip(self._specs, chosen, strict=True):
            for name, value in values.items():
                if name not in self._defaults:
                    raise UnknownName("parameter of hydraulic_cylinder", name, self._defaults)
                if not isinstance(value, bool | int | float):
                    raise InputError(f"{spec.name}: {name}", f"expected a number, got {value!r}", "correct it")
        columns_of = {
            name: np.array([float(values.get(name, default)) for values in chosen])
            for name, default in self._defaults.items()
        }
        self._routines = r = Routines(eq.derive(columns_of), self.count, self._symbolic)
        r.given[...] = self._start
        self._take()
        command = r.given[:, 0].copy()
        r.state[...] = eq.equilibrium(r.p, command).T
        r.memory[:, :2] = np.clip(command, -1, 1)[:, None]
        self.refresh()
        r.memory[:, MEMORY.index("force_mean")] = r.shown[:, SHOWN.index("force")]
        self.refresh()

    def _take(self) -> None:
        rows, to, column = self._into
        self._routines.given[rows, to] = self.u[rows, column]

    def _give(self, shown: NDArray[np.float64]) -> None:
        rows, column, of = self._out_of
        self.y[rows, column] = shown[rows, of]

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`. Returns whether every active cylinder succeeded."""
        self._take()
        r = self._routines
        r.given[:, -1] = step
        r.step(self.active)
        result = r.result
        if np.isfinite(result).all() and self.active.all():
            r.state[...], r.memory[...] = result[:, _STATES], result[:, _MEMORY]
            self._give(result[:, _SHOWN])
            self.status[:] = OK
            return True
        bad = ~np.isfinite(result).all(axis=1) & (self.active > 0)
        keep = (self.active > 0) & ~bad
        r.state[keep], r.memory[keep] = result[keep, _STATES], result[keep, _MEMORY]
        rows, column, of = self._out_of[:, keep[self._out_of[0]]]
        self.y[rows, column] = result[:, _SHOWN][rows, of]
        self.status[:] = np.where(bad, DISCARD, OK)
        for i in np.flatnonzero(bad):
            self._problems[int(i)] = f"{self._specs[i].name}: no finite pressures at {time:.6g} s; check its inputs"
        return not bad.any()

    def refresh(self) -> bool:
        """Update the outputs for the present inputs."""
        self._take()
        self._routines.show()
        self._give(self._routines.shown)
        return True

    def save(self) -> None:
        """Store every cylinder's state."""
        self._saved = (self._routines.state.copy(), self._routines.memory.copy())

    def restore(self) -> None:
        """Return to the last `save`."""
        self._routines.state[...], self._routines.memory[...] = self._saved
        self._problems.clear()

    def capabilities(self, index: int) -> Capabilities:
        """All capabilities."""
        return Capabilities(True, True, True, True, True, True)

    def problem(self, index: int) -> str:
        """Why a cylinder failed, or ""."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """Do nothing."""
