"""Actuator banks of a robot in this process, in child processes, or both, and variables that no mapping names.

The last banks are cached between runs, because opening FMUs takes tenths of a second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import UnknownName
from skillframe.fmu.actuator import INPUTS, OUTPUTS, Actuators, ActuatorSpec, Capabilities, columns
from skillframe.fmu.build import find_fmu, fmu_folders
from skillframe.fmu.extract import is_allowed
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.table import read_table


def open_actuators(
    specs: Sequence[ActuatorSpec], trials: int = 1, base: Path | None = None, version: int = 2
) -> Actuators:
    """Bank of these actuators, `trials` times.

    Untrusted FMUs run in child processes, so that a failure ends one trial only.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: see `find_fmu` and the banks.
    """
    paths = [find_fmu(spec.fmu, base, version) for spec in specs]
    facts = [inspect_fmu(path) for path in paths]
    kinds: dict[bool, list[int]] = {}
    for index, path in enumerate(paths):
        kinds.setdefault(is_allowed(path), []).append(index)
    banks: list[tuple[list[int], Actuators]] = []
    for allowed, chosen in sorted(kinds.items(), reverse=True):
        if allowed:
            from skillframe.fmu.driver import FmuBank as Bank
        else:
            from skillframe.fmu.sandbox import SandboxBank as Bank  # type: ignore[assignment]
        banks.append((chosen, Bank([specs[i] for i in chosen], [facts[i] for i in chosen], trials)))
    if len(banks) == 1:
        return banks[0][1]
    return MixedBank(specs, banks)


_KEPT: dict[tuple[Any, ...], Actuators] = {}


def kept(key: tuple[Any, ...], make: Callable[[], Actuators]) -> Actuators:
    """Bank of a key, cached among the last ones."""
    if key not in _KEPT:
        while len(_KEPT) >= 2:
            _KEPT.pop(next(iter(_KEPT))).close()
        _KEPT[key] = make()
    return _KEPT[key]


class _Part(NamedTuple):
    """One bank with its rows and columns in the whole."""

    bank: Actuators
    rows: NDArray[np.int64]
    inputs: NDArray[np.int64]
    outputs: NDArray[np.int64]


class MixedBank:
    """A bank of banks (see `Actuators`), each with its indices into `specs`."""

    def __init__(self, specs: Sequence[ActuatorSpec], banks: Sequence[tuple[Sequence[int], Actuators]]) -> None:
        self.inputs, self.outputs = columns(specs)
        self.count = sum(bank.count for _, bank in banks)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        self.notes: tuple[str, ...] = tuple(note for _, bank in banks for note in bank.notes)
        self._parts, self._owner = list[_Part](), dict[int, tuple[Actuators, int]]()
        first = np.arange(0, self.count, len(specs))
        for kinds, bank in banks:
            rows = (first[:, None] + np.array(kinds)).ravel()
            inputs = np.array([self.inputs.index(name) for name in bank.inputs])
            outputs = np.array([self.outputs.index(name) for name in bank.outputs])
            self._parts.append(_Part(bank, rows, inputs, outputs))
            self._owner.update({int(row): (bank, k) for k, row in enumerate(rows)})

    def _each(self, call: Callable[[_Part], bool | None]) -> bool:
        fine = True
        for part in self._parts:
            part.bank.u[:] = self.u[part.rows[:, None], part.inputs]
            part.bank.active[:] = self.active[part.rows]
            fine &= call(part) is not False
            self.y[part.rows[:, None], part.outputs] = part.bank.y
            self.active[part.rows], self.status[part.rows] = part.bank.active, part.bank.status
        return fine

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """See `Actuators.start`."""
        self._each(lambda p: p.bank.start(time, None if parameters is None else [parameters[i] for i in p.rows]))

    def step(self, time: float, step: float) -> bool:
        """See `Actuators.step`."""
        return self._each(lambda part: part.bank.step(time, step))

    def refresh(self) -> bool:
        """See `Actuators.refresh`."""
        return self._each(lambda part: part.bank.refresh())

    def save(self) -> None:
        """See `Actuators.save`."""
        self._each(lambda part: part.bank.save())

    def restore(self) -> None:
        """See `Actuators.restore`."""
        self._each(lambda part: part.bank.restore())

    def capabilities(self, index: int) -> Capabilities:
        """See `Actuators.capabilities`."""
        bank, own = self._owner[index]
        return bank.capabilities(own)

    def problem(self, index: int) -> str:
        """See `Actuators.problem`."""
        bank, own = self._owner[index]
        return bank.problem(own)

    def close(self) -> None:
        """See `Actuators.close`."""
        for part in self._parts:
            part.bank.close()


class Unmapped(NamedTuple):
    """Unmapped variables of one FMU: joints, inputs with start values, outputs."""

    fmu: str
    joints: tuple[str, ...]
    inputs: dict[str, str]
    outputs: tuple[str, ...]

    @property
    def sentences(self) -> list[str]:
        """A sentence each for inputs and outputs, if any."""
        whose, found = f"of {self.fmu} on {', '.join(self.joints)}", []
        if self.inputs:
            kept = ", ".join(f"{name} ({start})" for name, start in self.inputs.items())
            found.append(f"no inputs entry writes {kept} {whose}; such an input keeps its start value")
        if self.outputs:
            found.append(f"no outputs entry reads {', '.join(self.outputs)} {whose}")
        return found


def unmapped(
    specs: Sequence[ActuatorSpec], unused: Sequence[Sequence[str]], base: Path | None = None
) -> list[Unmapped]:
    """Unmapped variables, one entry for joints with the same FMU and mapping, but for `unused` ones.

    Raises:
        InputError, UnknownName: an FMU cannot be found or read, or lacks a name in `unused`.
    """
    rows: dict[tuple[object, ...], Unmapped] = {}
    for spec, meant in zip(specs, unused, strict=True):
        if (folder := fmu_folders().get(spec.fmu)) is not None:
            table = read_table(folder)
            inputs = {name: f"{entry.start:g}" for name, entry in table.input.items()}
            outputs = list(table.output)
        else:
            facts = inspect_fmu(find_fmu(spec.fmu, base))
            inputs = {name: facts.variables[name].start or "0" for name in facts.names("input")}
            outputs = facts.names("output")
        for name in meant:
            if name not in inputs and name not in outputs:
                known = [*inputs, *outputs]
                raise UnknownName("input or output", name, known, f"in unused of the [[actuation]] of {spec.name}")
        written = set(spec.inputs.values() or INPUTS) | set(meant)
        read = set(spec.outputs.values() or OUTPUTS) | set(meant)
        row = Unmapped(
            spec.fmu, (), {name: start for name, start in inputs.items() if name not in written},
            tuple(name for name in outputs if name not in read),
        )  # fmt: skip
        key = (row.fmu, tuple(row.inputs.items()), row.outputs)
        rows[key] = row._replace(joints=(*rows.get(key, row).joints, spec.name))
    return [row for row in rows.values() if row.inputs or row.outputs]
